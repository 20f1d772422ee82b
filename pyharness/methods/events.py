"""Events: the times at which functions of time, omega and attitude are 0.

The solution is a polynomial on each of many intervals. A function of it is approximated by
polynomials on the same intervals, which are divided until the approximation has converged, and all
roots of these polynomials are isolated. Roots of a smooth function are therefore found however near
to each other they are, and so are double roots. Where a function is not smooth, the intervals
become tiny, and sign changes between their nodes are found. A change that is undone before the next
node of an interval is not seen.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev

from pyharness.methods.event_functions import EventFunction
from pyharness.methods.event_roots import (
    FIT_ERROR,
    NODES,
    POINTS,
    TO_COEFFICIENTS,
    Fits,
    Index,
    Roots,
    isolated,
    joined,
    may_vanish,
)
from pyharness.methods.periodic_events import improved, repeated
from pyharness.model.array_type import Array
from pyharness.model.chebyshev import nodes
from pyharness.model.dense_output import DenseOutput, Pieces

# Largest of the last coefficients of a polynomial that has converged, relative to its values.
_LAST = 2e-14
_TAIL = 3  # coefficients whose size is an estimate of those left out
# Divisions of an interval in two, after which the function is not smooth.
_MOST_DIVISIONS = 44
_MOST_PIECES = 100_000  # that are divided at the same time
_BLOCK = 4_000  # polynomials whose roots are isolated together
_SHIFT = 2.0**-26  # relative difference of an argument, by which a derivative is estimated
_ROUNDING = 2.0**-50  # of the arguments of a function
_STATE_ROUNDING = 2.0**-46  # of polynomials of the state, over their largest values
# A double root is known at best to the error of omega, relative to omega.
_COARSEST = 1e-10
_POLISHES = 3


@dataclass(frozen=True, eq=False)
class Solution:
    """The solution of a scene, as the search for events uses it.

    Attributes
    ----------
    pieces : Pieces
        The polynomials of omega and attitude.
    sol : DenseOutput
        The dense output, whose polynomials may be the same.
    tolerance : float
        The tolerance of omega; 0 for a method with a fixed step.
    """

    pieces: Pieces
    sol: DenseOutput
    tolerance: float

    def states(self, times: Array) -> Array:
        """Return omega and attitude at `times` (s), one row for each."""
        return _normalised(self.pieces(times))

    def values(self, g: EventFunction, times: Array, states: Array | None = None) -> Array:
        """Return the values of an event's function at `times` (s)."""
        states = self.states(times) if states is None else states
        rates = self.sol.rates(times, states) if g.event.needs_rates else None
        return g(times, states, rates)

    def exact_values(self, g: EventFunction, times: Array) -> Array:
        """Return the values of an event's function at `times` (s), without the polynomials."""
        return self.values(g, times, _normalised(self.sol.states(times)))

    def noise(self, g: EventFunction, times: Array) -> Array:
        """Return, for each time, the error of an event's function due to errors of its arguments.

        These are the rounding error of time and the error of omega and attitude.
        """
        states = self.states(times)
        rates = self.sol.rates(times, states) if g.event.needs_rates else None
        value = g(times, states, rates)
        shift = _SHIFT * np.abs(times)
        later = np.where(times + shift > times, times + shift, times)
        found = _ROUNDING * np.abs(g(later, states, rates) - value) / _SHIFT
        # A tolerance in excess of the limit would hide pairs of roots.
        own = max(_ROUNDING, min(self.tolerance, _COARSEST))
        for columns, is_rate in ((states, False), (rates, True)):
            if columns is None:
                continue
            largest = np.abs(columns[:, :3]).max(axis=1, initial=0.0)
            for k in range(3 if is_rate else columns.shape[1]):
                moved = columns.copy()
                moved[:, k] += _SHIFT * (largest if k < 3 else 1.0)
                other = g(times, states, moved) if is_rate else g(times, moved, rates)
                found += own * np.abs(other - value) / _SHIFT
        return found


def event_roots(g: EventFunction, solution: Solution) -> Roots:
    """Return all events of a function between the ends of the solution, in ascending order.

    The sign changes of the result are in the order of time, and not in that of integration. A root
    at an end has the sign change to, or from, the values beside it.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        fits, rough = _fitted(g, solution)
        fits = fits.only(may_vanish(fits))
        fits = _with_noise(g, solution, fits)
        found = [rough]
        for begin in range(0, len(fits.low), _BLOCK):
            found.append(isolated(fits.only(slice(begin, begin + _BLOCK))))
        roots = _distinct(g, solution, joined(found))
        roots = _merged(g, solution, joined([roots, _at_ends(g, solution)]))
        return _polished(g, solution, roots)


def _normalised(states: Array) -> Array:
    if states.shape[-1] > 3:
        states[..., 3:] /= np.linalg.norm(states[..., 3:], axis=-1, keepdims=True)
    return states


def _fitted(g: EventFunction, solution: Solution) -> tuple[Fits, Roots]:
    """Return polynomials through the values of a function, and the roots where it has none."""
    edges = solution.pieces.edges
    low, high = edges[:-1], edges[1:]
    smallest = (high - low) * 2.0**-_MOST_DIVISIONS
    coefficients = solution.pieces.coefficients
    basis = chebyshev.chebvander(POINTS, coefficients.shape[1] - 1)
    inner = _normalised(basis @ coefficients)
    times = nodes(low, high, POINTS)
    values = solution.values(g, times.ravel(), inner.reshape(-1, inner.shape[2])).reshape(
        times.shape
    )
    first, last = values[:, 0].copy(), values[:, -1]
    # Adjacent intervals have the same value at their common end.
    first[1:] = last[:-1]
    done: list[Fits] = []
    rough: list[Roots] = []
    while low.size:
        c = values @ TO_COEFFICIENTS.T
        largest = np.abs(values).max(axis=1)
        tail = np.abs(c[:, -_TAIL:]).max(axis=1)
        is_done = tail <= _LAST * largest
        near = np.flatnonzero(~is_done)
        is_done[near] = tail[near] <= _noise_of(g, solution, low[near], high[near])
        fits = Fits(low, high, first, last, c, np.zeros(len(low)))
        done.append(fits.only(is_done))
        is_rough = ~is_done & (
            (high - low <= np.maximum(smallest, 64.0 * np.spacing(np.abs(low) + np.abs(high))))
            | (len(low) > max(_MOST_PIECES, 2 * len(edges)))
        )
        rough.append(_sign_changes(times[is_rough], values[is_rough], first[is_rough]))
        split = ~is_done & ~is_rough
        middle = 0.5 * low[split] + 0.5 * high[split]
        ends = np.column_stack([low[split], middle, middle, high[split]])
        low, high = ends.reshape(-1, 2).T
        smallest = np.repeat(smallest[split], 2)
        first, last = first[split], last[split]
        if not low.size:
            break
        times = nodes(low, high, POINTS)
        values = solution.values(g, times.ravel()).reshape(times.shape)
        centre = values[0::2, -1]
        first, last = np.column_stack([first, centre, centre, last]).reshape(-1, 2).T
    return _all_fits(done), joined(rough)


def _all_fits(parts: list[Fits]) -> Fits:
    return Fits(*(np.concatenate([getattr(x, name) for x in parts]) for name in vars(parts[0])))


def _noise_of(g: EventFunction, solution: Solution, low: Array, high: Array) -> Array:
    """Return the noise of a function on intervals, the largest at three of their nodes."""
    if not low.size:
        return np.zeros(0)
    times = nodes(low, high, POINTS)[:, NODES // 6 :: NODES // 3]
    noise = solution.noise(g, times.ravel()).reshape(times.shape)
    return np.asarray(noise.max(axis=1))


def _with_noise(g: EventFunction, solution: Solution, fits: Fits) -> Fits:
    """Return the polynomials with their noise, without those that can't be distinguished from 0."""
    noise = _noise_of(g, solution, fits.low, fits.high) + _ROUNDING * fits.sizes
    fits = replace(fits, noise=noise)
    return fits.only(fits.sizes > 2.0 * noise)


def _sign_changes(times: Array, values: Array, first: Array) -> Roots:
    """Return the sign changes between adjacent nodes of intervals, without further refinement."""
    values = values.copy()
    values[:, 0] = first
    is_negative = values < 0.0
    row, column = np.nonzero(is_negative[:, 1:] != is_negative[:, :-1])
    change = np.where(is_negative[row, column], 1, -1)
    zeros = np.zeros(len(row))
    middle = 0.5 * times[row, column] + 0.5 * times[row, column + 1]
    return Roots(middle, change, zeros, zeros, zeros, zeros)


def _distinct(g: EventFunction, solution: Solution, roots: Roots) -> Roots:
    """Return roots with the noise at their own times, without extrema that are not near 0."""
    if not roots.time.size:
        return roots
    noise = solution.noise(g, roots.time) + _ROUNDING / FIT_ERROR * roots.near
    noise = np.minimum(noise, roots.noise)
    value = solution.values(g, roots.time)
    # A value beyond 0, as seen from those beside the extremum, is on the other side of two roots.
    is_root = (roots.change != 0) | (np.abs(value) <= noise) | (value * roots.curvature < 0.0)
    return replace(roots, noise=noise).only(is_root)


def _polished(g: EventFunction, solution: Solution, roots: Roots) -> Roots:
    """Return roots whose times are improved by the function itself."""
    if not roots.time.size:
        return roots
    time, value = roots.time, solution.values(g, roots.time)
    is_simple = (roots.change != 0) & (roots.slope * roots.change > 0.0)
    low, high = solution.pieces.edges[[0, -1]]
    for _ in range(_POLISHES):
        step = np.where(is_simple, -value / np.where(is_simple, roots.slope, 1.0), 0.0)
        step[~np.isfinite(step)] = 0.0
        trial = np.clip(time + step, low, high)
        if not np.any(trial != time):
            break
        other = solution.values(g, trial)
        better = np.abs(other) < np.abs(value)
        time, value = np.where(better, trial, time), np.where(better, other, value)
    return replace(roots, time=time)


def _at_ends(g: EventFunction, solution: Solution) -> Roots:
    """Return the roots at the ends of the solution, and at time 0."""
    edges = solution.pieces.edges
    ends = np.unique([edges[0], 0.0, edges[-1]])
    # A function that is not 0 to rounding at an end is on one side of 0 there.
    values = solution.values(g, ends)
    noise = 4.0 * replace(solution, tolerance=0.0).noise(g, ends)
    is_root = np.abs(values) <= noise
    found = ends[is_root]
    zeros = np.zeros(len(found))
    return Roots(found, zeros.astype(int), zeros, zeros, noise[is_root], zeros)


def _merged(g: EventFunction, solution: Solution, roots: Roots) -> Roots:
    """Return roots in which those that can't be distinguished from each other are one."""
    count = len(roots.time)
    if not count:
        return roots
    time = roots.time
    noise = np.maximum(roots.noise[:-1], roots.noise[1:])
    gap = np.diff(time)
    middle = solution.values(g, time[:-1] + 0.5 * gap) if count > 1 else gap
    is_same = (
        (np.abs(middle) <= noise)
        | _have_one_extremum(g, solution, roots, noise)
        | (gap <= 8.0 * np.spacing(np.abs(time[1:])))
    )
    is_jump = (roots.change != 0) & (roots.slope == 0.0)
    between = np.flatnonzero(is_jump[:-1] & is_jump[1:] & ~is_same)
    is_same[between] = _have_any_sign(g, solution, (time[:-1] + 0.5 * gap)[between])
    group = np.concatenate([[0], np.cumsum(~is_same)])
    total = np.zeros(group[-1] + 1, dtype=int)
    np.add.at(total, group, roots.change)
    change = np.sign(total)
    begin = np.flatnonzero(np.diff(group, prepend=-1))
    chosen, size = begin.copy(), np.diff(begin, append=count)
    ends = (*solution.pieces.edges[[0, -1]].tolist(), 0.0)
    # A jump there and back, both by rounding, is no change of sign.
    is_event = (change != 0) | ~np.minimum.reduceat(is_jump, begin)
    for k in np.flatnonzero(size > 1):
        chosen[k] = _chosen(roots, np.arange(begin[k], begin[k] + size[k]), change[k], ends)
    merged = replace(roots.only(chosen), change=change).only(is_event)
    return _with_extrema(g, solution, merged, ends)


def _have_any_sign(g: EventFunction, solution: Solution, times: Array) -> Index:
    """Return at which times rounding errors of the state decide the sign of a function.

    Where a function jumps, its own values do not show it.
    """
    found: Index = np.zeros(len(times), dtype=bool)
    if not times.size:
        return found
    states = solution.states(times)
    is_negative = solution.values(g, times, states) < 0.0
    largest = np.abs(states[:, :3]).max(axis=1)
    for k in range(states.shape[1]):
        for side in (-1.0, 1.0):
            moved = states.copy()
            moved[:, k] += side * _STATE_ROUNDING * (largest if k < 3 else 1.0)
            found |= (solution.values(g, times, moved) < 0.0) != is_negative
    return found


def _have_one_extremum(g: EventFunction, solution: Solution, roots: Roots, noise: Array) -> Index:
    """Return which adjacent roots are a pair only because of the errors of the polynomials.

    The function is 0, to within its noise, at the extremum between them.
    """
    found: Index = np.zeros(len(noise), dtype=bool)
    gap = np.diff(roots.time)
    for k in (slice(None, -1), slice(1, None)):
        step = -roots.slope[k] / roots.curvature[k]
        widest = np.sqrt(8.0 * roots.near[k] / np.abs(roots.curvature[k]))
        near = np.flatnonzero((gap <= widest) & (np.abs(step) <= widest))
        if near.size:
            trial = np.clip(roots.time[k] + step, *solution.pieces.edges[[0, -1]])[near]
            found[near] |= np.abs(solution.values(g, trial)) <= noise[near]
    return found


def _with_extrema(
    g: EventFunction, solution: Solution, roots: Roots, ends: tuple[float, ...]
) -> Roots:
    """Return roots in which a double one, which may be one of a pair, is at the extremum."""
    is_double = (roots.change == 0) & ~np.isin(roots.time, ends)
    if not is_double.any():
        return roots
    step = np.zeros(len(roots.time))
    step[is_double] = -roots.slope[is_double] / roots.curvature[is_double]
    # The errors of the polynomial, and not only the noise, may have moved the root this far.
    widest = np.sqrt(8.0 * roots.near / np.abs(roots.curvature))
    step[~(np.abs(step) <= widest)] = 0.0
    trial = np.clip(roots.time + step, *solution.pieces.edges[[0, -1]])
    is_root = np.abs(solution.values(g, trial)) <= roots.noise
    return replace(roots, time=np.where(is_root, trial, roots.time))


def _chosen(roots: Roots, group: Index, change: int, ends: tuple[float, ...]) -> int:
    """Return the number of the root that stands for a group: an end, or the middle one."""
    at_end = group[np.isin(roots.time[group], ends)]
    if at_end.size:
        return int(at_end[0])
    alike = group[roots.change[group] == change]
    alike = alike if alike.size else group
    return int(alike[len(alike) // 2])


def side_events(g: EventFunction, solution: Solution, roots: Roots, side: int) -> Array:
    """Return the times of the events on one side of 0, in the order away from 0.

    `side` is 1 for the times after 0, and -1 for those before 0. A root at time 0 has the sign
    change from 0 to the values that follow, and a root at the end of the solution the sign change
    to 0, as in SciPy.
    """
    end = solution.pieces.edges[-1 if side > 0 else 0]
    if side * end <= 0.0:
        return np.zeros(0)
    kept = side * roots.time >= 0.0
    time, change = side * roots.time[kept][::side], side * roots.change[kept][::side]
    is_end = (time == 0.0) | (time == side * end)
    is_zero = np.zeros(len(time), dtype=bool)
    bounds = np.concatenate([[0.0], time, [side * end]])
    for k in np.flatnonzero(is_end):
        beside = bounds[k + 2] if time[k] == 0.0 else bounds[k]
        inner = np.array([side * (0.5 * time[k] + 0.5 * beside)])
        value = solution.values(g, inner)[0]
        # A function that is 0 throughout has no event.
        is_zero[k] = abs(value) <= solution.noise(g, inner)[0]
        change[k] = np.sign(value) * (1 if time[k] == 0.0 else -1)
    accepted = ((change == g.event.direction) | (g.event.direction == 0)) & ~is_zero
    if not g.event.counts_touches:
        accepted &= (change != 0) & ~is_end
    found: Array = side * time[accepted]
    return found


def _repeated(
    g: EventFunction, solution: Solution, times: Array, side: int, period: float
) -> Array:
    """Return the times of all events on one side of 0, from those where there are polynomials."""
    last, end = solution.pieces.edges[-1], solution.sol.t_max
    if side < 0:
        last, end = solution.pieces.edges[0], solution.sol.t_min
    if last == end:
        return times
    found, kept = repeated(side * times, period, abs(end), g.name)
    found *= side
    found[kept:] = improved(g, found[kept:], solution.exact_values, period)
    return np.clip(found, solution.sol.t_min, solution.sol.t_max)


@dataclass(frozen=True, eq=False)
class FoundEvents:
    """The events of a scene, and the times at which they end the integration.

    Attributes
    ----------
    times : list of ndarray
        The times (s) of the events of each function, in ascending order.
    states : list of ndarray
        Omega (rad/s), and the attitude if it was requested, at these times, one row for each event.
    first, last : float
        The times (s) of the terminal events before and after 0; infinite without such an event.
    """

    times: list[Array]
    states: list[Array]
    first: float
    last: float


def no_events(count: int, columns: int) -> FoundEvents:
    """Return the events of `count` functions if no time but 0 was requested."""
    states = [np.zeros((0, columns)) for _ in range(count)]
    return FoundEvents([np.zeros(0) for _ in range(count)], states, -math.inf, math.inf)


def found_events(
    functions: list[EventFunction], solution: Solution, period: float = 0.0
) -> FoundEvents:
    """Return the events of several functions, without those beyond a terminal event.

    With a period (s), the polynomials of the solution may end before the solution. Events beyond
    them are repetitions.
    """
    roots = [event_roots(g, solution) for g in functions]
    sides: dict[int, list[Array]] = {}
    limits: dict[int, float] = {}
    for side in (-1, 1):
        lists = [side_events(g, solution, x, side) for g, x in zip(functions, roots, strict=True)]
        if period > 0.0:
            lists = [
                _repeated(g, solution, times, side, period)
                for g, times in zip(functions, lists, strict=True)
            ]
        ends = [
            abs(times[int(g.limit) - 1])
            for g, times in zip(functions, lists, strict=True)
            if len(times) >= g.limit
        ]
        limits[side] = min(ends, default=math.inf)
        sides[side] = [times[np.abs(times) <= limits[side]] for times in lists]
    # A root at time 0 may be in the lists of both sides.
    times = [np.unique(np.concatenate(both)) for both in zip(*sides.values(), strict=True)]
    states = [solution.sol(each).T for each in times]
    return FoundEvents(times, states, -limits[-1], limits[1])
