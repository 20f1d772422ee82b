"""Checks of user input, and conversions to plain Python numbers.

Functions with an argument `where` raise InputError for values that are not allowed; the message
begins with `where`.
"""

import itertools
import math
import operator
from collections.abc import Iterable, Mapping, Set
from typing import SupportsFloat, SupportsIndex, TypeVar

from pyharness.model.errors import InputError, kind_of

T = TypeVar("T")
Triple = tuple[float, float, float]
Matrix = tuple[Triple, Triple, Triple]
# A number that float() converts: int, Fraction, Decimal, a NumPy scalar; no text.
Number = SupportsFloat | SupportsIndex
# Several numbers: for example a list, a tuple, an array or a generator.
Numbers = Iterable[Number]

_TOO_LARGE = "a number too large for binary64"
# The kinds of NumPy data that are real numbers.
_REAL = "iuf"
_THREE_FLOATS = [float, float, float]


def triple(values: Iterable[T]) -> tuple[T, T, T]:
    first, second, third = values
    return first, second, third


def number(where: str, value: object) -> float:
    """Return a real number, perhaps not finite, as a float."""
    found = converted(value)
    if isinstance(found, float):
        return found
    if found == _TOO_LARGE:
        raise InputError(f"{where}: {found}")
    if unit := unit_of(value):
        raise InputError(f"{where}: a number in {unit}; give its value in SI units, without a unit")
    raise InputError(f"{where}: {found} where a number belongs")


def unit_of(value: object) -> str:
    """Return the unit of a quantity, as in astropy or pint, or an empty text."""
    unit = getattr(value, "unit", None) or getattr(value, "units", None)
    return str(unit) if unit is not None and hasattr(value, "to") else ""


def converted(value: object) -> float | str:
    """Return a real number as a float; for other values, or beyond binary64, a description."""
    if type(value) is float:
        return value
    if is_no_number(value):
        return kind_of(value)
    try:
        found = float(value)  # type: ignore[arg-type]
        # A number beyond the range of binary64 becomes infinite.
        return _TOO_LARGE if math.isinf(found) and found != value else found
    except OverflowError:
        return _TOO_LARGE
    except Exception:  # a user-defined class may raise anything
        return kind_of(value)


def is_no_number(value: object) -> bool:
    """Return whether a value is text, boolean or array, which float() might accept."""
    if isinstance(value, (bool, str, bytes, bytearray, memoryview)):
        return True
    kind = getattr(getattr(value, "dtype", None), "kind", _REAL[0])
    return kind not in _REAL or getattr(value, "shape", ()) != ()


def parsed_float(text: str) -> float:
    return float(_read_text(text))


def parsed_whole(text: str) -> int:
    return int(_read_text(text))


def _read_text(text: str) -> str:
    if not text.isascii() or "_" in text:
        raise ValueError(f"{text!r} is no number")
    return text


def three(where: str, values: object) -> Triple:
    return triple(finite(where, each) for each in three_floats(where, values))


def three_floats(where: str, values: object) -> Triple:
    """Return three real numbers, perhaps not finite, as floats."""
    if type(values) is tuple and [type(each) for each in values] == _THREE_FLOATS:
        return values
    allowed = "allowed: three numbers"
    found = list(itertools.islice(number_list(where, values, allowed), 4))
    if len(found) != 3:
        count = "more than 3" if len(found) > 3 else str(len(found))
        raise InputError(f"{where}: {count} number{'s' * (count != '1')}; {allowed}")
    return triple(number(where, each) for each in found)


def finite(where: str, value: object) -> float:
    found = number(where, value)
    if not math.isfinite(found):
        raise InputError(f"{where}: {found:g} is not finite; allowed: finite numbers")
    return found


def are_several(names: object) -> bool:
    is_whole = isinstance(names, (str, bytes)) or getattr(names, "shape", None) == ()
    return isinstance(names, Iterable) and not is_whole


def number_list(where: str, values: object, allowed: str) -> Iterable[object]:
    if not isinstance(values, (str, bytes, bytearray, Mapping, Set)):
        try:
            return iter(values)  # type: ignore[call-overload, no-any-return]
        except TypeError:
            pass
    if unit_of(values):
        number(where, values)
    raise InputError(f"{where}: {kind_of(values)}; {allowed}")


def integer(where: str, value: object) -> int:
    if type(value) is int:
        return value
    if not is_no_number(value):
        try:
            return operator.index(value)  # type: ignore[arg-type]
        except TypeError:
            pass
    raise InputError(f"{where} is {kind_of(value)}; it must be a whole number")


def boolean(where: str, value: object) -> bool:
    if isinstance(value, bool) or kind_of(value) == "true or false":
        return bool(value)
    raise InputError(f"{where} is {kind_of(value)}; allowed: True or False")


def tolerance_of(value: object, finest: float) -> float:
    found = converted(value)
    if isinstance(found, float):
        return found
    raise InputError(f"tolerance is {found}; allowed: a number from {finest:.2g} to 1")


def checked_effort(effort: Number) -> float:
    value = number("effort", effort)
    if not 0.0 < value < math.inf:
        raise InputError(f"effort: {value:g}; allowed: a finite number above 0")
    return value
