"""Polynomials through the values of an event's function, and the errors (noise) of these values.

In a zero interval, a function is 0 to within its error. It is a root if the function reaches 0 by a
kink or a jump, not by decay.
"""

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from pyharness.engine.event_functions import EventFunction
from pyharness.engine.event_roots import (
    POINTS,
    TO_COEFFICIENTS,
    Fits,
    Index,
    Roots,
    together,
    transformed,
)
from pyharness.model import dense_output
from pyharness.model.array_type import Array
from pyharness.model.dense_output import DenseOutput, Pieces, nodes, sizes_of
from pyharness.model.errors import InputError

# Largest of the last coefficients of a polynomial that has converged, relative to its values.
_LAST = 2e-14
_TAIL = 3  # last coefficients, whose magnitude estimates the omitted ones
_MOST_DIVISIONS = 44  # halvings of an interval after which a function counts as not smooth
# A function reaches 0 by a kink or a jump, not by decay, if it exceeds _SUDDEN times its error at
# a distance of _BEFORE times the length of the solution's polynomial.
_SUDDEN, _BEFORE = 1e3, 0.01
_MOST_PIECES = 100_000  # intervals that are divided at the same time
# Relative changes of an argument for a numerical derivative.
_SHIFT, _LONG_SHIFT = 2.0**-26, 2.0**-13
ROUNDING = 2.0**-50  # relative rounding error of the arguments of a function
# Largest relative error of the state in noise; see `Solution.state_error`.
_COARSEST = 1e-10
_SOME = slice(5, None, 11)  # three nodes at which noise is computed


@cache
def _refining() -> Array:
    """Return the matrix from values at the nodes of the polynomials to values at POINTS."""
    return Pieces(np.array([-1.0, 1.0]), np.eye(dense_output.NODES)[None])(POINTS)


@dataclass(frozen=True, eq=False)
class Solution:
    """The solution of a scene in which events are searched.

    `pieces` are the polynomials of `sol`, or approximate a closed form that `sol` evaluates.
    `tolerance` applies to omega; 0 means a fixed step.
    """

    pieces: Pieces
    sol: DenseOutput
    tolerance: float

    def states(self, times: Array) -> Array:
        """Return omega, attitude and the user's own unknowns at n times (s), (n, m)."""
        return self.sol.normalized(self.pieces(times))

    @cached_property
    def at_nodes(self) -> tuple[Array, Array]:
        """The times (s) and states at each polynomial's nodes."""
        times = nodes(self.pieces.edges[:-1], self.pieces.edges[1:], POINTS)
        return times, self.sol.normalized(_refining() @ self.pieces.values)

    @cached_property
    def at_ends(self) -> tuple[Array, Array]:
        """The times (s) and states at both ends and time 0."""
        edges, (_, states) = self.pieces.edges, self.at_nodes
        times = np.array(sorted({edges[0], 0.0, edges[-1]}))
        # Time 0 is an edge.
        first = states[np.searchsorted(edges, times[:-1]), 0]
        return times, np.concatenate([first, states[-1:, -1]])

    def values(self, g: EventFunction, times: Array, states: Array | None = None) -> Array:
        """Return the values of an event's function at `times` (s)."""
        states = self.states(times) if states is None else states
        rates = self.sol.rates(times, states) if g.event.needs_rates else None
        return g(times, states, rates)

    def exact_values(self, g: EventFunction, times: Array) -> Array:
        """Return an event function's values for states of `sol` instead of `pieces`."""
        return self.values(g, times, self.sol.normalized(self.sol.states(times)))

    def noise(self, g: EventFunction, times: Array, shift: float = _SHIFT) -> Array:
        """Return a function's errors due to errors of time, state and rates."""
        return self.values_and_noise(g, times, None, shift)[1]

    def values_and_noise(
        self, g: EventFunction, times: Array, states: Array | None = None, shift: float = _SHIFT
    ) -> tuple[Array, Array, Array]:
        """Return a function's values, their errors (noise), and the part due to rounding."""
        states = self.states(times) if states is None else states
        n, width = states.shape
        # One call with all arguments: the state at a later time, the state itself, and the state
        # with each component or rate changed.
        count = width + (5 if g.event.needs_rates else 2)
        every = np.full((count, n), times)
        every[0] += shift * np.abs(times)
        sizes = self._sizes[self.pieces.numbers(times)]
        moved = states + np.eye(count, width, -2)[:, None] * (shift * sizes)
        rates = None
        if g.event.needs_rates:
            moved[width + 2 :] = states
            rates = self.sol.rates(np.tile(times, count), moved.reshape(-1, width))
            rates = rates[:, :3].reshape(count, n, 3)
            largest = np.abs(rates[1]).max(axis=1, keepdims=True)
            rates[-3:] += np.eye(3)[:, None] * (shift * largest)
            rates = rates.reshape(-1, 3)
        found = g(every.ravel(), moved.reshape(-1, width), rates).reshape(-1, n)
        errors = np.full((2, count), ROUNDING / shift)
        errors[0, 2 : width + 2] = self.state_error / shift
        return found[1], *(errors @ np.abs(found - found[1]))

    @property
    def state_error(self) -> float:
        """The relative error of the state, at most 1e-10: a larger one would hide close roots."""
        return max(ROUNDING, min(self.tolerance, _COARSEST))

    @cached_property
    def _sizes(self) -> Array:
        """The largest sizes of unknowns from time 0 to each polynomial."""
        # The nodes come first, because many short columns are slow.
        largest = np.abs(self.pieces.values.swapaxes(0, 1), order="C").max(axis=0)
        count = np.searchsorted(self.pieces.edges[:-1], 0.0)
        for side in (largest[:count][::-1], largest[count:]):
            np.maximum.accumulate(side, out=side)
        return sizes_of(largest, self.sol.n_own)


def fitted(g: EventFunction, solution: Solution) -> tuple[Fits, Roots]:
    """Return polynomials through a function's values, and sign changes where none converges."""
    edges = solution.pieces.edges
    low, high = edges[:-1], edges[1:]
    times, inner = solution.at_nodes
    inner = inner.reshape(times.size, -1)
    values = solution.values(g, times.ravel(), inner).reshape(times.shape)
    first, last = values[:, 0].copy(), values[:, -1]
    # Equal signs at the common end of adjacent intervals, so that no root is lost or doubled.
    first[1:] = last[:-1]
    most = max(_MOST_PIECES, 2 * len(edges))
    done: list[Fits] = []
    rough = [Roots.bare(np.zeros(0), 0)]
    for level in range(_MOST_DIVISIONS + 1):
        c = transformed(values, TO_COEFFICIENTS)
        largest = np.abs(values).max(axis=1)
        tail = np.abs(c[:, -_TAIL:]).max(axis=1)
        is_done = tail <= _LAST * largest
        if not is_done.all():
            near = np.flatnonzero(~is_done)
            is_done[near] = tail[near] <= _noise_of(g, solution, low[near], high[near])
        fits = Fits(low, high, first, last, c, np.zeros(len(low)))
        done.append(fits if is_done.all() else fits.only(is_done))
        if is_done.all():
            break
        is_rough = ~is_done & (
            (high - low <= 64.0 * np.spacing(np.abs(low) + np.abs(high)))
            | (level == _MOST_DIVISIONS)
        )
        if len(low) > most:
            # A function with many jumps need not be divided far from 0.
            is_rough |= ~is_done & (np.abs(values).min(axis=1) > np.ptp(values, axis=1))
            if (~is_done & ~is_rough).sum() > most // 2:
                raise InputError(
                    f"{g.name}: the function changes too fast for {most} polynomials; use a "
                    "shorter time, or a smooth function"
                )
        rough.append(_sign_changes(times[is_rough], values[is_rough], first[is_rough]))
        split = ~is_done & ~is_rough
        middle = 0.5 * low[split] + 0.5 * high[split]
        ends = np.column_stack([low[split], middle, middle, high[split]])
        low, high = ends.reshape(-1, 2).T
        first, last = first[split], last[split]
        if not low.size:
            break
        times = nodes(low, high, POINTS)
        values = solution.values(g, times.ravel()).reshape(times.shape)
        centre = values[0::2, -1]
        first, last = np.column_stack([first, centre, centre, last]).reshape(-1, 2).T
    return done[0] if len(done) == 1 else together(done, "low"), together(rough, "time")


def _noise_of(
    g: EventFunction, solution: Solution, low: Array, high: Array, shift: float = _SHIFT
) -> Array:
    times = nodes(low, high, POINTS)[:, _SOME]
    noise = solution.noise(g, times.ravel(), shift).reshape(times.shape)
    return np.asarray(noise.max(axis=1))


def with_noise(
    g: EventFunction, solution: Solution, fits: Fits, needed: Index
) -> tuple[Fits, Roots]:
    """Return `fits` with noise where needed, and roots at time 0 and both ends."""
    sizes, largest = fits.sizes, fits.sizes.max(initial=0.0)
    which = np.flatnonzero(needed | (sizes <= largest / _SUDDEN) | (sizes == largest))
    ends, states = solution.at_ends
    # If no interval was divided, the states are known.
    if np.may_share_memory(fits.low, solution.pieces.edges):
        times, inner = (x[which, _SOME] for x in solution.at_nodes)
    else:
        times = nodes(fits.low[which], fits.high[which], POINTS)[:, _SOME]
        inner = solution.states(times.ravel())
    n, width = times.size, states.shape[1]
    inner = inner.reshape(n, width)
    values, noise, rounding = solution.values_and_noise(
        g, np.concatenate([times.ravel(), ends]), np.concatenate([inner, states])
    )
    fits.noise[which] = noise[:n].reshape(times.shape).max(axis=1)
    # At an end, a value that exceeds its rounding error is no root.
    is_root = np.abs(values[n:]) <= 4.0 * rounding[n:]
    return fits, Roots.bare(ends[is_root], 0, 4.0 * rounding[n:][is_root])


def _sign_changes(times: Array, values: Array, first: Array) -> Roots:
    values = values.copy()
    values[:, 0] = first
    is_negative = values < 0.0
    row, column = np.nonzero(is_negative[:, 1:] != is_negative[:, :-1])
    change = np.where(is_negative[row, column], 1, -1)
    return Roots.bare(0.5 * times[row, column] + 0.5 * times[row, column + 1], change)


@dataclass(frozen=True, eq=False)
class ZeroIntervals:
    """The ascending intervals, `low` to `high` (s), in which a function is 0 to within its error.

    Near an interval, values below `noise` can't be distinguished from 0. `before` and `after` are
    the function's signs on both sides: 0 where it decays to 0, or at an end of the solution.
    """

    low: Array
    high: Array
    noise: Array
    before: Array
    after: Array

    def roots(self, counts_touches: bool) -> Roots:
        """Return each interval's root, at the end that integration from time 0 reaches first.

        Without `counts_touches`, only intervals that exclude time 0, and have opposite signs on
        both sides, have a root.
        """
        is_before = self.high < 0.0
        is_first = (self.low <= 0.0) & ~is_before
        time = np.where(is_before, self.high, np.maximum(self.low, 0.0))
        lasting = np.where(self.high <= 0.0, self.low, self.high) - time
        change = np.where(is_first, 0.0, np.where(is_before, self.after, -self.before))
        is_root = is_first | (change != 0.0)
        if not counts_touches:
            is_root = ~is_first & (self.before * self.after < 0.0)
        # An interval around time 0 is reached on both sides.
        both = np.flatnonzero(is_root & is_first & (self.low < 0.0) & (self.high > 0.0))
        time, change = (np.append(x[is_root], x[both]) for x in (time, change))
        lasting = np.append(lasting[is_root], self.low[both])
        return Roots.bare(time, change.astype(int), lasting=lasting)

    def contain(self, g: EventFunction, solution: Solution, roots: Roots) -> Index:
        """Return which roots are in an interval, or so near that the function is 0 in between."""
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
            middle = solution.values(g, 0.5 * roots.time[near] + 0.5 * edges[near])
            noise = np.maximum(self.noise[number[near]], roots.noise[near])
            found[near] = np.abs(middle) <= noise
        return found


def zero_intervals(g: EventFunction, solution: Solution, fits: Fits) -> ZeroIntervals | None:
    """Return the intervals in which a function is 0 to within its error, if any."""
    sizes = fits.sizes
    if not sizes.size:
        return None
    largest = sizes.argmax()
    # If no value is far above its error, all polynomials may be 0.
    is_near = sizes <= max(sizes[largest] / _SUDDEN, _SUDDEN * fits.noise[largest])
    if not is_near.any():
        return None
    near = np.flatnonzero(is_near)
    unknown = near[fits.noise[near] == 0.0]
    if unknown.size:
        fits.noise[unknown] = _noise_of(g, solution, fits.low[unknown], fits.high[unknown])
    zero = near[sizes[near] <= 2.0 * fits.noise[near]]
    if zero.size:
        # A jump beside an interval is a smaller part of a derivative over a longer distance.
        again = _noise_of(g, solution, fits.low[zero], fits.high[zero], _LONG_SHIFT)
        fits.noise[zero] = np.minimum(fits.noise[zero], again)
    noise = 2.0 * fits.noise
    zero = zero[sizes[zero] <= noise[zero]]
    if not zero.size:
        return None
    is_begin = np.append(True, fits.low[zero[1:]] != fits.high[zero[:-1]])[: len(zero)]
    begins = np.flatnonzero(is_begin)
    ends = np.append(begins[1:], len(zero))[: len(begins)] - 1
    begins, ends = zero[begins], zero[ends]
    low, high = fits.low[begins], fits.high[ends]
    earlier = np.minimum(fits.low[begins - 1], low)
    later = np.maximum(fits.high[(ends + 1) % len(sizes)], high)
    level = np.maximum(2.0 * sizes, noise / _SUDDEN)
    low = _refined(g, solution, low, earlier, level[begins])
    high = _refined(g, solution, high, later, level[ends])
    noise = noise[begins]
    earlier, later = _beside(solution, low, -1), _beside(solution, high, 1)
    both = np.concatenate([earlier, later])
    values = solution.values(g, both).reshape(2, -1)
    # The noise within the interval may come from a jump at its end.
    beside = solution.noise(g, both).reshape(2, -1)
    before, after = np.where(np.abs(values) > _SUDDEN * beside, np.sign(values), 0.0)
    return ZeroIntervals(low, high, np.maximum(noise, beside.max(axis=0)), before, after)


def _refined(
    g: EventFunction, solution: Solution, ends: Array, others: Array, level: Array
) -> Array:
    """Return times, from `ends` toward `others`, up to which a function is below `level`."""
    # A polynomial may extend beyond a kink of the function; kinks of the solution are at edges.
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


def _beside(solution: Solution, times: Array, side: int) -> Array:
    edges = solution.pieces.edges
    piece = np.searchsorted(edges, times, side="left" if side < 0 else "right") - 1
    piece = np.clip(piece, 0, len(edges) - 2)
    beside = times + side * _BEFORE * (edges[piece + 1] - edges[piece])
    return np.asarray(np.clip(beside, edges[0], edges[-1]))
