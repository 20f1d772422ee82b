"""Roots without a change of sign at corners of a function, such as the roots of |omega1|.

No polynomial shows such a root: it is between the nodes of a polynomial that does not converge, or
at the common end of two.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from pyharness.engine.events.event_fits import LAST, MUCH, ROUNDING, TAIL, Solution
from pyharness.engine.events.event_functions import EventFunction
from pyharness.engine.events.event_roots import (
    NODES,
    POINTS,
    Columns,
    Fits,
    Index,
    Roots,
    together,
    transformed,
)
from pyharness.engine.events.event_zeros import signs_beside
from pyharness.model.array_type import Array
from pyharness.model.dense_output import nodes

_TO_VALUES = np.asarray(chebyshev.chebvander(POINTS, NODES - 1), dtype=np.float64)
# Beside a corner at 0, adjacent nodes have values that differ more.
_LESS = 0.9
_GRID = np.linspace(0.0, 1.0, 17)  # points of an interval at which a minimum is searched
_MOST_ROUNDS = 40
_NEAR = 8.0  # spacings of floats
_SPACINGS = 64.0  # of floats, in an interval in which rounding hides a function's shape
# Largest part of a polynomial's size in its first coefficient, if the function has a root.
_MOST_MEAN = 0.6
# Beside a double root, a value at half the distance is about a quarter.
_FLAT = 0.18, 0.33


@dataclass(frozen=True, eq=False)
class Corners(Columns):
    """Roots at corners, each between two times (s) at which the function has the same sign."""

    low: Array
    time: Array
    high: Array
    noise: Array  # smaller values can't be distinguished from 0

    @property
    def roots(self) -> Roots:
        return Roots.bare(self.time, 0, self.noise)

    def contain(self, times: Array) -> Index:
        """Return which times are of roots that polynomials show instead of corners."""
        near = _SPACINGS * np.spacing(np.abs(self.time))
        is_after, is_before = times[:, None] > self.low - near, times[:, None] < self.high + near
        found: Index = (is_after & is_before).any(axis=1)
        return found

    def are_in(self, low: Array, high: Array) -> Index:
        found: Index = (low[:, None] <= self.time) & (self.time <= high[:, None])
        return found.any(axis=1)


def find_corners(
    g: EventFunction, solution: Solution, fits: Fits, rough: list[Fits]
) -> Corners | None:
    if rough:
        fits = together([fits, *rough], "low")
    sizes = fits.sizes
    # At a corner at 0, a polynomial has errors of up to a tenth of its size.
    is_near = _are_bent(fits) & (np.abs(fits.coefficients[:, 0]) <= _MOST_MEAN * sizes)
    # The corner may be at or near the common end of two polynomials.
    limit = MUCH * (fits.noise + ROUNDING * sizes)
    is_chosen = is_near | (np.abs(fits.first) <= limit) | (np.abs(fits.last) <= limit)
    if not is_chosen.any():
        return None
    is_chosen[1:] |= is_near[:-1]
    is_chosen[:-1] |= is_near[1:]
    low, high, sign = _brackets(fits.only(is_chosen))
    if not low.size:
        return None
    middle = 0.5 * low + 0.5 * high
    signs, _ = signs_beside(g, solution, middle, middle)
    is_sudden = signs.all(axis=0)
    if not is_sudden.any():
        return None
    low, high, sign = low[is_sudden], high[is_sudden], sign[is_sudden]
    time = _minima(g, solution, low, high, sign)
    is_root, noise = _are_roots(g, solution, fits, time)
    is_kept = is_root & _are_corners(g, solution, low, time, high)
    return Corners(low, time, high, noise).only(is_kept)


def _are_roots(
    g: EventFunction, solution: Solution, fits: Fits, times: Array
) -> tuple[Index, Array]:
    """Return whether a function is continuous and 0 at minima of |g|, and its noise there."""
    value, noise, _ = solution.values_and_noise(g, times)
    near = _NEAR * np.spacing(np.abs(times))
    pieces = solution.pieces
    beside = np.clip(np.concatenate([times - near, times + near]), *pieces.edges[[0, -1]])
    value, sizes = np.abs(value), np.abs(solution.values(g, beside)).reshape(2, -1)
    # The function's own rounding errors may be those of larger terms.
    largest = np.zeros(len(pieces.values))
    np.maximum.at(largest, pieces.numbers(fits.low), fits.sizes)
    noise += 4.0 * ROUNDING * largest[pieces.numbers(times)]
    # A function such as sqrt(|t - 1|) is steeper than a numerical derivative.
    is_cusp = value <= 0.5 * sizes.min(axis=0)
    # The noise at a jump is no limit.
    return is_cusp | ((value <= noise) & (sizes.max(axis=0) <= _NEAR * noise)), noise


def _are_corners(
    g: EventFunction, solution: Solution, low: Array, times: Array, high: Array
) -> Index:
    """Return which minima are no double roots, which polynomials show."""
    ends = np.concatenate([low, high])
    halves = 0.5 * ends + 0.5 * np.tile(times, 2)
    size, half = np.abs(solution.values(g, np.concatenate([ends, halves]))).reshape(2, 2, -1)
    is_flat = (half >= _FLAT[0] * size) & (half <= _FLAT[1] * size)
    is_short: Index = high - low <= _SPACINGS * np.spacing(np.abs(times))
    # In an interval of zeros, every value is a minimum.
    return (size > 0.0).all(axis=0) & (is_short | ~is_flat.all(axis=0))


def _brackets(fits: Fits) -> tuple[Array, Array, Array]:
    """Return intervals between nodes in which |g| has a minimum, and the sign of g there."""
    times = nodes(fits.low, fits.high, POINTS)
    values = transformed(fits.coefficients, _TO_VALUES)
    # Polynomials that have converged show minima between their ends.
    is_shown = np.repeat(~_are_bent(fits)[:, None], NODES, axis=1)
    is_shown[:, 0] = True
    is_shown[:, -1] = fits.high != np.append(fits.low[1:], math.inf)
    # The nodes of a short interval are not distinct.
    is_new = np.append(True, np.diff(times.ravel()) > 0.0)
    times, values, is_shown = (x.ravel()[is_new] for x in (times, values, is_shown))
    before, size, after = values[:-2], np.abs(values[1:-1]), values[2:]
    smaller, larger = np.sort(np.abs([before, after]), axis=0)
    is_least = (size <= smaller) & (size <= _LESS * larger) & (before * after > 0.0)
    k = np.flatnonzero(is_least & ~is_shown[1:-1])
    return times[k], times[k + 2], np.sign(after[k])


def _are_bent(fits: Fits) -> Index:
    found: Index = np.abs(fits.coefficients[:, -TAIL:]).max(axis=1) > LAST * fits.sizes
    return found


def _minima(g: EventFunction, solution: Solution, low: Array, high: Array, sign: Array) -> Array:
    """Return the times (s) of the least values of a function times `sign`, one in each interval."""
    rows = np.arange(len(low))
    for _ in range(_MOST_ROUNDS):
        times = low[:, None] + (high - low)[:, None] * _GRID
        values = solution.values(g, times.ravel()).reshape(times.shape) * sign[:, None]
        least = values.argmin(axis=1)
        found = times[rows, least]
        low, high = (times[rows, np.clip(least + step, 0, len(_GRID) - 1)] for step in (-1, 1))
        if (high - low <= 2.0 * np.spacing(np.abs(found))).all():
            break
    return np.asarray(found)
