"""Rows of numbers from the outputs of programs, as FORTRAN and other languages write them."""

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

import numpy as np

from pyharness.checks.agree.plan import Outputs
from pyharness.checks.port_process import PortError
from pyharness.model.json_text import parse_json
from pyharness.model.report import counted

ASTERISKS = "asterisks"
"""Stands for a number that was too long for its field."""
Value = float | str
Rows = list[list[Value]]

_END = r"(?![\w.])"
# Without E if the exponent has three digits; D and Q as in FORTRAN.
_NUMBER = re.compile(
    r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EDQedq] ?[-+]?\d+|[-+]\d{3}(?![\d.]))?"
    rf"|[-+]?(?:nan(?:\([^)]*\))?|inf(?:inity)?){_END}|\*+",
    re.IGNORECASE,
)
_BARE = re.compile(r"(?<=[\d.])([-+]\d{3})$")
_WORDS = re.compile(r"[A-Za-z_]\w*(?![\w(])")


def printed_value(text: str) -> Value:
    """Return a printed number; asterisks, and text that is no number, as text."""
    text = text.strip()
    if text and not text.strip("*"):
        return ASTERISKS
    plain = _BARE.sub(r"E\1", re.sub(r"[DdQq] ?(?=[-+\d])", "E", text.replace("E ", "E")))
    try:
        return float(re.sub(r"\(.*\)", "", plain))
    except ValueError:
        return text[:40]


def read_rows(content: bytes, outputs: Outputs, path: Path | None = None) -> Rows:
    """Return the rows of an output, or raise PortError if there are none."""
    width = len(outputs.columns)
    if outputs.form == "unformatted":
        rows = _unformatted(content, outputs)
    else:
        text = content.decode("utf-8", "replace")
        if outputs.carriage_control:
            text = "\n".join(line[1:] for line in text.split("\n"))
        rows = {"text": _text, "csv": _csv, "json": _json}[outputs.form](text, outputs)
    for number, row in enumerate(rows, 1):
        if len(row) != width:
            told = counted(len(row), "number")
            raise PortError(f"row {number} has {told}; {width} columns are expected")
    if not rows:
        raise PortError(f"no row of {width} numbers in its output ({len(content)} bytes)")
    return rows


def _text(text: str, outputs: Outputs) -> Rows:
    rows = []
    for line in text.splitlines():
        tokens, rest = _NUMBER.findall(line), _NUMBER.sub(" ", line)
        if outputs.labels:
            # A word such as X1 or E contains no number.
            line = re.sub(r"[A-Za-z_]\w*(?=\s*[=:]|\s|$)", _kept, line)
            tokens, rest = _NUMBER.findall(line), ""
        if len(tokens) == len(outputs.columns) and not rest.strip(" ,;\t\f\r"):
            rows.append([printed_value(token) for token in tokens])
    return rows


def _kept(word: "re.Match[str]") -> str:
    return word[0] if _NUMBER.fullmatch(word[0]) else " "


def _csv(text: str, outputs: Outputs) -> Rows:
    rows = [row for row in csv.reader(io.StringIO(text)) if row]
    places: Sequence[int] = range(len(outputs.columns))
    heads = [each.strip() for each in rows[0]] if rows else []
    if {*outputs.columns} <= {*heads}:
        rows, places = rows[1:], [heads.index(name) for name in outputs.columns]
    return [[printed_value(row[k]) for k in places if k < len(row)] for row in rows]


def _json(text: str, outputs: Outputs) -> Rows:
    try:
        found: Any = parse_json(text, only_finite=False)
    except (ValueError, RecursionError) as error:
        raise PortError(f"no JSON: {error}") from None
    if isinstance(found, dict):
        columns = [found.get(name) for name in outputs.columns]
        if not all(isinstance(each, list) for each in columns):
            raise PortError("its JSON has no list for each column")
        if len({len(each) for each in columns}) > 1:  # type: ignore[arg-type]
            raise PortError("its columns have different lengths")
        found = [*zip(*columns, strict=True)]
    if not isinstance(found, list):
        raise PortError("its JSON is no list of rows")
    rows = [[row[x] for x in outputs.columns if x in row] if isinstance(row, dict) else row
            for row in found]  # fmt: skip
    rows = [row if isinstance(row, list | tuple) else [row] for row in rows]
    return [[_json_value(x) for x in row] for row in rows]


def _json_value(value: Any) -> Value:
    if isinstance(value, int | float):
        return printed_value(repr(value)) if isinstance(value, int) else value
    return printed_value(value) if isinstance(value, str) else "null" if value is None else "?"


def _unformatted(content: bytes, outputs: Outputs) -> Rows:
    from scipy.io import FortranFile

    numbers: list[Value] = []
    with NamedTemporaryFile() as file:
        file.write(content)
        file.flush()
        with FortranFile(file.name, "r", "<u4" if outputs.kind[0] != ">" else ">u4") as records:
            try:
                while True:
                    numbers += records.read_reals(outputs.kind).astype(float).tolist()
            except Exception as error:
                if type(error).__name__ != "FortranEOFError":
                    raise PortError(f"no unformatted records: {error}") from None
    width = len(outputs.columns)
    return np.array(numbers).reshape(-1, width).tolist() if not len(numbers) % width else [numbers]
