"""Conversions between numbers of an IEEE 754 word and bytes in this machine's order."""

import math
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.thesis.word import Number, Word

Bytes = NDArray[np.int8]
_BITS = {24: 32, 53: 64, 113: 128}


def n_bytes(word: Word) -> int:
    """Return the number of bytes of a number in binary32, binary64 or binary128."""
    return _BITS[word.p] // 8


def to_bytes(numbers: Iterable[Any], word: Word, *shape: int) -> Bytes:
    """Return numbers as bytes, shape (n_bytes(word), *shape).

    `numbers` and the result are in column-major order.
    """
    size = n_bytes(word)
    written = b"".join(_pattern(each).to_bytes(size, sys.byteorder) for each in numbers)
    # Memory of a copy, which NumPy allocates, is aligned for any number.
    return np.array(np.frombuffer(written, np.int8).reshape((size, *shape), order="F"), order="F")


def from_bytes(given: Bytes, word: Word) -> NDArray[np.object_]:
    """Return the array of numbers in bytes that `to_bytes` has made."""
    size = n_bytes(word)
    written = given.tobytes(order="F")
    found = np.empty(len(written) // size, dtype=object)
    for index in range(len(found)):
        each = written[index * size : (index + 1) * size]
        found[index] = _number(int.from_bytes(each, sys.byteorder), word)
    return found.reshape(given.shape[1:], order="F")


def _pattern(x: Number) -> int:
    p = x.word.p
    places, most = p - 1, (1 << _BITS[p] - p) - 1
    if x.m:
        sign, coefficient = x.m < 0, abs(x.m)
        # A subnormal number has the field 0, but the unit in the last place of the field 1.
        field = x.e + places + (most >> 1) if coefficient >> places else 0
        fraction = coefficient & (1 << places) - 1
    else:
        sign, fraction = math.copysign(1.0, x.e) < 0.0, 0
        field = 0 if x.e == 0.0 else most
        if math.isnan(x.e):
            sign, fraction = False, 1 << places - 1
    return (sign << _BITS[p] - p | field) << places | fraction


def _number(pattern: int, word: Word) -> Number:
    places, most = word.p - 1, (1 << _BITS[word.p] - word.p) - 1
    fraction = pattern & (1 << places) - 1
    field = pattern >> places & most
    sign = -1 if pattern >> _BITS[word.p] - 1 else 1
    if field == most:
        return word.number(0, math.nan if fraction else sign * math.inf)
    coefficient = fraction | (1 << places if field else 0)
    if not coefficient:
        return word.number(0, sign * 0.0)
    return word.number(sign * coefficient, max(field, 1) - places - (most >> 1))
