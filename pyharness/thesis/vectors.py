"""Numbers and instructions of CDC machines in octal, and test vectors.

A CDC word has a sign bit, an exponent field of 11 bits, and a coefficient of 48 bits. All bits of a
negative number are complemented. The exponent is the field minus 2000 (octal), plus one if the
field is below 2000.

The test vectors in `data/words/cdc.json` follow from the CYBER 170 hardware reference, CDC
60463560; a public emulator confirms them.
"""

import math
import operator
import re
from pathlib import Path
from typing import Any, NamedTuple

from pyharness.model.errors import InputError, kind_of, kind_or_empty, unknown
from pyharness.model.json_text import parse_json
from pyharness.model.pipes import read_input
from pyharness.model.schema import check_schema
from pyharness.thesis.word import WORDS, Pair, framed

OURS = Path(__file__).parent.parent / "data" / "words" / "cdc.json"
_LARGEST = 1 << 24  # largest size (bytes) of a file
_FIELDS = ("name", "op", "x", "y", "result")
BITS = 48
_WORD = re.compile(r"[0-7]{20}")
_ONES = (1 << 60) - 1
_SIGN = 1 << 59
_BIAS, _INDEFINITE, _INFINITE = 0o2000, 0o1777, 0o3777
_INSTRUCTIONS = tuple(
    f"{kind}X{each}" for kind in "FR" for each in ("+", "+ NX", "-", "- NX", "*", "/")
)


class Vector(NamedTuple):
    """An instruction with two operands and the expected result, in octal."""

    name: str
    op: str
    x: str
    y: str
    result: str


class Answer(NamedTuple):
    """A test vector, and the result `found` by our arithmetic, in octal."""

    vector: Vector
    found: str

    @property
    def agrees(self) -> bool:
        return "".join(self.vector.result.split()) == "".join(self.found.split())


def answers(path: str | Path = OURS) -> list[Answer]:
    content = read_input(path, f"vectors '{path}'", _LARGEST, "a JSON file")
    try:
        data = parse_json(content)
    except ValueError as error:
        raise InputError(f"vectors '{path}': not JSON: {error}; give a JSON file") from None
    allowed = 'allowed: {"schema": 1, "vectors": [...]}'
    if not isinstance(data, dict):
        raise InputError(f"vectors '{path}': {kind_of(data)}; {allowed}")
    check_schema(f"vectors '{path}'", "vector file", data.get("schema"), allowed)
    entries = data.get("vectors")
    if not isinstance(entries, list) or not entries:
        raise InputError(f"vectors '{path}': vectors is {kind_or_empty(entries)}; {allowed}")
    return [_answer(f"vectors '{path}', entry {n}", each) for n, each in enumerate(entries, 1)]


def _answer(where: str, entry: Any) -> Answer:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: {kind_of(entry)}; allowed: a table of {', '.join(_FIELDS)}")
    for field in _FIELDS:
        if not isinstance(entry.get(field), str):
            raise InputError(f"{where}: {field} is {kind_of(entry.get(field))}; it must be text")
    vector = Vector(*(entry[field] for field in _FIELDS))
    if not _WORD.fullmatch("".join(vector.result.split())):
        raise InputError(f"{where}: result {vector.result!r}: not 20 octal digits")
    try:
        return Answer(vector, operated(vector.op, vector.x, vector.y))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def from_octal(text: str) -> Pair:
    """Return (m, e) of the number m 2**e in a CDC word of 20 octal digits.

    The coefficient must be normalised; m is 0 and e a float for zero, infinity and nan.
    """
    digits = "".join(text.split()) if isinstance(text, str) else ""
    if not _WORD.fullmatch(digits):
        raise InputError(f"word {text!r}: not 20 octal digits, as in 1720 4000 0000 0000 0000")
    bits = int(digits, 8)
    sign = -1 if bits & _SIGN else 1
    if sign < 0:
        bits ^= _ONES
    field, m = bits >> BITS, bits & (1 << BITS) - 1
    if field in (_INDEFINITE, _INFINITE):
        return 0, math.nan if field == _INDEFINITE else sign * math.inf
    if not bits:
        return 0, 0.0
    if m.bit_length() != BITS:
        raise InputError(
            f"word {text!r}: its coefficient is not normalised; give a word of the machine as "
            "it stores results"
        )
    return sign * m, field - _BIAS + (field < _BIAS)


def to_octal(number: Pair) -> str:
    """Return the CDC word, in groups of four octal digits, of (m, e) as in `from_octal`."""
    m, e = number
    if m:
        return _written(m < 0, e, abs(m))
    if e == 0.0:
        return _grouped(0)
    field = _INDEFINITE if math.isnan(e) else _INFINITE
    return _grouped(field << BITS ^ (_ONES if e < 0.0 else 0))


def operated(name: str, x: str, y: str) -> str:
    """Return the result of a CDC instruction on two operands, in octal.

    Sums are normalised only with NX, as in ``RX+ NX``.
    """
    if name not in _INSTRUCTIONS:
        raise unknown("instruction", name, _INSTRUCTIONS)
    rounds, operation = name[0] == "R", name[2]
    (xm, xe), (ym, ye) = from_octal(x), from_octal(y)
    if operation == "-":
        ym, ye = (-ym, ye) if ym else (0, -ye)
    if name[2:] in ("+", "-") and xm and ym:
        frame, e = framed(BITS, rounds, xm, xe, ym, ye)
        m = abs(frame) >> BITS
        return _written(frame < 0, e + (m >> BITS), m >> (m >> BITS))
    word = WORDS["cdc48-rounded" if rounds else "cdc48"]
    left, right = word.number(xm, xe), word.number(ym, ye)
    found = {"*": operator.mul, "/": operator.truediv}.get(operation, operator.add)(left, right)
    return to_octal((found.m, found.e))


def _written(negative: bool, e: int, m: int) -> str:
    field = e + _BIAS - (e < 0)
    return _grouped((field << BITS | m) ^ (_ONES if negative else 0))


def _grouped(bits: int) -> str:
    return " ".join(re.findall("....", f"{bits:020o}"))
