"""Polynomials through the values of an event's function, and the errors (noise) of these values."""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from pyharness.engine.events.event_functions import EventFunction
from pyharness.engine.events.event_roots import (
    POINTS,
    TO_COEFFICIENTS,
    Fits,
    Index,
    Roots,
    joined,
    together,
    transformed,
)
from pyharness.model import dense_output
from pyharness.model.array_type import Array
from pyharness.model.dense_output import DenseOutput, Pieces, nodes, sizes_of
from pyharness.model.errors import InputError

# Largest of the last coefficients of a polynomial that has converged, relative to its values.
LAST = 2e-14
_RUN = 3  # a function that is 0 at so many adjacent nodes is 0 between them
TAIL = 3  # last coefficients, whose magnitude estimates the omitted ones
_MOST_DIVISIONS = 44  # halvings of an interval after which a function counts as not smooth
MUCH = 1e3  # a value this many times its error is not 0
# Relative rounding error of the state's polynomials.
STATE_ROUNDING = 2.0**-46
# Halvings after which only corners, jumps and rounding errors of the function prevent convergence.
_ROUNDED = 6
_MOST_PIECES = 100_000  # intervals that are divided at the same time
# Relative changes of an argument for a numerical derivative.
SHIFT, LONG_SHIFT = 2.0**-26, 2.0**-13
ROUNDING = 2.0**-50  # relative rounding error of the arguments of a function
# Largest relative error of the state in noise; see `Solution.state_error`.
_COARSEST = 1e-10
_SAMPLES = np.arange(1, 6)  # nodes at which a function is compared with its tape
_SOME = slice(5, None, 11)  # three nodes at which noise is computed


@cache
def refining() -> Array:
    """Return the matrix from values at the nodes of the polynomials to values at POINTS."""
    return Pieces(np.array([-1.0, 1.0]), np.eye(dense_output.NODES)[None])(POINTS)


@dataclass(frozen=True, eq=False)
class Solution:
    """The solution of a scene in which events are searched."""

    pieces: Pieces  # the polynomials of `sol`, or approximations of its closed form
    sol: DenseOutput
    tolerance: float  # of omega; 0 means a fixed step

    def states(self, times: Array) -> Array:
        """Return omega, attitude and the user's own unknowns at n times (s), (n, m)."""
        return self.sol.normalized(self.pieces(times))

    @cached_property
    def samples(self) -> tuple[Array, Array]:
        """Return a few times (s) and states, not of these times."""
        values = self.pieces.values
        which = _SAMPLES * (len(values) - 1) // _SAMPLES[-1]
        return self.pieces.edges[which], self.sol.normalized(values[which, _SAMPLES])

    @cached_property
    def at_nodes(self) -> tuple[Array, Array]:
        times = nodes(self.pieces.edges[:-1], self.pieces.edges[1:], POINTS)
        return times, self.sol.normalized(refining() @ self.pieces.values)

    @cached_property
    def at_ends(self) -> tuple[Array, Array]:
        edges, (_, states) = self.pieces.edges, self.at_nodes
        times = np.array(sorted({edges[0], 0.0, edges[-1]}))
        # Time 0 is an edge.
        first = states[np.searchsorted(edges, times[:-1]), 0]
        return times, np.concatenate([first, states[-1:, -1]])

    def values(self, g: EventFunction, times: Array, states: Array | None = None) -> Array:
        states = self.states(times) if states is None else states
        rates = self.sol.rates(times, states) if g.event.needs_rates else None
        return g(times, states, rates)

    def exact_values(self, g: EventFunction, times: Array) -> Array:
        return self.values(g, times, self.sol.normalized(self.sol.states(times)))

    def noise(self, g: EventFunction, times: Array, shift: float = SHIFT) -> Array:
        return self.values_and_noise(g, times, None, shift)[1]

    def values_and_noise(
        self, g: EventFunction, times: Array, states: Array | None = None, shift: float = SHIFT
    ) -> tuple[Array, Array, Array]:
        """Return a function's values, their errors (noise), and errors due to rounding alone."""
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

    def changed_values(self, g: EventFunction, times: Array, part: float) -> Array:
        """Return values of `g` at n times (s), shape (m, n), in m variants of the state."""
        states = self.states(times)
        n, width = states.shape
        count = 2 * width + 1
        # The state is unchanged, then each unknown is raised, then each lowered, by `part` of its
        # size.
        signs = np.eye(count, width, -1) - np.eye(count, width, -1 - width)
        every = states + signs[:, None] * (part * sizes_of(np.abs(states), self.sol.n_own))
        values = self.values(g, np.tile(times, count), every.reshape(-1, width))
        return values.reshape(-1, n)

    @property
    def state_error(self) -> float:
        """The relative error of the state, limited to 1e-10, so that close roots are not merged."""
        return max(ROUNDING, min(self.tolerance, _COARSEST))

    @cached_property
    def _sizes(self) -> Array:
        """The largest sizes of unknowns from time 0 to each polynomial."""
        # The maximum is faster with the nodes on the first axis.
        largest = np.abs(self.pieces.values.swapaxes(0, 1), order="C").max(axis=0)
        count = np.searchsorted(self.pieces.edges[:-1], 0.0)
        for side in (largest[:count][::-1], largest[count:]):
            np.maximum.accumulate(side, out=side)
        return sizes_of(largest, self.sol.n_own)


def fitted(g: EventFunction, solution: Solution) -> tuple[Fits, list[Fits], Roots]:
    """Return polynomials, those that do not converge, and sign changes of the latter."""
    edges = solution.pieces.edges
    low, high = edges[:-1], edges[1:]
    times, inner = solution.at_nodes
    inner = inner.reshape(times.size, -1)
    values = solution.values(g, times.ravel(), inner).reshape(times.shape)
    first, last = values[:, 0].copy(), values[:, -1]
    # Equal signs at the common end of adjacent intervals, so that no root is lost or doubled.
    first[1:] = last[:-1]
    most = max(_MOST_PIECES, 2 * len(edges))
    scale = np.abs(values).max(axis=1)
    done: list[Fits] = []
    rough: list[Fits] = []
    changes: list[Roots] = []
    for level in range(_MOST_DIVISIONS + 1):
        c = transformed(values, TO_COEFFICIENTS)
        largest = np.abs(values).max(axis=1)
        tail = np.abs(c[:, -TAIL:]).max(axis=1)
        is_done = tail <= LAST * largest
        if not is_done.all():
            near = np.flatnonzero(~is_done)
            noise = noise_of(g, solution, low[near], high[near])
            # A function that is 0 only in a part of the interval has a kink, which noise must not
            # smooth: the ends of the part are events.
            is_zero = np.lib.stride_tricks.sliding_window_view(values[near] == 0.0, _RUN, axis=1)
            is_partly_zero = np.any(is_zero.all(axis=2), axis=1) & (largest[near] > 2.0 * noise)
            if level >= _ROUNDED:
                noise = np.maximum(noise, ROUNDING * scale[near])
            is_done[near] = (tail[near] <= noise) & ~is_partly_zero
        fits = Fits(low, high, first, last, c, np.zeros(len(low)))
        done.append(fits if is_done.all() else fits.only(is_done))
        if is_done.all():
            break
        is_rough = ~is_done & (
            (high - low <= 64.0 * np.spacing(np.abs(low) + np.abs(high)))
            | (level == _MOST_DIVISIONS)
        )
        if len(low) > most:
            # Intervals in which a function with many jumps is far from 0 need no division.
            is_rough |= ~is_done & (np.abs(values).min(axis=1) > np.ptp(values, axis=1))
            if (~is_done & ~is_rough).sum() > most // 2:
                raise InputError(
                    f"{g.name}: the function changes too fast for {most} polynomials; use a "
                    "shorter time, or a smooth function"
                )
        if is_rough.any():
            rough.append(fits.only(is_rough))
            changes.append(_sign_changes(times[is_rough], values[is_rough], first[is_rough]))
        split = ~is_done & ~is_rough
        middle = 0.5 * low[split] + 0.5 * high[split]
        ends = np.column_stack([low[split], middle, middle, high[split]])
        low, high = ends.reshape(-1, 2).T
        first, last, scale = first[split], last[split], np.repeat(scale[split], 2)
        if not low.size:
            break
        times = nodes(low, high, POINTS)
        values = solution.values(g, times.ravel()).reshape(times.shape)
        centre = values[0::2, -1]
        first, last = np.column_stack([first, centre, centre, last]).reshape(-1, 2).T
    return done[0] if len(done) == 1 else together(done, "low"), rough, joined(changes)


def noise_of(
    g: EventFunction, solution: Solution, low: Array, high: Array, shift: float = SHIFT
) -> Array:
    times = nodes(low, high, POINTS)[:, _SOME]
    noise = solution.noise(g, times.ravel(), shift).reshape(times.shape)
    return np.asarray(noise.max(axis=1))


def with_noise(
    g: EventFunction, solution: Solution, fits: Fits, needed: Index
) -> tuple[Fits, Roots]:
    """Return `fits` with `noise` where `needed`, and roots at time 0 and both ends.

    A root at time 0 hides all roots beside it up to the time at which the function exceeds its
    noise, such as the root at which an earlier integration ended.
    """
    sizes, largest = fits.sizes, fits.sizes.max(initial=0.0)
    which = np.flatnonzero(needed | (sizes <= largest / MUCH) | (sizes == largest))
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
    # At an end, a value that exceeds its rounding error is no root. The state at time 0 may be the
    # result of an earlier integration, and the function may have rounding errors of its own.
    size = sizes[(fits.low == 0.0) | (fits.high == 0.0)].max(initial=0.0)
    limit = np.where(ends == 0.0, noise[n:] + ROUNDING * size, 0.0)
    limit = np.maximum(limit, 4.0 * rounding[n:])
    is_root = np.abs(values[n:]) <= limit
    return fits, Roots.bare(ends[is_root], 0, limit[is_root])


def _sign_changes(times: Array, values: Array, first: Array) -> Roots:
    values = values.copy()
    values[:, 0] = first
    is_negative = values < 0.0
    row, column = np.nonzero(is_negative[:, 1:] != is_negative[:, :-1])
    change = np.where(is_negative[row, column], 1, -1)
    return Roots.bare(0.5 * times[row, column] + 0.5 * times[row, column + 1], change)
