"""The TOML file of `agree`: programs, inputs, outputs and limits."""

import itertools
import math
import re
import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.pipes import read_input
from pyharness.model.scene_file import toml_of

FORMS = ("text", "csv", "json", "unformatted")
UNITS = ("ulp", "relative", "absolute")
COMPILERS = {".f": "gfortran", ".for": "gfortran", ".f90": "gfortran", ".c": "gcc"}
"""Compilers by the ending of the source."""
FLAGS = {"gfortran": ("-O2", "-std=legacy"), "gcc": ("-O2",)}
_LARGEST = 1 << 24  # most bytes of a file
_MOST_RUNS = 10_000
_SECONDS = 60.0
_KEYS = {
    "": ("programs", "inputs", "outputs", "limits", "record", "seconds"),
    "program": ("command", "function", "source", "compiler", "flags", "libraries"),
    "inputs": ("table", "grid", "random", "draws", "seed", "files", "text", "file"),
    "outputs": ("columns", "form", "file", "labels", "carriage_control", "kind"),
    "limit": (*UNITS, "because"),
}


@dataclass(frozen=True)
class Program:
    """A program: a command, a source to be compiled, or a function of Python or a library."""

    name: str
    command: tuple[str, ...] = ()
    function: str = ""  # as in module:name, file.py:name or library.so:name
    source: Path | None = None
    compiler: str = ""
    flags: tuple[str, ...] = ()
    libraries: tuple[str, ...] = ()  # further sources, and options such as -llapack


@dataclass(frozen=True)
class Outputs:
    columns: tuple[str, ...]
    form: str = "text"
    file: str = ""  # written by the program; empty for its standard output
    labels: bool = False  # whether rows of text have words beside the numbers
    carriage_control: bool = False  # whether the first character of a line is not printed
    kind: str = "<f8"  # NumPy's type of the numbers in unformatted records


@dataclass(frozen=True)
class Limit:
    unit: str = "ulp"
    value: float = 0.0
    because: str = "the programs perform the same operations"


@dataclass(frozen=True)
class Run:
    """One input: the values by name, and the text that the program reads."""

    name: str
    values: Mapping[str, Any]
    text: str


@dataclass(frozen=True)
class Plan:
    path: Path
    programs: tuple[Program, ...]  # the original is first
    runs: tuple[Run, ...]
    input_file: str  # in which the text is written; empty for standard input
    outputs: Outputs
    limits: Mapping[str, Limit]  # by column
    record: Path | None
    seconds: float  # time limit of a run

    @property
    def original(self) -> Program:
        return self.programs[0]

    @property
    def ports(self) -> tuple[Program, ...]:
        return self.programs[1:]


def read_plan(path: str) -> Plan:
    where = f"'{path}'"
    data = toml_of(read_input(path, where, _LARGEST, "a TOML file"), where)
    reader = _Reader(where, Path(path).resolve().parent)
    reader.check(data, "", "")
    if len(reader.table(data, "programs")) < 1:
        raise InputError(f"{where}: no [programs.NAME]; give the original first, then its ports")
    programs = tuple(reader.program(name, each) for name, each in data["programs"].items())
    outputs = reader.outputs(reader.table(data, "outputs"))
    inputs = reader.table(data, "inputs") if "inputs" in data else {}
    reader.check(inputs, "inputs", "inputs")
    limits = reader.limits(data.get("limits", {}), outputs.columns)
    seconds = reader.take(data, "seconds", (int, float), _SECONDS)
    if not seconds > 0.0:
        raise InputError(f"{where}: seconds is {seconds}; allowed: a time limit above 0")
    record = reader.take(data, "record", (str,), "")
    return Plan(
        Path(path), programs, tuple(reader.runs(inputs)), reader.file(inputs),
        outputs, limits, reader.folder / record if record else None, float(seconds),
    )  # fmt: skip


class _Reader:
    def __init__(self, where: str, folder: Path) -> None:
        self.where, self.folder = where, folder

    def check(self, table: Mapping[str, Any], kind: str, place: str) -> None:
        for key in table:
            if key not in _KEYS[kind]:
                raise unknown("key", key, _KEYS[kind], f"{self.where} {place}".strip())

    def take(self, table: Mapping[str, Any], key: str, kinds: tuple[type, ...], other: Any) -> Any:
        value = table.get(key, other)
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            wanted = kind_of(kinds[-1]())
            raise InputError(f"{self.where}: {key} is {kind_of(value)}; allowed: {wanted}")
        return value

    def table(self, data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
        found: Mapping[str, Any] = self.take(data, key, (dict,), {})
        return found

    def texts(self, table: Mapping[str, Any], key: str, other: Iterable[str]) -> tuple[str, ...]:
        found = self.take(table, key, (list,), list(other))
        if not all(isinstance(each, str) for each in found):
            raise InputError(f"{self.where}: {key} has other items than text; allowed: text")
        return tuple(found)

    def file(self, table: Mapping[str, Any]) -> str:
        name: str = self.take(table, "file", (str,), "")
        if "/" in name or "\0" in name or name in (".", ".."):
            raise InputError(f"{self.where}: file is '{name}'; allowed: a name without a folder")
        return name

    def program(self, name: str, table: Any) -> Program:
        place = f"programs.{name}"
        if not isinstance(table, dict):
            raise InputError(f"{self.where}: {place} is {kind_of(table)}; allowed: a table")
        self.check(table, "program", place)
        kinds = [each for each in ("command", "function", "source") if each in table]
        if len(kinds) != 1:
            raise InputError(f"{self.where} {place}: give one of command, function and source")
        text = self.take(table, kinds[0], (str,), "")
        if kinds[0] == "command":
            try:
                words = shlex.split(text)
            except ValueError as error:
                raise InputError(f"{self.where} {place}: command: {error}") from None
            if not words:
                raise InputError(f"{self.where} {place}: command is empty; give a command")
            return Program(name, command=tuple(map(self._absolute, words)))
        if kinds[0] == "function":
            before, colon, after = text.rpartition(":")
            if not colon or not before or not after:
                raise InputError(
                    f"{self.where} {place}: function is '{text}'; allowed: as in module:name, "
                    "file.py:name or library.so:name"
                )
            return Program(name, function=f"{self._absolute(before)}:{after}")
        source = self.folder / text
        if not source.is_file():
            raise InputError(f"{self.where} {place}: source '{text}' is no file")
        compiler = self.take(table, "compiler", (str,), COMPILERS.get(source.suffix.lower(), ""))
        if not compiler:
            raise InputError(f"{self.where} {place}: give compiler for '{text}'")
        flags = self.texts(table, "flags", FLAGS.get(compiler, ()))
        more = tuple(map(self._absolute, self.texts(table, "libraries", ())))
        return Program(name, source=source, compiler=compiler, flags=flags, libraries=more)

    def _absolute(self, word: str) -> str:
        # Programs run in an empty folder.
        return str(self.folder / word) if (self.folder / word).is_file() else word

    def outputs(self, table: Mapping[str, Any]) -> Outputs:
        self.check(table, "outputs", "outputs")
        columns = self.texts(table, "columns", ())
        if not columns or len({*columns}) < len(columns):
            raise InputError(f"{self.where} outputs: give columns, a list of different names")
        form = self.take(table, "form", (str,), "text")
        if form not in FORMS:
            raise unknown("form", form, FORMS, f"{self.where} outputs")
        file = self.file(table)
        if form == "unformatted" and not file:
            raise InputError(f"{self.where} outputs: give file, which has the unformatted records")
        kind = self.take(table, "kind", (str,), Outputs.kind)
        if not re.fullmatch(r"[<>=]?f[48]", kind):
            raise InputError(f"{self.where} outputs: kind is '{kind}'; allowed: as in <f8 or >f4")
        labels, control = (
            self.take(table, key, (bool,), False) for key in ("labels", "carriage_control")
        )
        return Outputs(columns, form, file, labels, control, kind)

    def limits(self, table: Any, columns: Iterable[str]) -> dict[str, Limit]:
        if not isinstance(table, dict):
            raise InputError(f"{self.where}: limits is {kind_of(table)}; allowed: a table")
        found: dict[str, Limit] = {}
        for name, given in table.items():
            if name not in (*columns, "default"):
                raise unknown("column", name, [*columns, "default"], f"{self.where} limits")
            place = f"limits.{name}"
            given = self.table(table, name)
            self.check(given, "limit", place)
            units = [each for each in UNITS if each in given]
            if len(units) != 1:
                raise InputError(f"{self.where} {place}: give one of {', '.join(UNITS)}")
            value = self.take(given, units[0], (int, float), 0.0)
            because = self.take(given, "because", (str,), "").strip()
            if not 0.0 <= value < float("inf"):
                raise InputError(f"{self.where} {place}: {value}; allowed: finite, at least 0")
            if value and not because:
                raise InputError(f"{self.where} {place}: give because, the reason of the limit")
            found[name] = Limit(units[0], float(value), because or Limit.because)
        return {name: found.get(name, found.get("default", Limit())) for name in columns}

    def runs(self, table: Mapping[str, Any]) -> Iterable[Run]:
        kinds = [each for each in ("table", "grid", "random", "files") if each in table]
        if len(kinds) > 1:
            raise InputError(f"{self.where} inputs: give one of table, grid, random and files")
        if not kinds:
            return [Run("run-1", {}, self.take(table, "text", (str,), ""))]
        if kinds == ["files"]:
            return [Run(name, {}, self._text_of(name)) for name in self.texts(table, "files", ())]
        given = self.table(table, kinds[0])
        for name, values in given.items():
            if not isinstance(values, list) or not values:
                raise InputError(f"{self.where} inputs: {name} is no list; allowed: values")
        rows = list(itertools.islice(self._rows[kinds[0]](self, table, given), _MOST_RUNS + 1))
        if not 0 < len(rows) <= _MOST_RUNS:
            raise InputError(f"{self.where} inputs: allowed: 1 to {_MOST_RUNS} runs")
        form = self.take(table, "text", (str,), " ".join(f"{{{name}}}" for name in given) + "\n")
        return [
            Run(
                f"run-{n}",
                dict(zip(given, row, strict=True)),
                fill(form, zip(given, row, strict=True)),
            )
            for n, row in enumerate(rows, 1)
        ]

    def _text_of(self, name: str) -> str:
        content = read_input(self.folder / name, f"{self.where} inputs", _LARGEST, "files")
        return content.decode("utf-8", "surrogateescape")

    def _table_rows(self, table: Mapping[str, Any], given: Mapping[str, Any]) -> Iterable[Any]:
        if len({len(values) for values in given.values()}) > 1:
            raise InputError(f"{self.where} inputs: the columns of table have different lengths")
        return zip(*given.values(), strict=True)

    def _random_rows(self, table: Mapping[str, Any], given: Mapping[str, Any]) -> Iterable[Any]:
        source = Random(str(self.take(table, "seed", (int, str), "agree")))
        for name, ends in given.items():
            if not _is_range(ends):
                raise InputError(f"{self.where} inputs: {name}; allowed: [least, most]")
        for _ in range(self.take(table, "draws", (int,), 20)):
            yield [
                (source.randint if all(isinstance(x, int) for x in ends) else source.uniform)(*ends)
                for ends in given.values()
            ]

    _rows: Mapping[str, Callable[..., Iterable[Any]]] = {
        "table": _table_rows,
        "grid": lambda self, table, given: itertools.product(*given.values()),
        "random": _random_rows,
    }


def _is_range(ends: list[Any]) -> bool:
    kinds = all(isinstance(x, int | float) and math.isfinite(x) for x in ends)
    return kinds and len(ends) == 2 and ends[0] <= ends[1]


def fill(text: str, pairs: Iterable[tuple[str, Any]]) -> str:
    """Return a text with values, in all digits, in place of names in braces."""
    for name, value in pairs:
        text = text.replace(f"{{{name}}}", value if isinstance(value, str) else repr(value))
    return text
