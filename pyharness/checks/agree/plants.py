"""Self-test of a comparison: faults planted in a port's results, and in its Python source."""

import ast
import math
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np

from pyharness.checks.agree.comparing import are_same, compare, with_zeros
from pyharness.checks.agree.plan import Plan, Program
from pyharness.checks.agree.programs import answers
from pyharness.checks.agree.reading import ASTERISKS, Rows, Value
from pyharness.checks.plants.outcome import Outcome, control
from pyharness.checks.port_process import PortError

MUTATIONS = 12
"""The number of mutations of a port in Python."""
_FACTOR = 4.0  # planted distance, in limits
_PATIENCE = 20.0  # s; a mutation may loop without end
Plant = Callable[[list[Rows], Plan], list[Rows]]


def self_test(plan: Plan, original: Sequence[Rows], port: Program) -> Iterator[Outcome]:
    """Yield the outcome without a fault (the control), then with each planted fault."""
    try:
        right = answers(plan, port)
    except PortError as error:
        yield control(1, str(error))
        return
    found = compare(plan, original, right)
    yield control(int(not found.passed), f"first: {found.first}" if found.first else "all agree")
    for name, (fault, plant) in _plants(plan).items():
        yield _outcome(plan, original, right, name, fault, plant([list(x) for x in right], plan))
    for number, (fault, program) in enumerate(_mutations(port), 1):
        with program as mutated:
            name = f"mutation-{number}"
            try:
                rows = answers(replace(plan, seconds=min(plan.seconds, _PATIENCE)), mutated)
            except PortError as error:
                yield Outcome(name, fault, True, 1, f"found: {error}")
                continue
        yield _outcome(plan, original, right, name, fault, rows)


def _outcome(
    plan: Plan, original: Sequence[Rows], right: Sequence[Rows], name: str, fault: str,
    rows: list[Rows],
) -> Outcome:  # fmt: skip
    if are_same(right, rows):
        return Outcome(name, fault, True, 0, "no effect on any cell", has_effect=False)
    found = compare(plan, original, rows)
    lost = [*found.missing, *found.additional]
    where = found.first or (lost[0] if lost else None)
    failed = sum(x.beyond for x in found.columns) + len(lost)
    note = f"found: {where}" if where else "NOT FOUND: the limits allow it"
    return Outcome(name, fault, not found.passed, failed, note)


def _plants(plan: Plan) -> dict[str, tuple[str, Plant]]:
    plants: dict[str, tuple[str, Plant]] = {
        f"beyond-{name}": (
            f"one value of {name} is moved by {_FACTOR:g} limits, at least 1 ulp",
            _at_cell(k, lambda x, plan, k=k: _move(x, plan, k)),
        )
        for k, name in enumerate(plan.outputs.columns)
    }
    plants |= {
        f"zero-{name}": (
            f"all values of {name} are 0 (or 1)",
            lambda rows, plan, k=k: with_zeros(rows, k),  # type: ignore[misc]
        )
        for k, name in enumerate(plan.outputs.columns)
    }
    for name, fault, value in (
        ("nan", "the last value is NaN", math.nan),
        ("infinite", "the last value is infinite", math.inf),
        ("asterisks", "the last value did not fit its field", ASTERISKS),
    ):  # fmt: skip
        plants[name] = (fault, _at_cell(-1, lambda x, plan, value=value: value))
    plants |= {
        "sign": ("the first column has the opposite sign", _each(lambda x: -x)),
        "binary32": ("all values are rounded to binary32", _each(_in_binary32)),
        "columns-swapped": ("two columns are exchanged", _by_row(lambda r: [*r[1::-1], *r[2:]])),
        "row-lost": ("the last row is missing", _at_last(lambda x: x[:-1])),
        "row-added": ("the last row occurs twice", _at_last(lambda x: [*x, x[-1]])),
        "half": ("the second half of the rows is missing", _at_all(lambda x: x[: len(x) // 2])),
        "rows-late": ("each row is the row before", _at_all(lambda x: [x[0], *x[:-1]])),
        "stale": ("each answer is the answer before", lambda rows, plan: [rows[0], *rows[:-1]]),
    }  # fmt: skip
    return plants


def _at_cell(column: int, change: Callable[..., Value]) -> Plant:
    def plant(rows: list[Rows], plan: Plan) -> list[Rows]:
        *before, last = rows[-1]
        last = [*last]
        last[column] = change(last[column], plan)
        return [*rows[:-1], [*before, last]]

    return plant


def _move(x: Value, plan: Plan, k: int) -> Value:
    limit = plan.limits[plan.outputs.columns[k]]
    if isinstance(x, str) or not math.isfinite(x):
        return 1.0
    unit = {"ulp": float(np.spacing(abs(x))), "relative": abs(x), "absolute": 1.0}[limit.unit]
    return x + max(_FACTOR * limit.value * unit, float(np.spacing(abs(x))))


def _at_last(change: Callable[[Rows], Rows]) -> Plant:
    return lambda rows, plan: [*rows[:-1], change(rows[-1])]


def _at_all(change: Callable[[Rows], Rows]) -> Plant:
    return lambda rows, plan: [change(x) for x in rows]


def _each(change: Callable[[float], float]) -> Plant:
    return _by_row(lambda row: [x if isinstance(x, str) else change(x) for x in row])


def _by_row(change: Callable[[list[Value]], list[Value]]) -> Plant:
    return _at_all(lambda x: [change(row) for row in x])


def _in_binary32(x: float) -> float:
    with np.errstate(all="ignore"):
        return float(np.float32(x))


def _source_of(port: Program) -> Path | None:
    words = [port.function.rpartition(":")[0], *port.command]
    return next((Path(x) for x in words if x.endswith(".py") and Path(x).is_file()), None)


class _Copy:
    """A changed copy of a port's folder, as a context manager that returns the program."""

    def __init__(self, port: Program, source: Path, text: str) -> None:
        self._port, self._source, self._text = port, source, text

    def __enter__(self) -> Program:
        self._place = TemporaryDirectory()
        folder = Path(self._place.name)
        for each in self._source.parent.glob("*.py"):
            shutil.copy(each, folder)
        new = folder / self._source.name
        new.write_text(self._text)
        old = str(self._source)
        command = tuple(str(new) if x == old else x for x in self._port.command)
        return replace(
            self._port, command=command, function=self._port.function.replace(old, str(new))
        )

    def __exit__(self, *error: object) -> None:
        self._place.cleanup()


def _mutations(port: Program) -> Iterator[tuple[str, _Copy]]:
    source = _source_of(port)
    if source is None:
        return
    text = source.read_text()
    places = [n for n, node in enumerate(ast.walk(ast.parse(text))) if _is_mutable(node)]
    chosen = sorted(Random("agree").sample(places, min(MUTATIONS, len(places))))
    for place in chosen:
        tree = ast.parse(text)
        node = [*ast.walk(tree)][place]
        old, line = ast.unparse(node), node.lineno  # type: ignore[attr-defined]
        _mutate(node)
        yield f"line {line}: {old} is {ast.unparse(node)}", _Copy(port, source, ast.unparse(tree))


_OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Lt: ast.GtE,
    ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.GtE: ast.Lt, ast.USub: ast.UAdd,
}  # fmt: skip


def _is_mutable(node: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, float)
    if isinstance(node, ast.Compare):
        return type(node.ops[0]) in _OPERATORS
    return type(getattr(node, "op", None)) in _OPERATORS


def _mutate(node: ast.AST) -> None:
    if isinstance(node, ast.Constant):
        node.value = node.value * 1.0625 if node.value else 1.0  # type: ignore[operator]
    elif isinstance(node, ast.Compare):
        node.ops[0] = _OPERATORS[type(node.ops[0])]()  # type: ignore[call-overload]
    else:
        node.op = _OPERATORS[type(node.op)]()  # type: ignore[attr-defined]
