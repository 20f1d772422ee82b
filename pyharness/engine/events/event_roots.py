"""Isolation of all real roots of polynomials on intervals, for many intervals at once.

A polynomial with Chebyshev coefficients c has no root on the interval if |c[0]| > |c[1]| + |c[2]| +
... If this holds for the derivative, there is at most one root; for the second derivative, at most
two. Other intervals are halved, so that no root is missed (Trefethen 2013, Approximation Theory and
Approximation Practice, chapters 3 and 18).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self, TypeVar

import numpy as np
from numpy.polynomial import chebyshev

from pyharness.model.array_type import Array
from pyharness.model.dense_output import points, to_coefficients

# A slice, a mask or indices of the elements of an array.
Index = Any
NODES = 33  # of each polynomial
POINTS = points(NODES)
TO_COEFFICIENTS = to_coefficients(NODES)
# Halvings of an interval after which a root is as exact as the coefficients.
_MOST_DIVISIONS = 50
# The first coefficient must exceed the bound by this factor, so that rounding never loses an
# extremum at the end of an interval.
MARGIN = 1.001
SHORT = 1e-11  # length of the last Newton step
# A time counts as exact if the sign changes within so many of its rounding errors.
EXACT = 8.0
WIDER = 16.0  # factor on the half width of an interval, until the sign changes in it
# Largest error of a polynomial, relative to its largest value on the interval.
FIT_ERROR = 4e-13


def _transforms() -> tuple[Array, Array, Array]:
    slope = np.zeros((NODES, NODES))
    slope[:-1] = chebyshev.chebder(np.eye(NODES))
    left = TO_COEFFICIENTS @ chebyshev.chebvander(0.5 * (POINTS - 1.0), NODES - 1)
    right = TO_COEFFICIENTS @ chebyshev.chebvander(0.5 * (POINTS + 1.0), NODES - 1)
    return slope, left, right


_DERIVATIVE, LEFT, RIGHT = _transforms()
_AT_ONCE = 256  # rows; for many more, the linear algebra library would start threads
_ORDERS = np.arange(NODES)


def transformed(rows: Array, matrix: Array) -> Array:
    parts = [rows[k : k + _AT_ONCE] @ matrix.T for k in range(0, len(rows), _AT_ONCE)]
    return np.concatenate(parts) if parts else rows


@dataclass(frozen=True, eq=False)
class Columns:
    """A table; each attribute is a column."""

    def only(self, kept: Index) -> Self:
        return type(self)(*(getattr(self, name)[kept] for name in self.__dataclass_fields__))


C = TypeVar("C", bound=Columns)


def together(parts: list[C], order: str) -> C:
    names = parts[0].__dataclass_fields__
    found = type(parts[0])(*(np.concatenate([getattr(x, name) for x in parts]) for name in names))
    return found.only(np.argsort(getattr(found, order), kind="stable"))


@dataclass(frozen=True, eq=False)
class Fits(Columns):
    """Polynomials that approximate a function on p intervals."""

    low: Array  # s
    high: Array  # s
    first: Array  # the function's values at `low`
    last: Array  # the function's values at `high`; equal to the next `first` at a common end
    coefficients: Array  # Chebyshev coefficients, shape (p, NODES)
    noise: Array  # smaller values can't be distinguished from 0

    @cached_property
    def sizes(self) -> Array:
        """Upper bounds of the polynomials' magnitudes, (p,)."""
        found: Array = np.abs(self.coefficients).sum(axis=1)
        return found


@dataclass(frozen=True, eq=False)
class Roots(Columns):
    """Candidates for roots at n times."""

    time: Array  # s
    change: Index  # the sign, 1 or -1, after a sign change; else 0
    slope: Array  # the polynomial's first derivative by time
    curvature: Array  # the polynomial's second derivative by time
    noise: Array  # smaller values of the function can't be distinguished from 0
    near: Array  # smaller values of the polynomial can't be distinguished from 0
    lasting: Array  # time (s) during which the function remains 0; negative before time 0

    @classmethod
    def bare(cls, time: Array, change: Index, noise: Any = 0.0, lasting: Any = 0.0) -> "Roots":
        zeros = np.zeros(len(time))
        return cls(
            time, zeros.astype(int) + change, zeros, zeros, zeros + noise, zeros, zeros + lasting
        )


def joined(parts: list[Roots]) -> Roots:
    parts = [each for each in parts if each.time.size]
    if not parts:
        return Roots.bare(np.zeros(0), 0)
    return parts[0] if len(parts) == 1 else together(parts, "time")


def _basis(x: Array) -> Array:
    return np.cos(_ORDERS * np.arccos(x)[:, None])


def values_at(coefficients: Array, x: Array) -> Array:
    """Return the value of each polynomial k at x[k]."""
    return np.asarray(np.vecdot(coefficients, _basis(x)))


def may_vanish(fits: Fits) -> Index:
    first = np.abs(fits.coefficients[:, 0])
    found: Index = first <= np.maximum(fits.noise, FIT_ERROR * fits.sizes) + (fits.sizes - first)
    return found | ((fits.first < 0.0) != (fits.last < 0.0))


def isolated(fits: Fits) -> Roots:
    """Return all roots, and extrema that may be roots, in order of time."""
    near = np.maximum(fits.noise, FIT_ERROR * fits.sizes)
    smallest = np.maximum(fits.noise / 16.0, 1e-15 * fits.sizes)
    # Points from -1 to 1, sign changes and indices of polynomials.
    found: list[tuple[Array, Index, Index]] = []
    # Parts with one root: coefficients, ends, sign change, middle, half width, index.
    brackets: list[tuple[Any, ...]] = []
    number = np.arange(len(fits.low))  # of the original polynomial
    low, high = np.full(len(number), -1.0), np.ones(len(number))
    first, last, c = fits.first, fits.last, fits.coefficients
    for level in range(_MOST_DIVISIONS + 1):
        rest = np.abs(c[:, 1:]).sum(axis=1)
        changes = (first < 0.0) != (last < 0.0)
        kept = changes | (np.abs(c[:, 0]) <= rest + near[number])
        number, low, high, first, last, c, rest, changes = (
            each[kept] for each in (number, low, high, first, last, c, rest, changes)
        )
        if not number.size:
            break
        sign = np.where(last < 0.0, -1, 1)
        slopes = transformed(c, _DERIVATIVE)
        is_tiny = (np.abs(c[:, 0]) + rest <= smallest[number]) | (level == _MOST_DIVISIONS)
        is_monotone = ~is_tiny & _has_no_root(slopes)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        found.append((middle[is_tiny], (sign * changes)[is_tiny], number[is_tiny]))
        one = np.flatnonzero(is_monotone & changes)
        parts = [(np.full(one.size, -1.0), np.ones(one.size), sign[one], one)]
        split = ~(is_tiny | is_monotone)
        if split.any():
            bent = np.flatnonzero(split & _has_no_root(slopes @ _DERIVATIVE.T))
            split[bent] = False
            x, touch, more = _bent(bent, c, first, last, slopes, near[number])
            found.append((middle[touch] + half[touch] * x, 0 * touch, number[touch]))
            parts += more
        brackets += [(c[k], *ends, middle[k], half[k], number[k]) for *ends, k in parts]
        if not split.any():
            break
        centre = values_at(c[split], np.zeros(split.sum()))
        number = np.repeat(number[split], 2)
        ends = np.column_stack([low[split], middle[split], middle[split], high[split]])
        low, high = ends.reshape(-1, 2).T
        values = np.column_stack([first[split], centre, centre, last[split]])
        first, last = values.reshape(-1, 2).T
        c = np.stack([c[split] @ LEFT.T, c[split] @ RIGHT.T], axis=1).reshape(-1, NODES)
    if not found:
        return joined([])
    c, low, high, sign, middle, half, number = map(np.concatenate, zip(*brackets, strict=True))
    found.append((middle + half * _bracketed(c, low, high, sign), sign, number))
    x, change, which = map(np.concatenate, zip(*found, strict=True))
    roots = _describe_roots(fits, x, change, which, near)
    return roots.only(np.argsort(roots.time, kind="stable"))


def _has_no_root(coefficients: Array) -> Array:
    c = np.abs(coefficients)
    found: Array = c[:, 0] > MARGIN * c[:, 1:].sum(axis=1)
    return found


def _describe_roots(fits: Fits, x: Array, change: Index, number: Index, near: Array) -> Roots:
    half = 0.5 * fits.high[number] - 0.5 * fits.low[number]
    time = 0.5 * fits.low[number] + 0.5 * fits.high[number] + half * x
    time = np.clip(time, fits.low[number], fits.high[number])
    slopes = fits.coefficients[number] @ _DERIVATIVE.T
    basis = _basis(x)
    slope = np.vecdot(slopes, basis) / half
    curvature = np.vecdot(slopes @ _DERIVATIVE.T, basis) / half / half
    lasting = np.zeros(len(time))
    return Roots(time, change, slope, curvature, fits.noise[number], near[number], lasting)


def _bracketed(c: Array, low: Array, high: Array, sign: Array) -> Array:
    both = np.stack([c, c @ _DERIVATIVE.T], axis=1)
    x = 0.5 * (low + high)
    for _ in range(80 if len(x) else 0):
        value, slope = np.vecdot(both, _basis(x)[:, None]).T
        is_beyond = sign * value > 0.0
        low, high = np.where(is_beyond, low, x), np.where(is_beyond, x, high)
        following = x - value / slope
        is_inside = (following >= low) & (following <= high)
        following = np.where(is_inside, following, 0.5 * (low + high))
        moved = np.abs(following - x)
        x = following
        # The error of a Newton step is much smaller than its length.
        if not (moved > np.where(is_inside, SHORT, 2e-16)).any():
            break
    return x


def _bent(
    rows: Index, *given: Array
) -> tuple[Array, Index, list[tuple[Array, Array, Index, Index]]]:
    """Return extrema that may be roots, their polynomials, and parts of intervals with one root."""
    c, first, last, slopes, near = (each[rows] for each in given)
    count = len(c)
    low, high = np.full(count, -1.0), np.ones(count)
    starts, ends = values_at(slopes, low), values_at(slopes, high)
    has_extremum = (starts < 0.0) != (ends < 0.0)
    x = _bracketed(slopes, low, high, np.where(ends < 0.0, -1, 1))
    nearer = np.where(np.abs(values_at(c, low)) < np.abs(values_at(c, high)), low, high)
    x = np.where(has_extremum, x, nearer)
    value = values_at(c, x)
    is_near = np.abs(value) <= near
    negative, before, after = value < 0.0, first < 0.0, last < 0.0
    one = np.flatnonzero(before != after)
    is_pair = (before == after) & (negative != before) & has_extremum
    touch = np.flatnonzero((before == after) & is_near & ~is_pair)
    two = np.flatnonzero(is_pair)
    is_left = negative[one] != before[one]
    sign = np.where(after[one], -1, 1)
    inner = np.where(has_extremum[one], x[one], np.where(is_left, 1.0, -1.0))
    turn = np.where(negative[two], -1, 1)
    return x[touch], rows[touch], [
        (np.where(is_left, -1.0, inner), np.where(is_left, inner, 1.0), sign, rows[one]),
        (low[two], x[two], turn, rows[two]),
        (x[two], high[two], -turn, rows[two]),
    ]  # fmt: skip
