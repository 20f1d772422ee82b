"""Solution of a prepared scene from many initial states."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.many_scenes import rows_of_scene, solve_bodies
from pyharness.model.arrays import (
    buffer_of,
    check_rows,
    row_of,
    rows_of,
    rows_within,
    threads_of,
    unit_quaternions,
)
from pyharness.model.attitude import IDENTITY, rotated, scalar_first
from pyharness.model.codes import Methods, Places, Statuses
from pyharness.model.constant_body import uses_principal_axes
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, extension
from pyharness.model.principal import PrincipalScene, axes_and_turn
from pyharness.model.progress import for_each_piece
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

if TYPE_CHECKING:
    from pyharness.engine.solver import Solver

NO_PARAMETERS = np.empty((0, 0))
# The methods that the kernel for many bodies has.
_SIDE_BY_SIDE = (Methods.CLOSED_FORM, Methods.CLOSED_FORM_OR_TAYLOR, Methods.TAYLOR)


def many_starts(
    solver: "Solver[Any]", omega: Any, t_end: Any, *, threads: int = 1, out: Array | None = None
) -> tuple[Array, NDArray[np.int8]]:
    """Return final omegas (rad/s), (n, 3), and statuses, from n initial omegas."""
    starts, times = rows_of("omega", omega, 3), rows_of("t_end", t_end)
    n = len(starts)
    check_rows("t_end", times, n)
    omega = np.empty((n, 3)) if out is None else buffer_of("out", out, (n, 3), "d")
    if np.may_share_memory(starts, omega):  # a kernel may write results before it reads all
        starts = starts.copy()
    times = times_within(solver.scene, times)
    axes = axes_and_turn(solver.scene)[0] if uses_principal_axes(solver.scene) else None
    if axes is not None:
        starts = rotated(starts, axes.T)
    status = np.empty(n, np.int8)

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        own = times if len(times) == 1 else times[piece]
        extension().solve_packed_many(
            solver.packed, starts[piece].T, own, given_up, omega[piece].T, status[piece]
        )

    for_each_piece(enter, n, threads_of(threads))
    if axes is not None:
        omega[:] = rotated(omega, axes)
    return omega, status


def times_within(scene: Scene, times: Array) -> Array:
    """Return `times` (s), with NaN, which kernels refuse, beyond zeros of changing moments."""
    if scene.changing is None:
        return times
    first, last = scene.changing.span
    return np.where((first < times) & (times < last), times, np.nan)


def many_states(
    solver: "Solver[Any]", omega: Any, t_end: Any, attitude: Any = None, *, threads: int = 1,
    out: "Ensemble | Array | None" = None,
) -> tuple[Array, Array, NDArray[np.int8]]:  # fmt: skip
    """Return final omegas (rad/s), (n, 3), attitudes, (n, 4), and statuses."""
    usual = solver.scene.attitude or IDENTITY
    given = usual if attitude is None else scalar_first(attitude)
    starts, times = rows_of("omega", omega, 3), rows_of("t_end", t_end)
    n, turns = len(starts), rows_of("attitude", given, 4)
    check_rows("t_end", times, n)
    check_rows("attitude", turns, n)
    code = int(solver.packed[Places.METHOD])
    if code in _SIDE_BY_SIDE and not isinstance(solver.plan.scene, PrincipalScene):
        scene, (tolerance, _, effort) = solver.plan.scene, solver.settings
        own = {"omega": starts, "t_end": times, "attitude": turns}
        settings = code, tolerance, scene.step_size, effort
        found, *_ = solve_bodies(rows_of_scene(scene), own, settings, threads=threads, out=out)
    else:
        found = place_for(out, n, with_attitude=True)
        if out is not None:  # the starts may share memory with it
            starts, turns = starts.copy(), turns.copy()
        work = partial(solve_each, solver, starts, times, turns, found)
        for_each_piece(work, n, threads_of(threads))
    assert found.attitude is not None
    return found.omega, found.attitude, found.status


def solve_each(
    solver: "Solver[Any]", starts: Array, times: Array, turns: Array | None, found: Ensemble,
    piece: slice, given_up: NDArray[np.int32],
) -> None:  # fmt: skip
    """Solve the bodies in `piece`, and write their results to `found`.

    `turns` are the initial quaternions, if any.
    """
    left = list(range(piece.start, piece.stop))
    if solver.packed[Places.METHOD] == Methods.TAPE and solver.scene.inertia is None:
        own = times if solver.scene.changing is None else times_within(solver.scene, times)
        left = solve_lanes(solver.packed, NO_PARAMETERS, starts, own, turns, found, piece, given_up)
    # Some bodies' errors can't be measured side by side.
    for i in left:
        if given_up[0]:
            return
        solve_row(solver, i, starts, times, turns, found)


def solve_row(
    solver: "Solver[Any]", i: int, starts: Array, times: Array, turns: Array | None,
    found: Ensemble,
) -> None:  # fmt: skip
    start, time = row_of(starts, i), float(row_of(times, i))
    try:
        if turns is None or found.attitude is None:
            found.omega[i] = solver(start, time)
        else:
            found.omega[i], found.attitude[i] = solver(start, time, row_of(turns, i))
        found.status[i] = ENDS.index(solver.status)
        if found.estimates is not None:
            found.estimates[i] = np.array([solver.error, solver.growth], float)
    except InputError:
        found.omega[i], found.status[i] = np.nan, Statuses.REFUSED
        if found.attitude is not None:
            found.attitude[i] = np.nan
        if found.estimates is not None:
            found.estimates[i] = np.nan


def solve_lanes(
    packed: Array, parameters: Array, starts: Array, times: Array, turns: Array | None,
    found: Ensemble, piece: slice, given_up: NDArray[np.int32],
) -> list[int]:  # fmt: skip
    """Solve bodies side by side into `found`; return unsolved bodies' indices.

    The equations in `packed` use `parameters`, (n, k) or (1, k).
    """
    n = piece.stop - piece.start
    sets = parameters if len(parameters) < 2 else parameters[piece]
    first = last = np.empty((0, 4))
    if turns is not None:
        first, last = unit_quaternions(rows_within(turns, piece)), np.empty((n, 4))
    omega, status = np.empty((n, 3)), np.empty(n, np.int8)
    extension().tape_many(
        packed, rows_within(starts, piece).T, rows_within(times, piece), first.T, sets.T, given_up,
        omega.T, last.T, status,
        found.estimates_of(piece),
    )  # fmt: skip
    taken = status == Statuses.COMPLETE
    found.omega[piece][taken] = omega[taken]
    found.status[piece][taken] = Statuses.COMPLETE
    if found.attitude is not None:
        found.attitude[piece][taken] = last[taken]
    left: list[int] = (piece.start + np.flatnonzero(~taken)).tolist()
    return left
