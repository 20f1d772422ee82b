"""Numbers of a CDC machine in octal, and the results of CDC instructions on them.

A CDC word has 60 bits: a sign bit, an exponent field of 11 bits, and a coefficient of 48 bits. All
60 bits of a negative number are complemented. The exponent is the field minus 2000 (octal), plus
one if the field is below 2000 (octal).
"""

import math
import operator
import re

from pyharness.model.errors import InputError, unknown
from pyharness.thesis.cdc import framed
from pyharness.thesis.rounding import Pair
from pyharness.thesis.word import WORDS

BITS = 48
_WORD = re.compile(r"[0-7]{20}")
_ONES = (1 << 60) - 1
_SIGN = 1 << 59
_BIAS, _INDEFINITE, _INFINITE = 0o2000, 0o1777, 0o3777
_INSTRUCTIONS = tuple(
    f"{kind}X{each}" for kind in "FR" for each in ("+", "+ NX", "-", "- NX", "*", "/")
)


def from_octal(text: str) -> Pair:
    """Return the number m 2**e that 20 octal digits represent, as the pair (m, e).

    Words with all bits 0 or all bits 1 are zero. For zero, infinity and nan, m is 0 and e the value
    as a float. Raise InputError for other texts, and if the coefficient is not normalised.
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
    """Return the CDC word of a pair (m, e), as in `from_octal`, in groups of four digits."""
    m, e = number
    if m:
        return _written(m < 0, e, abs(m))
    if e == 0.0:
        return _grouped(0)
    field = _INDEFINITE if math.isnan(e) else _INFINITE
    return _grouped(field << BITS ^ (_ONES if e < 0.0 else 0))


def operated(name: str, x: str, y: str) -> str:
    """Return the result of a CDC instruction on the words `x` and `y`, all in octal.

    `name` is F (truncating) or R (rounding), X, and +, -, * or /, as in ``FX*``. A sum or
    difference is normalised only if NX follows, as in ``RX+ NX``. Raise InputError for other names.
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
