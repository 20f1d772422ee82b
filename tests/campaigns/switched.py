"""An integration of a controlled body in 32 digits, which locates the switches itself.

A switch selects a formula by the zone of its operand, between two levels. Each step computes the
Taylor series of all unknowns and operands in decimal arithmetic, and ends where an operand crosses
a level. The module shares no code with the package.
"""

from bisect import bisect_left
from collections.abc import Callable
from decimal import Decimal, localcontext
from itertools import pairwise
from operator import mul
from typing import Any

_DIGITS, _ORDER, _LOCAL = 32, 30, 1e-26
_NEAR = Decimal("1e-20")  # from a level: on it
_ROUNDED = Decimal("1e-28")  # s
_CUTS = 16  # of a step, in each of which an operand has at most one extremum
_MOST_STEPS = 4000


class SlidingError(Exception):
    """The error if no choice of zones continues the motion; its argument is the time (s)."""


class Series:
    """A power series, whose coefficients are computed when they are first needed."""

    def __init__(self, make: Callable[[int], Decimal], *known: Decimal) -> None:
        """Store the known coefficients, and the function that returns the next."""
        self.known, self.make = list(known), make

    def at(self, k: int) -> Decimal:
        """Return coefficient k."""
        while len(self.known) <= k:
            self.known.append(self.make(len(self.known)))
        return self.known[k]

    def __add__(self, other: Any) -> "Series":
        """Return the sum."""
        other = series(other)
        return Series(lambda k: self.at(k) + other.at(k))

    def __mul__(self, other: Any) -> "Series":
        """Return the product."""
        if not isinstance(other, Series):
            factor = Decimal(other)
            return Series(lambda k: factor * self.at(k))

        def product(k: int) -> Decimal:
            self.at(k), other.at(k)
            return sum(map(mul, self.known[: k + 1], other.known[k::-1]), Decimal(0))

        return Series(product)

    def __neg__(self) -> "Series":
        """Return the negative."""
        return self * -1

    def __sub__(self, other: Any) -> "Series":
        """Return the difference."""
        return self + -series(other)

    def __rsub__(self, other: Any) -> "Series":
        """Return the difference from a number."""
        return series(other) - self

    __radd__, __rmul__ = __add__, __mul__


def series(x: Any) -> Series:
    """Return a number as a series."""
    return x if isinstance(x, Series) else Series(lambda k: Decimal(x) if k == 0 else Decimal(0))


def _sine_of(x: Decimal, term: Decimal, n: int) -> Decimal:
    total = term
    while abs(term) > Decimal("1e-40"):
        term = -term * x * x / ((n + 1) * (n + 2))
        total, n = total + term, n + 2
    return total


class Modes:
    """The elements of controllers as series, with a formula for each zone between two levels."""

    def __init__(self, zones: list[int]) -> None:
        """Store the zones by the number of the element; later ones are those of the values."""
        self.zones, self.operands = zones, list[tuple[Series, list[Decimal]]]()

    def zone(self, x: Any, *levels: Any) -> int:
        """Return the number of levels below an operand."""
        n, exact = len(self.operands), [Decimal(each) for each in levels]
        self.operands.append((series(x), exact))
        if n == len(self.zones):
            self.zones.append(bisect_left(exact, series(x).at(0)))
        return self.zones[n]

    def sin(self, x: Any) -> Series:
        """Return the sine."""
        x, start = series(x), series(x).at(0)
        with localcontext(prec=60):
            known = _sine_of(start, start, 1), _sine_of(start, Decimal(1), 0)

        def next_of(other: Series, sign: int) -> Callable[[int], Decimal]:
            return lambda k: sum((sign * j * x.at(j) * other.at(k - j) for j in range(1, k + 1)),
                                 Decimal(0)) / k  # fmt: skip

        sine, cosine = (Series(lambda k: Decimal(0), +each) for each in known)
        sine.make, cosine.make = next_of(cosine, 1), next_of(sine, -1)
        return sine

    def clip(self, x: Any, low: float, high: float) -> Any:
        """Return numpy.clip."""
        return (low, x, high)[self.zone(x, low, high)]

    def floor(self, x: Any) -> int:
        """Return numpy.floor up to 99."""
        found = self.zone(x, *range(-99, 100)) - 100
        if abs(found) > 98:
            raise OverflowError
        return found

    def maximum(self, x: Any, y: Any) -> Any:
        """Return numpy.maximum."""
        return (y, x)[self.zone(x - y, 0)]

    def interp(self, x: Any, places: Any, values: Any) -> Any:
        """Return numpy.interp."""
        n = self.zone(x, *places)
        if n in (0, len(places)):
            return values[max(0, n - 1)]
        (a, b), (u, v) = (map(Decimal, each[n - 1 : n + 1]) for each in (places, values))
        return u + (x - a) * ((v - u) / (b - a))

    def above(self, x: Any, level: float) -> int:
        """Return 1 above a level, else 0."""
        return self.zone(x, level)

    def dead(self, x: Any, width: float) -> Any:
        """Return the distance from a dead zone, with its sign."""
        return (x + width, 0.0, x - width)[self.zone(x, -width, width)]

    def inside(self, x: Any, width: float) -> int:
        """Return 1 in an interval, else 0."""
        return (0, 1, 0)[self.zone(x, -width, width)]


# Returns the series of the unknowns at a time, and stores the operands of the switches.
Expand = Callable[[Decimal, list[Decimal], Modes], list[Series]]


def integrated(
    expand: Expand, y: list[Decimal], times: list[float]
) -> tuple[list[list[Decimal]], list[Decimal], int]:
    """Return the rows at `times` (s), the largest size of each unknown, the number of crossings.

    All times have the same sign. Raise SlidingError if no zones continue the motion, and
    OverflowError after too many steps.
    """
    with localcontext(prec=_DIGITS):
        t, zones, crossings = Decimal(0), list[int](), 0
        rows, largest = list[list[Decimal]](), [abs(each) for each in y]
        exact = [Decimal(each) for each in times]
        sign = 1 if times[-1] > 0 else -1
        for _ in range(_MOST_STEPS):
            on_level = _settle(expand, t, y, zones, sign)
            m = Modes(zones)
            unknowns = expand(t, y, m)
            h = min(_step([*unknowns, *(x for x, _ in m.operands)]), abs(exact[-1] - t)) * sign
            if not h:
                raise OverflowError  # omega grows without bound
            terms = [_scaled(each, h) for each in unknowns]
            roots = [
                _first_root(_scaled(x, h), levels, zones[n], n in on_level)
                for n, (x, levels) in enumerate(m.operands)
            ]
            end = min((each for each in roots if each is not None), default=Decimal(1))
            crossings += end < 1
            while len(rows) < len(exact) and abs(exact[len(rows)] - t) <= abs(end * h) + _ROUNDED:
                rows.append([_value(each, (exact[len(rows)] - t) / h) for each in terms])
            if len(rows) == len(exact):
                ends = [abs(x) for x in rows[-1]]
                return rows, [max(pair) for pair in zip(largest, ends, strict=True)], crossings
            y, t = [_value(each, end) for each in terms], t + end * h
            largest = [max(a, abs(b)) for a, b in zip(largest, y, strict=True)]
    raise OverflowError


def _settle(expand: Expand, t: Decimal, y: list[Decimal], zones: list[int], sign: int) -> set[int]:
    """Set the zones so that each operand moves into its own; return those on a level."""
    for _ in range(12):
        m, on_level = Modes(zones), set[int]()
        expand(t, y, m)
        before = list(zones)
        for n, (x, levels) in enumerate(m.operands):
            near = [k for k, each in enumerate(levels) if abs(x.at(0) - each) < _NEAR]
            if near:
                slopes = (x.at(k) * sign**k for k in range(1, _ORDER))
                slope = next((each for each in slopes if abs(each) > _NEAR), Decimal(0))
                on_level.add(n)
                zones[n] = near[0] + (slope > 0)
            else:
                zones[n] = bisect_left(levels, x.at(0))
        if zones == before:
            return on_level
    raise SlidingError(float(t))


def _step(each: list[Series]) -> Decimal:
    """Return the step (s) whose last terms are the local tolerance."""
    parts = [(_LOCAL / size) ** (1 / k) for x in each for k in (_ORDER - 1, _ORDER)
             if (size := abs(float(x.at(k)))) > 0]  # fmt: skip
    return Decimal(min([*parts, 1e3]))


def _scaled(x: Series, h: Decimal) -> list[Decimal]:
    return [x.at(k) * h**k for k in range(_ORDER + 1)]


def _value(terms: list[Decimal], x: Decimal) -> Decimal:
    total = Decimal(0)
    for each in reversed(terms):
        total = total * x + each
    return total


def _first_root(
    terms: list[Decimal], levels: list[Decimal], zone: int, is_on_level: bool
) -> Decimal | None:
    """Return the part of a step at which an operand leaves its zone, or None."""
    found = []
    for level in levels[max(0, zone - 1) : zone + 1]:
        shifted = [terms[0] - level, *terms[1:]]
        while is_on_level and len(shifted) > 1 and abs(shifted[0]) < _NEAR:
            shifted = shifted[1:]
        if abs(shifted[0]) <= sum(map(abs, shifted[1:])):
            found.append(_root_of(shifted))
    return min((each for each in found if each is not None), default=None)


def _root_of(p: list[Decimal]) -> Decimal | None:
    if p[0] < 0:
        p = [-each for each in p]
    slopes = [k * each for k, each in enumerate(p)][1:]
    for a, b in pairwise(Decimal(k) / _CUTS for k in range(_CUTS + 1)):
        if _value(p, b) < 0:
            return _bisected(p, a, b)
        if _value(slopes, a) < 0 < _value(slopes, b):
            lowest = _bisected([-each for each in slopes], a, b)
            if _value(p, lowest) < 0:
                return _bisected(p, a, lowest)
    return None


def _bisected(p: list[Decimal], low: Decimal, high: Decimal) -> Decimal:
    """Return the end of the narrowest interval between a positive and a negative value."""
    for _ in range(104):
        middle = (low + high) / 2
        low, high = (low, middle) if _value(p, middle) < 0 else (middle, high)
    return high
