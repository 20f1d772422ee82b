"""Many bodies under one recorded torque, integrated side by side."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.ensemble import Ensemble
from pyharness.model.arrays import spread, unit_quaternions
from pyharness.model.codes import Methods, Places, Statuses
from pyharness.model.extension import extension
from pyharness.model.trajectory import Array


def solve_side_by_side(
    solver: Any, starts: Array, times: Array, turns: Array | None, found: Ensemble, piece: slice,
    given_up: NDArray[np.int32],
) -> list[int]:  # fmt: skip
    """Solve the bodies in `piece` side by side, and return the indices of the unsolved bodies.

    A body remains unsolved if its error can't be measured. All do if the torque is neither recorded
    nor in space, or if the solver's class overrides `__call__`.
    """
    is_plain = "__call__" not in vars(type(solver))
    packed = getattr(solver, "packed_for_lanes", solver.packed) if is_plain else None
    if packed is None or packed[Places.METHOD] != Methods.TAPE:
        return list(range(piece.start, piece.stop))
    n = piece.stop - piece.start

    def part(rows: Array) -> Array:
        return spread(rows if len(rows) == 1 else rows[piece], n)

    first = last = np.empty((0, 4))
    if turns is not None:
        first, last = unit_quaternions(part(turns)), np.empty((n, 4))
    omega, status = np.empty((n, 3)), np.empty(n, np.int8)
    extension().tape_many(
        packed, part(starts).T, part(times), first.T, given_up, omega.T, last.T, status,
        found.estimates_of(piece),
    )  # fmt: skip
    taken = status == Statuses.COMPLETE
    found.omega[piece][taken] = omega[taken]
    found.status[piece][taken] = Statuses.COMPLETE
    if found.attitude is not None:
        found.attitude[piece][taken] = last[taken]
    left: list[int] = (piece.start + np.flatnonzero(~taken)).tolist()
    return left
