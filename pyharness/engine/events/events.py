"""Events: the times at which functions of time, omega and attitude are 0.

A function is approximated by polynomials, on intervals divided until they converge. All roots are
isolated, including close and double ones. Where the function is not smooth, sign changes between
nodes of tiny intervals are found, and minima of its magnitude at corners.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pyharness.engine.events.event_corners import find_corners
from pyharness.engine.events.event_fits import (
    ROUNDING,
    STATE_ROUNDING,
    Solution,
    fitted,
    with_noise,
)
from pyharness.engine.events.event_functions import EventFunction
from pyharness.engine.events.event_roots import (
    EXACT,
    FIT_ERROR,
    WIDER,
    Index,
    Roots,
    isolated,
    joined,
    may_vanish,
)
from pyharness.engine.events.event_search import distinct_roots
from pyharness.engine.events.event_zeros import zero_intervals
from pyharness.engine.events.periodic_events import improved, repeat
from pyharness.model.array_type import Array

_BLOCK = 4_000  # polynomials whose roots are isolated together
_POLISHES = 3


def event_roots(g: EventFunction, solution: Solution) -> Roots:
    roots = distinct_roots(g, solution)
    if roots is None:
        return _all_roots(g, solution)
    if not roots.time.size:
        return roots
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        # The values of the function itself are rounded otherwise than those of its tape.
        values = solution.values(g, roots.time)
        return replace(roots, time=_on_far_side(g, solution, roots, roots.time, values))


def _all_roots(g: EventFunction, solution: Solution) -> Roots:
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        fits, rough, changes = fitted(g, solution)
        kept = may_vanish(fits)
        fits, at_ends = with_noise(g, solution, fits, kept)
        zeros = zero_intervals(g, solution, fits)
        corners = find_corners(g, solution, fits, rough)
        fits.noise[:] += ROUNDING * fits.sizes
        fits = fits.only(kept & (fits.sizes > 2.0 * fits.noise))
        blocks = [slice(k, k + _BLOCK) for k in range(0, len(fits.low), _BLOCK)]
        found = [isolated(fits.only(block)) for block in blocks]
        roots = joined([_distinct(g, solution, joined(found)), changes])
        if corners is not None:
            roots = roots.only(~corners.contain(roots.time))
        roots = joined([roots, at_ends])
        if zeros is not None:
            roots = roots.only(~zeros.contain(g, solution, roots))
        if corners is not None:
            roots = joined([roots, corners.roots])
            zeros = zeros and zeros.only(~corners.are_in(zeros.low, zeros.high))
        if roots.time.size:
            roots = _merged(g, solution, roots)
            # The root at the start remains there.
            roots.change[roots.time == 0.0] = 0
            roots = _polished(g, solution, roots)
        return roots if zeros is None else joined([roots, zeros.roots(g.event.counts_touches)])


def _distinct(g: EventFunction, solution: Solution, roots: Roots) -> Roots:
    """Return the roots with their `noise`, without extrema that differ from 0."""
    if not roots.time.size:
        return roots
    value, noise, _ = solution.values_and_noise(g, roots.time)
    noise = np.minimum(noise + ROUNDING / FIT_ERROR * roots.near, roots.noise)
    # At an extremum beyond 0, the polynomial has missed two roots.
    is_root = (roots.change != 0) | (np.abs(value) <= noise) | (value * roots.curvature < 0.0)
    roots = replace(roots, noise=noise)
    return roots if is_root.all() else roots.only(is_root)


def _polished(g: EventFunction, solution: Solution, roots: Roots) -> Roots:
    time, value = roots.time, solution.values(g, roots.time)
    is_simple = (roots.change != 0) & (roots.slope * roots.change > 0.0)
    slope = np.where(is_simple, roots.slope, math.inf)
    low, high = solution.pieces.edges[[0, -1]]
    for _ in range(_POLISHES):
        step = -value / slope
        is_moved = np.abs(step) > np.spacing(np.abs(time))
        if not is_moved.any():
            break
        trial = np.clip(np.where(is_moved, time + step, time), low, high)
        other = solution.values(g, trial)
        better = np.abs(other) < np.abs(value)
        time, value = np.where(better, trial, time), np.where(better, other, value)
        slope = np.where(better, slope, math.inf)
    return replace(roots, time=_on_far_side(g, solution, roots, time, value))


def _on_far_side(
    g: EventFunction, solution: Solution, roots: Roots, times: Array, values: Array
) -> Array:
    """Return the times (s) of roots, not before the sign changes."""
    # Integration may continue from the state at a root, which must be beyond the sign change.
    is_short = values * _after(times, roots.change) < 0.0
    ends = solution.pieces.edges[[0, -1]]
    times = _bisect(solution, partial(solution.values, g), ends, times, roots.change, is_short)
    if solution.sol.states is not solution.pieces:
        times = _beyond(g, solution, times, roots.change, roots.noise)
    return times


def _after(times: Array, changes: Index) -> Index:
    """Return the signs, after roots in the direction of integration, of a function that changes."""
    return np.where(times < 0.0, -changes, changes)


def _beyond(
    g: EventFunction, solution: Solution, times: Array, changes: Index, noise: Array
) -> Array:
    """Return the times (s) of roots, those at which `sol` is before the sign change moved."""
    values, ends = (
        partial(solution.exact_values, g),
        np.array([solution.sol.t_min, solution.sol.t_max]),
    )
    value = values(times)
    # The start of an integration hides smaller values.
    is_short = (value * _after(times, changes) < 0.0) & (np.abs(value) > noise)
    return _bisect(solution, values, ends, times, np.where(is_short, changes, 0), is_short)


def _bisect(
    solution: Solution,
    values: Callable[[Array], Array],
    ends: Array,
    times: Array,
    changes: Index,
    is_short: Index,
) -> Array:
    """Return the times (s) of roots, with inexact or short sign changes refined by bisection."""
    # Near a root of odd multiplicity above 1, polynomials are inexact, but signs are not.
    edges = solution.pieces.edges
    bounds = np.concatenate([ends[:1], 0.5 * times[:-1] + 0.5 * times[1:], ends[1:]])
    piece = np.clip(np.searchsorted(edges, times) - 1, 0, len(edges) - 2)
    rounding = np.spacing(np.abs(times)) + np.spacing(edges[piece + 1] - edges[piece])
    found, width = times.copy(), EXACT * rounding
    wide = np.flatnonzero(changes)
    low, high = times.copy(), times.copy()
    open_ones: list[Index] = []
    while wide.size:
        low[wide] = np.maximum(times[wide] - width[wide], bounds[wide])
        high[wide] = np.minimum(times[wide] + width[wide], bounds[wide + 1])
        ends = np.concatenate([low[wide], high[wide]])
        before, after = values(ends).reshape(2, -1) * changes[wide]
        has_change = (before < 0.0) & (after > 0.0)
        is_exact = (width[wide] <= EXACT * rounding[wide]) & ~is_short[wide]
        open_ones.append(wide[has_change & ~is_exact])
        is_whole = (low[wide] == bounds[wide]) & (high[wide] == bounds[wide + 1])
        wide = wide[~(has_change | is_whole)]
        width[wide] *= WIDER
    k = np.concatenate(open_ones) if open_ones else wide
    while k.size:
        middle = 0.5 * low[k] + 0.5 * high[k]
        k, middle = (x[(middle > low[k]) & (middle < high[k])] for x in (k, middle))
        # The root of an interval of zeros is the end that integration from time 0 reaches first.
        is_before = times[k] < 0.0
        value = values(middle) * changes[k]
        is_late = (value > 0.0) | ((value == 0.0) & ~is_before)
        low[k], high[k] = np.where(is_late, low[k], middle), np.where(is_late, middle, high[k])
        found[k] = np.where(is_before, low[k], high[k])
    return found


def _merged(g: EventFunction, solution: Solution, roots: Roots) -> Roots:
    ends = (*solution.pieces.edges[[0, -1]].tolist(), 0.0)
    is_same = _are_same(g, solution, roots) if len(roots.time) > 1 else np.zeros(0, dtype=bool)
    if is_same.any():
        roots = _grouped(roots, is_same, ends)
    return _with_extrema(g, solution, roots, ends)


def _are_same(g: EventFunction, solution: Solution, roots: Roots) -> Index:
    time = roots.time
    noise = np.maximum(roots.noise[:-1], roots.noise[1:])
    gap = np.diff(time)
    middle = time[:-1] + 0.5 * gap
    # The error of the state may decide the sign.
    part = max(STATE_ROUNDING, solution.state_error)
    values = solution.changed_values(g, middle, part)
    found: Index = (
        (np.abs(values[0]) <= noise)
        | ((values < 0.0) != (values[0] < 0.0)).any(axis=0)
        | (gap <= 8.0 * np.spacing(np.abs(time[1:])))
    )
    # Polynomials are inexact by `near`; a larger value separates two roots.
    is_flat = np.abs(values[0]) <= 2.0 * np.maximum(roots.near[:-1], roots.near[1:])
    return found | (is_flat & _have_one_extremum(g, solution, roots, noise))


def _grouped(roots: Roots, is_same: Index, ends: tuple[float, ...]) -> Roots:
    is_jump = (roots.change != 0) & (roots.slope == 0.0)
    begin = np.flatnonzero(np.append(True, ~is_same))
    change = np.sign(np.add.reduceat(roots.change, begin))
    chosen, size = begin.copy(), np.diff(begin, append=len(roots.time))
    # Two opposite sign changes due to rounding are no event.
    is_event = (change != 0) | ~np.minimum.reduceat(is_jump, begin)
    for k in np.flatnonzero(size > 1):
        chosen[k] = _chosen(roots, np.arange(begin[k], begin[k] + size[k]), change[k], ends)
    return replace(roots.only(chosen), change=change).only(is_event)


def _have_one_extremum(g: EventFunction, solution: Solution, roots: Roots, noise: Array) -> Index:
    """Return which pairs of adjacent roots enclose one extremum that is 0 to within `noise`."""
    found: Index = np.zeros(len(noise), dtype=bool)
    widest = np.sqrt(8.0 * roots.near / np.abs(roots.curvature))
    # A distant root belongs to another extremum, however flat the function is here.
    is_close = np.diff(roots.time) <= np.minimum(widest[:-1], widest[1:])
    for k in (slice(None, -1), slice(1, None)):
        step = -roots.slope[k] / roots.curvature[k]
        near = np.flatnonzero(is_close & (np.abs(step) <= widest[k]))
        if near.size:
            trial = np.clip(roots.time[k] + step, *solution.pieces.edges[[0, -1]])[near]
            found[near] |= np.abs(solution.values(g, trial)) <= noise[near]
    return found


def _with_extrema(
    g: EventFunction, solution: Solution, roots: Roots, ends: tuple[float, ...]
) -> Roots:
    """Return the roots, each double root moved to a nearby extremum that is 0 within the noise."""
    if roots.change.all():
        return roots
    is_double = (roots.change == 0) & ~np.isin(roots.time, ends)
    step = np.zeros(len(roots.time))
    step[is_double] = -roots.slope[is_double] / roots.curvature[is_double]
    # Errors of the polynomial may have moved the root this far.
    widest = np.sqrt(8.0 * roots.near / np.abs(roots.curvature))
    step[~(np.abs(step) <= widest)] = 0.0
    trial = np.clip(roots.time + step, *solution.pieces.edges[[0, -1]])
    is_root = np.abs(solution.values(g, trial)) <= roots.noise
    return replace(roots, time=np.where(is_root, trial, roots.time))


def _chosen(roots: Roots, group: Index, change: int, ends: tuple[float, ...]) -> int:
    at_end = group[np.isin(roots.time[group], ends)]
    if at_end.size:
        return int(at_end[0])
    alike = group[roots.change[group] == change]
    alike = alike if alike.size else group
    return int(alike[len(alike) // 2])


def side_events(g: EventFunction, solution: Solution, roots: Roots, side: int) -> Roots:
    """Return the events after (`side` 1) or before (-1) time 0, in order away from 0."""
    end = solution.pieces.edges[-1 if side > 0 else 0]
    if not roots.time.size or end == 0.0:
        return joined([])
    # A root at time 0, where the integration starts, is no event.
    roots = roots.only(side * roots.time > 0.0).only(slice(None, None, side))
    time, change, lasting = (side * x for x in (roots.time, roots.change, roots.lasting))
    # As in SciPy, a root at the end is a sign change to 0.
    is_end = (lasting == 0.0) & (time == side * end)
    last = np.append(0.0, time + lasting)
    for k in np.flatnonzero(is_end):
        value = solution.values(g, np.array([side * (0.5 * time[k] + 0.5 * last[k])]))[0]
        change[k] = -np.sign(value)
    accepted = (change == g.event.direction) | (g.event.direction == 0)
    if not g.event.counts_touches:
        accepted &= (change != 0) & ~is_end
    return roots.only(accepted)


def _repeated(
    g: EventFunction, solution: Solution, roots: Roots, side: int, period: float
) -> Array:
    """Return event times (s) on one side of 0, repeated periodically beyond the polynomials."""
    last, end = solution.pieces.edges[-1], solution.sol.t_max
    if side < 0:
        last, end = solution.pieces.edges[0], solution.sol.t_min
    if last == end or period == 0.0:
        return roots.time
    found, which, kept = repeat(side * roots.time, period, abs(end), g.name)
    found *= side
    found[kept:] = improved(g, found[kept:], solution.exact_values, period)
    found = np.clip(found, solution.sol.t_min, solution.sol.t_max)
    if g.limit < math.inf:
        roots = roots.only(which[::side])
        found[::side] = _beyond(g, solution, found[::side], roots.change, roots.noise)
    return found


@dataclass(frozen=True, eq=False)
class FoundEvents:
    """The ascending `times` (s) and the `states` of each function's events."""

    times: list[Array]
    states: list[Array]
    first: float  # time (s) of the terminal event before time 0, or -infinity
    last: float  # time (s) of the terminal event after time 0, or infinity


def no_events(count: int, columns: int) -> FoundEvents:
    states = [np.zeros((0, columns)) for _ in range(count)]
    return FoundEvents([np.zeros(0) for _ in range(count)], states, -math.inf, math.inf)


def found_events(
    functions: list[EventFunction], solution: Solution, period: float = 0.0
) -> FoundEvents:
    """Return the events of several functions, up to a terminal event.

    With a `period` (s), they repeat beyond the polynomials' time range.
    """
    roots = [event_roots(g, solution) for g in functions]
    sides: dict[int, list[Array]] = {}
    limits: dict[int, float] = {}
    for side in (-1, 1):
        lists = [
            _repeated(g, solution, side_events(g, solution, x, side), side, period)
            for g, x in zip(functions, roots, strict=True)
        ]
        ends = [
            abs(times[int(g.limit) - 1])
            for g, times in zip(functions, lists, strict=True)
            if len(times) >= g.limit
        ]
        limits[side] = min(ends, default=math.inf)
        sides[side] = [times[np.abs(times) <= limits[side]] for times in lists] if ends else lists
    found = no_events(len(functions), solution.pieces.values.shape[2])
    for k, both in enumerate(zip(*sides.values(), strict=True)):
        if any(map(len, both)):
            found.times[k] = np.sort(np.concatenate(both))
            found.states[k] = solution.sol(found.times[k]).T
    return FoundEvents(found.times, found.states, -limits[-1], limits[1])
