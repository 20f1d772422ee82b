"""A proved bound of the errors of sine and cosine of many angles (fortran/many/many_circular.f90).

The statements of the kernel are evaluated with enclosures: an interval of the value in exact
arithmetic, and a bound of the error by rounding. A product is counted as rounded. The bound thus
also holds where a compiler fuses a product and a sum, since then one of the roundings is omitted.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import fmpq, fmpq_poly

from tests.campaigns.function_errors.nearness import exponent, half_pi, least_distance
from tests.campaigns.function_errors.sources import expressions, fortran_numbers

DIGITS = 53
LIMIT = Fraction(10) ** 6  # rad, the largest angle by the docstring of the kernel
_PIECES = 128
_GRID = 160  # enclosures are rounded outward to multiples of 2**-_GRID
_TERMS = 12  # of the Taylor polynomials with which the polynomials are compared
_ROUTINE = "sine_cosine_lanes"
Statements = list[tuple[str, str]]
# The function `reduction` has the bound for these statements, and for no others.
_REDUCTION = [
    ("turns", "angle*QUARTERS + ROUNDS"),
    ("turns", "turns - ROUNDS"),
    ("x", "(angle - turns*HALF_PI) - turns*HALF_PI_LOW"),
]


def half_unit(size: Fraction) -> Fraction:
    """Return the largest rounding error of a result of at most this size, without underflow."""
    return Fraction(2) ** (exponent(size) - DIGITS - 1) if size else Fraction(0)


@dataclass(frozen=True)
class Bounded:
    """A computed number: an interval of its value in exact arithmetic, and a bound of its error.

    All three are integers, in units of 2**-_GRID.
    """

    low: int
    high: int
    error: int = 0

    def size(self) -> int:
        """Return the largest possible magnitude of the exact value."""
        return max(abs(self.low), abs(self.high))

    def __add__(self, other: "Bounded") -> "Bounded":
        """Return the rounded sum."""
        return _rounded(self.low + other.low, self.high + other.high, self.error + other.error)

    def __neg__(self) -> "Bounded":
        """Return the negative."""
        return Bounded(-self.high, -self.low, self.error)

    def __sub__(self, other: "Bounded") -> "Bounded":
        """Return the rounded difference."""
        return self + -other

    def __mul__(self, other: "Bounded") -> "Bounded":
        """Return the rounded product."""
        ends = [x * y for x in (self.low, self.high) for y in (other.low, other.high)]
        error = self.error * (other.size() + other.error) + other.error * self.size()
        exact = self.is_power_of_two() or other.is_power_of_two()
        return _rounded(min(ends) >> _GRID, _up(max(ends)), _up(error), exact)

    def is_power_of_two(self) -> bool:
        """Return whether the number is exactly a power of two, so that its products are exact."""
        return self.low == self.high and not self.error and self.low.bit_count() == 1


def _up(product: int) -> int:
    return -(-product >> _GRID)


def _rounded(low: int, high: int, error: int, exact: bool = False) -> Bounded:
    size = max(abs(low), abs(high)) + error
    power = 1 << (size.bit_length() - 1) if size else 0
    half = power >> DIGITS
    # Numbers just above a power of two are rounded to it, at most: the unit above counts later.
    rounding = 0 if exact else max(half >> 1, min(half, size - power)) + 1
    return Bounded(low, high, error + rounding)


def _units(x: Fraction, up: bool) -> int:
    scaled = x * (1 << _GRID)
    return math.ceil(scaled) if up else math.floor(scaled)


def constants(text: str) -> dict[str, Any]:
    """Return the constants of the kernel by name, as exact fractions."""
    names = ("ROUNDS", "QUARTERS", "HALF_PI", "HALF_PI_LOW")
    found: dict[str, Any] = {each: fortran_numbers(text, each, DIGITS)[0] for each in names}
    return found | {each: fortran_numbers(text, each, DIGITS) for each in "SC"}


def statements(text: str) -> tuple[Statements, Statements]:
    """Return the statements that reduce the angle, and those of the polynomials."""
    text = text.replace("transfer(turns, quarter)", "turns").replace("angle(i)", "angle")
    lines = expressions(text, _ROUTINE, "c_")
    lines = [each for each in lines if each[0] not in {"do i", "quarter"}]
    if lines[:3] != _REDUCTION or [name for name, _ in lines[3:]] != ["x2", "s_", "c_"]:
        raise ValueError(f"the statements of {_ROUTINE} are not those of the proof")
    return lines[:3], lines[3:]


@dataclass(frozen=True)
class Reduction:
    """The reduction of the angle: bounds for all angles up to LIMIT."""

    widest: Fraction  # magnitude of the reduced angle, rad
    error: Fraction  # of the reduced angle before its last rounding, rad
    nearest: Fraction  # distance of any angle from a multiple of a right angle but 0, rad


def reduction(known: dict[str, Any]) -> Reduction:
    """Return the bounds for x = (angle - turns*HALF_PI) - turns*HALF_PI_LOW.

    The product turns*HALF_PI is exact if both have at most 53 bits together. Above pi/4 an angle is
    a multiple of 2**-53, as is the product, so that their difference, below 1, is exact too.
    """
    low, high = half_pi()
    quarters, first, second = known["QUARTERS"], known["HALF_PI"], known["HALF_PI_LOW"]
    scaled = LIMIT * quarters
    most = math.ceil(scaled) + 1  # turns
    if first.numerator.bit_length() + most.bit_length() > DIGITS or first.denominator > 2**DIGITS:
        raise ValueError("the product of turns and HALF_PI is not exact")
    if known["ROUNDS"] != 3 * Fraction(2) ** (DIGITS - 2) or scaled >= 2 ** (DIGITS - 3):
        raise ValueError("ROUNDS does not round to an integer")
    # The rounded product may be on the other side of the middle of two integers.
    off = max(abs(quarters - 1 / low), abs(quarters - 1 / high))
    apart = Fraction(1, 2) + half_unit(scaled) + LIMIT * off
    widest = apart * high
    missing = max(abs(first + second - low), abs(first + second - high))
    if widest >= 1:
        raise ValueError("the reduced angle may exceed 1")
    error = most * missing + half_unit(most * second)
    exponents = range(0, exponent(LIMIT) + 1)
    return Reduction(widest + error, error, min(least_distance(DIGITS, n) for n in exponents))


@dataclass(frozen=True)
class Bound:
    """Proved bounds of the errors, for all angles up to LIMIT."""

    sine: Fraction  # of the polynomial s_, including the error of the reduced angle
    cosine: Fraction  # likewise of c_
    reduction: Reduction

    @property
    def worst(self) -> Fraction:
        """The larger of both bounds; each output is one of both polynomials, or its negative."""
        return max(self.sine, self.cosine)


def bound(text: str) -> Bound:
    """Return bounds of the errors of the kernel whose source is `text`."""
    known = constants(text)
    reduced = reduction(known)
    _, polynomials = statements(text)
    scope = _scope(known, _exact)
    differences = _differences(polynomials, known)
    worst = {"s_": Fraction(0), "c_": Fraction(0)}
    width = Fraction(_units(reduced.widest, True) // _PIECES + 1, 2**_GRID)
    for n in range(_PIECES):
        begin, end = n * width, (n + 1) * width
        scope["x"] = Bounded(_units(begin, False), _units(end, True))
        for name, code in polynomials:
            scope[name] = eval(code, {}, scope)
        away = reduced.error + half_unit(end + reduced.error)
        # The derivatives are the cosine of the angle and its sine, which is below the angle.
        for name, slope in (("s_", 1 - begin**2 / 2 + begin**4 / 24), ("c_", end)):
            error = Fraction(scope[name].error, 2**_GRID) + away * slope
            worst[name] = max(worst[name], error + _largest(differences[name], begin, end))
    # Each Taylor polynomial omits less than the first term that it does not have.
    omitted = reduced.widest ** (2 * _TERMS) / math.factorial(2 * _TERMS)
    return Bound(worst["s_"] + omitted, worst["c_"] + omitted, reduced)


def _exact(x: Fraction) -> Bounded:
    return Bounded(_units(x, False), _units(x, True))


def _call(values: list[Any]) -> Callable[[int], Any]:
    return lambda n: values[n]


def _scope(known: dict[str, Any], constant: Callable[[Fraction], Any]) -> dict[str, Any]:
    """Return the names of the polynomials' statements, for numbers of a kind."""
    scope: dict[str, Any] = {each: _call([None, *map(constant, known[each])]) for each in "SC"}
    return scope | {"number": lambda literal: constant(Fraction(literal))}


def _differences(polynomials: Statements, known: dict[str, Any]) -> dict[str, list[int]]:
    """Return the coefficients of s_ and c_ minus those of Taylor polynomials, to a unit each."""
    scope = _scope(known, lambda x: fmpq_poly([fmpq(x.numerator, x.denominator)]))
    scope["x"] = fmpq_poly([0, 1])
    for name, code in polynomials:
        scope[name] = eval(code, {}, scope)
    found = {}
    for name, odd in (("s_", 1), ("c_", 0)):
        taylor = [fmpq(0)] * (2 * _TERMS)
        for k in range(_TERMS):
            taylor[2 * k + odd] = fmpq((-1) ** k, math.factorial(2 * k + odd))
        difference = (scope[name] - fmpq_poly(taylor)).coeffs()
        found[name] = [_units(Fraction(int(x.p), int(x.q)), False) for x in difference]
    return found


def _largest(polynomial: list[int], begin: Fraction, end: Fraction) -> Fraction:
    """Return a bound of the magnitude of a polynomial from `begin` to `end`, both below 1.

    The polynomial is expanded about the middle of the interval.
    """
    middle, half = _units((begin + end) / 2, False), _units((end - begin) / 2, True) + 1
    shifted = list(polynomial)
    for first in range(len(shifted)):
        for k in range(len(shifted) - 2, first - 1, -1):
            shifted[k] += shifted[k + 1] * middle >> _GRID
    total, power = 0, 1 << _GRID
    for value in shifted:
        total += _up(abs(value) * power)
        power = _up(power * half)
    # Each of the coefficients, products and sums is truncated by less than a unit.
    return Fraction(total + 2 ** (2 * _TERMS), 2**_GRID)


def compute(text: str, angles: Any) -> tuple[Any, Any]:
    """Return sine and cosine of an array of binary64 angles by the statements of the source.

    No product is fused with a sum. The choice by quadrants is that of the kernel.
    """
    import numpy as np

    scope: dict[str, Any] = {
        name: _call([None, *map(float, value)]) if isinstance(value, list) else float(value)
        for name, value in constants(text).items()
    }
    scope |= {"angle": angles, "number": float}
    first, second = statements(text)
    for name, code in first + second:
        scope[name] = eval(code, {}, scope)
    quarter = scope["turns"].astype(np.int64)
    odd = quarter % 2 != 0
    sine = np.where(odd, scope["c_"], scope["s_"])
    cosine = np.where(odd, scope["s_"], scope["c_"])
    return (np.where(quarter & 2, -sine, sine), np.where((quarter + 1) & 2, -cosine, cosine))
