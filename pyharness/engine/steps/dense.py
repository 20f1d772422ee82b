"""Dense output: polynomials through a method's results at Chebyshev points (nodes).

Intervals are divided until the last Chebyshev coefficients are far below the tolerance.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pyharness.engine.problem.problem import problem_of
from pyharness.engine.steps.stepped import step_lengths
from pyharness.model.array_type import Array
from pyharness.model.dense_output import (
    NODES,
    POINTS,
    TO_COEFFICIENTS,
    DenseOutput,
    Pieces,
    nodes,
    sizes_of,
)
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Trajectory

# Ratios of the tolerance at the nodes to the requested tolerance, below 1 because a polynomial
# may have larger errors between its nodes. The second applies if the first can't be met.
_NODE_TOLERANCE = 0.25
_LARGEST_NODE_TOLERANCE = 0.75
# Largest last coefficients of a polynomial, relative to the state, divided by the tolerance.
_LAST = 0.02
# Ratio of a method's rounding errors, which are not smooth in time, to the error amplification; and
# the smallest bound of the last coefficients.
_OWN_ROUNDING = 4e-15
_ROUNDING = 4e-16
_TAIL = 3  # last coefficients, whose magnitude estimates the omitted ones
# If halving an interval does not reduce the tail by this factor, the tail is due to errors of the
# method, and the longer polynomial was accurate.
_DIVIDED = 8.0
_MOST_PARTS = 64  # into which an interval is divided at once
_MOST_PIECES = 200_000
_RADIANS = 2.0  # first guess of the rotation in an interval
_SHORT = 0.25  # a change in a shorter part of an interval might be hidden between nodes


@dataclass(frozen=True, eq=False)
class _Open:
    """An interval (s) that has no polynomial yet."""

    low: float
    high: float
    tail: float = math.inf  # size of the last coefficients on the longer interval that was divided
    whole: Pieces | None = None  # the polynomial there

    def is_rough(
        self, tail: float, times: Array, values: Array, sizes: Array, rough: float
    ) -> bool:
        """Return whether a method's errors, up to `rough`, keep the last coefficients large."""
        if self.whole is None or not self.tail / _DIVIDED < tail <= rough:
            return False
        # A fast wave between few nodes has small tails too, but differs from the longer polynomial.
        apart = np.abs(self.whole(times) - values).max(axis=0) / sizes
        return bool(apart.max() <= rough)


# Returns the trajectory at given times to a given tolerance.
Rows = Callable[[Array, float], Trajectory]


@dataclass(frozen=True, eq=False)
class _Solved:
    rows: Rows
    tolerance: float

    def __call__(self, times: Array) -> Array:
        if not times.size:
            return self(np.zeros(1))[:0]
        each, place = np.unique(times, return_inverse=True)
        return self.rows(each, self.tolerance).y.T[place]


def dense_output(
    scene: Scene, found: Trajectory, rows: Rows, tolerance: float, finest: float, is_closed: bool
) -> DenseOutput:
    """Return the solution between time 0 and the ends of `found`.

    ``rows(times, tolerance)`` computes states; a `tolerance` of 1 means fixed steps.
    """
    ends = sorted({0.0, *found.time[[0, -1]].tolist()}) if len(found.time) else [0.0]
    states: Callable[[Array], Array]
    if is_closed or len(ends) == 1:
        states = _Solved(rows, tolerance)
    else:
        states = state_pieces(scene, found, rows, tolerance, finest)
    rates = problem_of(scene, found.attitude is not None).rates
    return DenseOutput(ends[0], ends[-1], states, rates, len(scene.states))


def state_pieces(
    scene: Scene, found: Trajectory, rows: Rows, tolerance: float, finest: float
) -> Pieces:
    ends = sorted({0.0, *found.time[[0, -1]].tolist()})
    if tolerance == 1.0:
        rates = problem_of(scene, found.attitude is not None).rates
        return _of_fixed_steps(scene, ends, rows, rates)
    # No tolerance may be below `finest`, the method's smallest.
    own = [max(finest, part * tolerance) for part in (_NODE_TOLERANCE, _LARGEST_NODE_TOLERANCE)]
    rough = tolerance + _OWN_ROUNDING * (found.growth or 0.0)
    edges = _first_edges(scene, found, ends, tolerance)
    n_own = len(scene.states)
    return _fitted(edges, rows, tolerance, own, rough, n_own)


def _first_edges(
    scene: Scene, found: Trajectory, ends: list[float], tolerance: float
) -> list[float]:
    """Return the edges (s) of the first intervals, including breaks of the torque's tables."""
    tape = scene.torque.tape if isinstance(scene.torque, StateTorque) else None
    inner = {time for time in (tape.breaks if tape else ()) if ends[0] < time < ends[-1]}
    bounds = sorted({*ends, *inner})
    fastest = float(np.abs(found.omega).max(initial=max(map(abs, scene.omega))))
    total = ends[-1] - ends[0]
    most = min(_MOST_PIECES, found.steps) if found.evaluations else _MOST_PARTS
    share = min(most, fastest * total / _RADIANS) / total
    edges: list[float] = []
    for low, high in itertools.pairwise(bounds):
        count = max(1, math.ceil((high - low) * share))
        edges += np.linspace(low, high, count + 1)[:-1].tolist()
    edges.append(bounds[-1])
    if tape is None and scene.changing is None:
        return edges
    # Few nodes may miss a short change of the torque; short steps of a Taylor series show it.
    attitude = found.attitude is not None or scene.torque.needs_attitude
    steps: dict[float, float] = {}
    for end in ends:
        steps |= step_lengths(scene, attitude, end, tolerance, bounds)
    step_ends = np.array(sorted(steps))
    lengths = np.array([steps[each] for each in step_ends])
    more: list[float] = []
    for low, high in itertools.pairwise(edges):
        within = slice(*np.searchsorted(step_ends, [low, high]))
        if lengths[within].min(initial=math.inf) < _SHORT * (high - low):
            more += step_ends[within].tolist()
    return sorted({*edges, *more})


def _fitted(
    edges: list[float], rows: Rows, tolerance: float, own: list[float], rough: float, n_own: int
) -> Pieces:
    # `own` are tolerances at the nodes, and `rough` is the largest error that is not smooth.
    open_pieces = [_Open(low, high) for low, high in itertools.pairwise(edges)]
    done: list[tuple[Array, Array, Array]] = []
    n_done = 0
    largest = np.zeros(1)
    aim = max(_LAST * tolerance, _ROUNDING)
    while open_pieces:
        if len(open_pieces) + n_done > _MOST_PIECES:
            raise InputError(
                f"dense output and events need more than {_MOST_PIECES} polynomials; use a "
                "shorter time or a larger tolerance, or give the times of the results"
            )
        lows, highs = np.array([(piece.low, piece.high) for piece in open_pieces]).T
        each = nodes(lows, highs, POINTS)
        times, place = np.unique(each, return_inverse=True)
        try:
            states = rows(times, own[0]).y.T
        except InputError as error:
            if own[0] == own[-1]:
                raise InputError(f"dense output and events: {error}") from error
            own = own[1:]
            continue
        if len(states) < len(times):
            raise InputError("dense output: the method reached fewer times than in its first run")
        largest = np.maximum(largest, np.abs(states).max(axis=0))
        sizes = sizes_of(largest, n_own)
        sizes = np.where(sizes > 0.0, sizes, 1.0)
        values = states[place.reshape(each.shape)]
        coefficients = np.einsum("kj,pjm->pkm", TO_COEFFICIENTS, values)
        tails = np.abs(coefficients[:, -_TAIL:]).max(axis=1)
        tails /= sizes
        tails = tails.max(axis=1)
        shortest = 64.0 * np.spacing(np.maximum(np.abs(lows), np.abs(highs)))
        is_done = (tails <= aim) | (highs - lows <= shortest)
        following = []
        for k in np.flatnonzero(~is_done).tolist():
            piece, tail = open_pieces[k], float(tails[k])
            if piece.is_rough(tail, each[k], values[k], sizes, rough):
                is_done[k] = True
                continue
            parts = math.ceil(1.2 * (tail / aim) ** (1.0 / (NODES - _TAIL)))
            edges = np.linspace(piece.low, piece.high, min(max(parts, 2), _MOST_PARTS) + 1).tolist()
            whole = Pieces(np.array([piece.low, piece.high]), values[k][None])
            following += [_Open(low, high, tail, whole) for low, high in itertools.pairwise(edges)]
        done += [(lows[is_done], highs[is_done], values[is_done])]
        n_done += int(is_done.sum())
        open_pieces = following
    lows, highs, values = map(np.concatenate, zip(*done, strict=True))
    order = np.argsort(lows)
    return Pieces(np.append(lows[order], highs.max()), values[order])


def _of_fixed_steps(
    scene: Scene, ends: list[float], rows: Rows, derivatives: Callable[[Array, Array], Array]
) -> Pieces:
    """Return Hermite's cubics between the ends of steps."""
    step = scene.step_size
    steps = [math.ceil(abs(end) / step) for end in ends]
    if max(steps) > _MOST_PIECES:
        raise InputError(
            f"dense output and events need more than {_MOST_PIECES} steps; use a larger step or a "
            "shorter time"
        )
    before = [-k * step for k in range(steps[0] - 1, 0, -1)] if ends[0] < 0.0 else []
    after = [k * step for k in range(1, steps[-1])] if ends[-1] > 0.0 else []
    times = np.unique([ends[0], *before, 0.0, *after, ends[-1]])
    states = rows(times, 1.0).y.T
    slopes = derivatives(times, states)
    length = np.diff(times)[:, None, None]
    u = (0.5 + 0.5 * POINTS)[None, :, None]
    first, last = states[:-1, None], states[1:, None]
    values = (
        (1.0 + 2.0 * u) * (1.0 - u) ** 2 * first
        + u * u * (3.0 - 2.0 * u) * last
        + length * u * (1.0 - u) * ((1.0 - u) * slopes[:-1, None] - u * slopes[1:, None])
    )
    return Pieces(times, values)
