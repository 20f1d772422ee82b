"""Solution of a prepared scene from many initial omegas and attitudes."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.ensemble import Ensemble, place_for
from pyharness.engine.many_recorded import solve_side_by_side
from pyharness.model.arrays import check_rows, row_of, rows_of, threads_of
from pyharness.model.attitude import IDENTITY, scalar_first
from pyharness.model.codes import Methods, Statuses
from pyharness.model.extension import ENDS, extension
from pyharness.model.pieces import for_each_piece
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

if TYPE_CHECKING:
    from pyharness.engine.prepared_attitude import AttitudeSolver

# The methods that the kernel for many bodies has.
_SIDE_BY_SIDE = (Methods.CLOSED_FORM, Methods.CLOSED_FORM_OR_TAYLOR, Methods.TAYLOR)


def many_attitudes(
    solver: "AttitudeSolver", code: int, omega0: Any, t_end: Any, attitude0: Any = None, *,
    threads: int = 1, out: "Ensemble | Array | None" = None,
) -> tuple[Array, Array, NDArray[np.int8]]:  # fmt: skip
    """Return omegas, (n, 3), attitudes, (n, 4), and statuses, as `AttitudeSolver.many`."""
    starts, times = rows_of("omega0", omega0, 3), rows_of("t_end", t_end)
    n = len(starts)
    check_rows("t_end", times, n)
    usual = solver.plan.scene.attitude or IDENTITY
    turns = None if attitude0 is None else rows_of("attitude0", scalar_first(attitude0), 4)
    if turns is not None:
        check_rows("attitude0", turns, n)
    found = place_for(out, n, with_attitude=True)
    if out is not None:  # the starts may share memory with it
        starts, turns = starts.copy(), None if turns is None else turns.copy()
    # A subclass, as for full inertia matrices, does more than the kernel.
    has_kernel = code in _SIDE_BY_SIDE and "__call__" not in vars(type(solver))
    if has_kernel:
        turns = rows_of("attitude0", usual, 4) if turns is None else turns
        work = partial(_enter, solver.plan.scene, code, solver._given, starts, times, turns, found)
    else:
        work = partial(_solve_each, solver, starts, times, turns, found)
    for_each_piece(work, n, threads_of(threads))
    assert found.attitude is not None
    return found.omega, found.attitude, found.status


def _enter(
    scene: Scene, code: int, settings: tuple[float, str, float], starts: Array, times: Array,
    turns: Array, found: Ensemble, piece: slice, given_up: NDArray[np.int32],
) -> None:  # fmt: skip
    assert found.attitude is not None
    law = scene.body_torque
    waves = [
        np.array([[*amplitude, frequency] for amplitude, frequency in each]).reshape(1, -1, 4)
        for each in (law.sines, law.cosines)
    ]
    extension().solve_ensemble(
        code, settings[0], scene.step_size, settings[2], scene.moments is not None,
        *(np.array([each]).T for each in (
            scene.moments or scene.coefficients, law.constant, law.rate
        )),
        *(each.T for each in waves),
        starts[piece].T, _select(times, piece), _select(turns, piece).T, given_up,
        found.omega[piece].T, found.attitude[piece].T, found.status[piece],
        found.estimates_of(piece),
    )  # fmt: skip


def _select(rows: Array, piece: slice) -> Array:
    return rows if len(rows) == 1 else rows[piece]


def _solve_each(
    solver: "AttitudeSolver", starts: Array, times: Array, turns: Array | None, found: Ensemble,
    piece: slice, given_up: NDArray[np.int32],
) -> None:  # fmt: skip
    assert found.attitude is not None
    usual = rows_of("attitude0", solver.plan.scene.attitude or IDENTITY, 4)
    first = usual if turns is None else turns
    for i in solve_side_by_side(solver, starts, times, first, found, piece, given_up):
        if given_up[0]:
            return
        turn = None if turns is None else row_of(turns, i)
        if turn is not None and not (np.isfinite(turn).all() and turn.any()):
            found.omega[i] = found.attitude[i] = np.nan
            found.status[i] = Statuses.REFUSED
            continue
        found.omega[i], found.attitude[i] = solver(starts[i], float(row_of(times, i)), turn)
        found.status[i] = ENDS.index(solver.status)
