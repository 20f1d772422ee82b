"""Solution of many bodies under one recorded torque, by one kernel call."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyharness.model.arrays import rows_within, unit_quaternions
from pyharness.model.attitude import Quaternion, rotated, turned_back
from pyharness.model.ensemble import Ensemble
from pyharness.model.extension import extension
from pyharness.model.trajectory import Array

_NONE = np.empty((0, 0))
_ROUNDED = 2.0**-51  # as in solver.c


class Equations(NamedTuple):
    """Equations of motion: `data`, (1 or n, k), are inputs of `packed`, but constants in `alone`.

    `axes` are those of omega (columns) in the equations, with their quaternion.
    """

    packed: Array
    alone: Array  # empty: bodies that can't be solved side by side are left
    data: Array = _NONE
    axes: tuple[Array, Quaternion] | None = None


class Bodies(NamedTuple):
    """Initial states of n bodies, or one for all, and the times of their results."""

    omega: Array  # rad/s
    times: Array  # (m, 1 or n), s
    attitude: Array | None = None
    own: Array = _NONE  # (n, k): own states
    own_sizes: tuple[float, ...] = ()  # least sizes to which their errors are relative


def solve_tape(
    equations: Equations, bodies: Bodies, found: Ensemble, piece: slice,
    given_up: NDArray[np.int32],
) -> int:  # fmt: skip
    """Solve the bodies in `piece` for all times, into `found`, whose arrays have an axis of times.

    Return how many were not solved side by side, on the side of time 0 with more of them.
    """
    most_left = 0
    omega, times, turns, own, sizes = bodies
    n = piece.stop - piece.start
    starts = rows_within(omega, piece)
    first = np.empty((0, 4))
    if turns is not None:
        given = rows_within(turns, piece)
        with np.errstate(all="ignore"):
            is_unit = np.abs((given * given).sum(axis=1, keepdims=True) - 1.0) <= _ROUNDED
        first = np.where(is_unit, given, unit_quaternions(given))
    if equations.axes is not None:
        axes, turn = equations.axes
        starts = rotated(starts, axes.T)
        first = turned_back(first, np.multiply(turn, [1.0, -1.0, -1.0, -1.0]))
    starts = np.ascontiguousarray(starts)
    data = equations.data if len(equations.data) < 2 else equations.data[piece]
    states = rows_within(own, piece) if own.size else np.empty((n, 0))
    columns = times if times.shape[1] == 1 else times[:, piece]
    # Kernels integrate away from time 0.
    for rows in sides_of(columns[:, 0]):
        m = len(columns[rows])
        result = Ensemble(
            omega=np.empty((n, m, 3)), status=np.empty((n, m), np.int8),
            attitude=np.empty((len(first), m, 4)), own=np.empty((states.shape[1], n, m)),
            estimates=np.empty((0 if found.estimates is None else n, m, 2)),
        )  # fmt: skip
        assert result.attitude is not None
        assert result.own is not None
        assert result.estimates is not None
        n_left, _ = extension().tape_many(
            equations.packed, equations.alone.copy(), starts.T, np.asfortranarray(columns[rows]),
            first.T, data.T, np.asfortranarray(states), np.array([*sizes, 0.0]), given_up,
            result.omega.T, result.attitude.T, result.own.T, result.status.T, result.estimates.T,
        )  # fmt: skip
        if equations.axes is not None:
            result.omega[:] = rotated(result.omega, axes)
            result.attitude[:] = turned_back(result.attitude, turn)
        _set_rows(found, result, piece, rows)
        most_left = max(most_left, n_left)
    return most_left


def sides_of(times: Array) -> list[slice]:
    """Return the places of monotonic times on each side of 0, each from 0 on.

    NaN, before or after them, has none, unless there is one time.
    """
    if len(times) == 1:
        return [slice(0, 1)]
    known = np.flatnonzero(~np.isnan(times))
    if not len(known):
        return []
    first, last = int(known[0]), int(known[-1]) + 1
    within = times[first:last]
    is_early = within < 0.0 if within[0] < within[-1] else within >= 0.0
    middle = first + int(is_early.sum())
    early = [slice(middle - 1, first - 1 if first else None, -1)] if middle > first else []
    return early + ([slice(middle, last)] if last > middle else [])


def _set_rows(found: Ensemble, result: Ensemble, piece: slice, rows: slice) -> None:
    for name in ("omega", "attitude", "own", "status", "estimates"):
        array, values = getattr(found, name), getattr(result, name)
        if array is None or not values.size:
            continue
        if name == "own":
            values = np.moveaxis(values, 0, -1)
        if name == "estimates":
            values[~(values >= 0.0)] = np.nan
        array[piece, rows] = values
