"""What a user gives, in whatever form, as plain Python: checked and converted once."""

import itertools
import math
import operator
from collections.abc import Iterable, Mapping, Set
from typing import SupportsFloat, SupportsIndex

from pyharness.model.errors import InputError, kind_of

Triple = tuple[float, float, float]
Matrix = tuple[Triple, Triple, Triple]
# float() makes one of Python's of it, though not of text: int, Fraction, Decimal, NumPy's scalars.
Number = SupportsFloat | SupportsIndex
# A list, a tuple, an array, a generator.
Numbers = Iterable[Number]

_TOO_LARGE = "a number too large for binary64"
# Of NumPy's kinds of data, those that are real numbers.
_REAL = "iuf"
_THREE_FLOATS = [float, float, float]


def number(where: str, value: object) -> float:
    """Return a real number as a float, any; InputError, which begins with `where`, for no such."""
    found = converted(value)
    if isinstance(found, float):
        return found
    if found == _TOO_LARGE:
        raise InputError(f"{where}: {found}")
    raise InputError(f"{where}: {found} where a number belongs")


def converted(value: object) -> float | str:
    """Return a real number as a float, or in words what it is instead."""
    if type(value) is float:
        return value
    if is_no_number(value):
        return kind_of(value)
    try:
        found = float(value)  # type: ignore[arg-type]
        # What has more range than binary64 becomes infinite.
        return _TOO_LARGE if math.isinf(found) and found != value else found
    except OverflowError:
        return _TOO_LARGE
    except Exception:  # of a class of the user's: whatever it raises, it is no number
        return kind_of(value)


def is_no_number(value: object) -> bool:
    """Whether it is none though float() may take it: text, truth, an array, NumPy's complex."""
    if isinstance(value, (bool, str, bytes, bytearray, memoryview)):
        return True
    kind = getattr(getattr(value, "dtype", None), "kind", _REAL[0])
    return kind not in _REAL or getattr(value, "shape", ()) != ()


def three(where: str, values: object) -> Triple:
    """Return three finite numbers; InputError, which begins with `where`, for anything else."""
    found = three_floats(where, values)
    for each in found:
        if not math.isfinite(each):
            raise _not_finite(where, each)
    return found


def three_floats(where: str, values: object) -> Triple:
    """Return three floats, any of them; InputError, which begins with `where`, for no three."""
    if type(values) is tuple and [type(each) for each in values] == _THREE_FLOATS:
        return values
    allowed = "allowed: three numbers"
    found = list(itertools.islice(number_list(where, values, allowed), 4))
    if len(found) != 3:
        count = "more than 3" if len(found) > 3 else str(len(found))
        raise InputError(f"{where}: {count} number{'s' * (count != '1')}; {allowed}")
    first, second, third = (number(where, each) for each in found)
    return first, second, third


def finite(where: str, value: object) -> float:
    """Return a finite number; InputError, which begins with `where`, for anything else."""
    found = number(where, value)
    if not math.isfinite(found):
        raise _not_finite(where, found)
    return found


def _not_finite(where: str, value: float) -> InputError:
    return InputError(f"{where}: {value:g} is not finite; allowed: finite numbers")


def number_list(where: str, values: object, allowed: str) -> Iterable[object]:
    """Return an iterator over what has an order; InputError for text, a set, a mapping."""
    if not isinstance(values, (str, bytes, bytearray, Mapping, Set)):
        try:
            return iter(values)  # type: ignore[call-overload, no-any-return]
        except TypeError:
            pass
    raise InputError(f"{where}: {kind_of(values)}; {allowed}")


def integer(where: str, value: object) -> int:
    """Return a whole number; InputError, which begins with `where`, for anything else."""
    if not is_no_number(value):
        try:
            return operator.index(value)  # type: ignore[arg-type]
        except TypeError:
            pass
    raise InputError(f"{where} is {kind_of(value)}; it must be a whole number")


def boolean(where: str, value: object) -> bool:
    """Return True or False; InputError, which begins with `where`, for anything else."""
    if isinstance(value, bool) or kind_of(value) == "true or false":
        return bool(value)
    raise InputError(f"{where} is {kind_of(value)}; allowed: True or False")


def tolerance_of(value: object, finest: float) -> float:
    """Return a tolerance as a float; InputError where it is no number. Its range is not checked."""
    found = converted(value)
    if isinstance(found, float):
        return found
    raise InputError(f"tolerance is {found}; allowed: a number from {finest:.2g} to 1")
