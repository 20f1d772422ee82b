"""Intervals in which an event's function is 0 to within its error.

An interval is a root if the function reaches 0 by a kink or a jump, not by decay.
"""

import math
from dataclasses import dataclass

import numpy as np

from pyharness.engine.events.event_fits import LONG_SHIFT, MUCH, STATE_ROUNDING, Solution, noise_of
from pyharness.engine.events.event_functions import EventFunction
from pyharness.engine.events.event_roots import Columns, Fits, Index, Roots
from pyharness.model.array_type import Array
from pyharness.model.dense_output import sizes_of

# A function reaches 0 by a kink or a jump, not by decay, if it exceeds _SUDDEN times its error at
# a distance of _BEFORE times the length of the solution's polynomial.
_SUDDEN, _BEFORE = 32.0, 0.01
# Fractions of an interval at which a function is sampled, to show that it is 0 throughout.
_PARTS = np.array([0.1459, 0.382, 0.618, 0.8541, 1.0])


@dataclass(frozen=True, eq=False)
class ZeroIntervals(Columns):
    """The ascending intervals in which a function is 0 to within its error."""

    low: Array  # s
    high: Array  # s
    noise: Array  # smaller values near the interval can't be distinguished from 0
    # Signs of the function on both sides; 0 if it decays to 0, or at an end of the solution.
    before: Array
    after: Array

    def roots(self, counts_touches: bool) -> Roots:
        """Return as roots the times at which integration from time 0 first reaches each interval.

        Without `counts_touches`, only sign changes count.
        """
        is_before = self.high < 0.0
        time = np.where(is_before, self.high, self.low)
        change = np.where(is_before, self.after, -self.before)
        # Integration starts in an interval that contains time 0.
        is_root = (is_before | (self.low > 0.0)) & (change != 0.0)
        if not counts_touches:
            is_root &= self.before * self.after < 0.0
        lasting = np.where(is_before, self.low, self.high) - time
        return Roots.bare(time, change.astype(int), lasting=lasting).only(is_root)

    def contain(self, g: EventFunction, solution: Solution, roots: Roots) -> Index:
        """Return which roots are in an interval, or separated from one only by zero values."""
        following = np.searchsorted(self.low, roots.time, side="right")
        before = np.append(-math.inf, self.high)[following]
        after = np.append(self.low, math.inf)[following]
        found: Index = roots.time <= before
        # Sign changes of a function that is not smooth have errors of up to 256 spacings of
        # floats.
        longest = np.diff(solution.pieces.edges).max()
        apart = np.minimum(roots.time - before, after - roots.time)
        found |= apart <= 256.0 * np.spacing(np.maximum(np.abs(roots.time), longest))
        for edges, number in ((before, following - 1), (after, following)):
            near = np.flatnonzero(np.isfinite(edges) & ~found)
            noise = np.maximum(self.noise[number[near]], roots.noise[near])
            # Half the distance suffices, because roots of odd multiplicity above 1 are inexact.
            middle = 0.5 * roots.time[near] + 0.5 * edges[near]
            found[near] = _is_zero_between(g, solution, edges[near], middle, noise)
        return found

    def merged(self, g: EventFunction, solution: Solution) -> "ZeroIntervals":
        noise = np.maximum(self.noise[1:], self.noise[:-1])
        is_one = _is_zero_between(g, solution, self.high[:-1], self.low[1:], noise)
        first = np.flatnonzero(np.append(True, ~is_one))
        last = np.append(first[1:], len(self.low)) - 1
        noise = np.maximum.reduceat(self.noise, first)
        return ZeroIntervals(
            self.low[first], self.high[last], noise, self.before[first], self.after[last]
        )


def _is_zero_between(
    g: EventFunction, solution: Solution, ends: Array, times: Array, noise: Array
) -> Index:
    """Return in which intervals, `ends` to `times`, a function is 0 within `noise` or rounding."""
    n = len(ends)
    if not n:
        return np.zeros(0, dtype=bool)
    # A periodic function may be 0 at one sample.
    between = (ends + np.multiply.outer(_PARTS, times - ends)).ravel()
    states = solution.states(between)
    values = np.abs(solution.values(g, between, states)).reshape(-1, n)
    found: Index = (values <= noise).all(axis=0)
    k = np.flatnonzero(~found)
    if k.size:
        # Rounding errors of the state change the value of a function with jumps at random.
        states = states.reshape(-1, n, states.shape[1])[:, k]
        apart = np.abs(states - solution.states(ends[k])).max(axis=0)
        sizes = sizes_of(np.abs(states[-1]), solution.sol.n_own)
        is_zero = np.abs(solution.changed_values(g, times[k], STATE_ROUNDING)) <= noise[k]
        found[k] = (apart <= STATE_ROUNDING * sizes).all(axis=1)
        found[k] &= is_zero.any(axis=0) & ~is_zero.all(axis=0)
    return found


def _begins(fits: Fits, numbers: Index) -> Index:
    """Return where each group of adjacent polynomials begins in ascending `numbers`."""
    return np.flatnonzero(np.append(True, fits.low[numbers[1:]] != fits.high[numbers[:-1]]))


def zero_intervals(g: EventFunction, solution: Solution, fits: Fits) -> ZeroIntervals | None:
    sizes = fits.sizes
    if not sizes.size:
        return None
    largest = sizes.argmax()
    # If no value is far above its error, all polynomials may be 0.
    is_near = sizes <= max(sizes[largest] / MUCH, MUCH * fits.noise[largest])
    if not is_near.any():
        return None
    near = np.flatnonzero(is_near)
    unknown = near[fits.noise[near] == 0.0]
    if unknown.size:
        fits.noise[unknown] = noise_of(g, solution, fits.low[unknown], fits.high[unknown])
    zero = near[sizes[near] <= 2.0 * fits.noise[near]]
    if zero.size:
        # Over a longer distance, a jump beside an interval contributes less to a numerical
        # derivative.
        again = noise_of(g, solution, fits.low[zero], fits.high[zero], LONG_SHIFT)
        fits.noise[zero] = np.minimum(fits.noise[zero], again)
    noise = 2.0 * fits.noise
    zero = zero[sizes[zero] <= noise[zero]]
    if not zero.size:
        return None
    level = np.maximum(2.0 * sizes, noise / MUCH)
    # The first and last polynomials of an interval may extend beyond its ends.
    begins = _begins(fits, zero)
    least = np.minimum.reduceat(level[zero], begins)
    level[zero] = np.repeat(least, np.diff(begins, append=len(zero)))
    zero = zero[sizes[zero] <= level[zero]]
    begins = _begins(fits, zero)
    ends = zero[np.append(begins[1:], len(zero)) - 1]
    begins = zero[begins]
    low, high = fits.low[begins], fits.high[ends]
    earlier = np.minimum(fits.low[begins - 1], low)
    later = np.maximum(fits.high[(ends + 1) % len(sizes)], high)
    low = _refined(g, solution, low, earlier, level[begins])
    high = _refined(g, solution, high, later, level[ends])
    noise = noise[begins]
    (before, after), beside = signs_beside(g, solution, low, high)
    # The noise within the interval may come from a jump at its end.
    noise = np.maximum(noise, beside)
    return ZeroIntervals(low, high, noise, before, after).merged(g, solution)


def _refined(
    g: EventFunction, solution: Solution, ends: Array, others: Array, level: Array
) -> Array:
    """Return the times up to which, from `ends` toward `others`, a function is within `level`."""
    # A polynomial's interval may contain a kink of the function; kinks of the solution are edges.
    inner, outer = ends.copy(), others.copy()
    k = np.flatnonzero(~np.isin(inner, solution.pieces.edges))
    k = k[np.abs(solution.values(g, outer[k])) > level[k]]
    while k.size:
        middle = 0.5 * inner[k] + 0.5 * outer[k]
        is_between = (middle != inner[k]) & (middle != outer[k])
        k, middle = k[is_between], middle[is_between]
        is_zero = np.abs(solution.values(g, middle)) <= level[k]
        inner[k] = np.where(is_zero, middle, inner[k])
        outer[k] = np.where(is_zero, outer[k], middle)
    return inner


def signs_beside(
    g: EventFunction, solution: Solution, low: Array, high: Array
) -> tuple[Array, Array]:
    """Return a function's signs before and after n intervals, (2, n), and its noise there.

    A sign is 0 if the function decays to 0.
    """
    both = np.concatenate([_beside(solution, low, -1), _beside(solution, high, 1)])
    values, noise, _ = (x.reshape(2, -1) for x in solution.values_and_noise(g, both))
    signs = np.where(np.abs(values) > _SUDDEN * noise, np.sign(values), 0.0)
    return signs, noise.max(axis=0)


def _beside(solution: Solution, times: Array, side: int) -> Array:
    edges = solution.pieces.edges
    piece = np.searchsorted(edges, times, side="left" if side < 0 else "right") - 1
    piece = np.clip(piece, 0, len(edges) - 2)
    beside = times + side * _BEFORE * (edges[piece + 1] - edges[piece])
    return np.asarray(np.clip(beside, edges[0], edges[-1]))
