"""Solution of a prepared scene from many initial states."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.prepared.many_laws import solve_bodies
from pyharness.engine.prepared.many_scenes import rows_of_scene
from pyharness.engine.prepared.many_tape import Bodies, Equations, solve_tape
from pyharness.model.arrays import buffer_of, check_rows, row_of, rows_of, threads_of
from pyharness.model.attitude import IDENTITY, rotated, scalar_first
from pyharness.model.codes import Methods, Places, Statuses
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, extension
from pyharness.model.principal import PrincipalScene
from pyharness.model.progress import for_each_piece
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

if TYPE_CHECKING:
    from pyharness.engine.prepared.solver import Solver

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
    axes = solver.turn and solver.turn[0]
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
        found = solve_bodies(rows_of_scene(scene), own, settings, threads=threads, out=out)
    else:
        found = place_for(out, n, with_attitude=True)
        if out is not None:  # the starts may share memory with it
            starts, turns = starts.copy(), turns.copy()
        bodies = Bodies(starts, times_within(solver.scene, times)[None], turns)
        work = partial(solve_with, solver, bodies, found.with_times(np.zeros(1)))
        for_each_piece(work, n, threads_of(threads))
    assert found.attitude is not None
    return found.omega, found.attitude, found.status


def solve_with(
    solver: "Solver[Any]", bodies: Bodies, found: Ensemble, piece: slice,
    given_up: NDArray[np.int32],
) -> int:  # fmt: skip
    """Solve the bodies in `piece` into `found`, whose arrays have an axis of times.

    Return how many were not solved side by side.
    """
    if solver.packed[Places.METHOD] == Methods.TAPE:
        equations = Equations(solver.packed, solver.packed, axes=solver.turn)
        return solve_tape(equations, bodies, found, piece, given_up)
    for i in range(piece.start, piece.stop):
        for row, times in enumerate(bodies.times):
            if given_up[0]:
                return 0
            _solve_row(solver, (i, row), bodies, float(row_of(times, i)), found)
    count: int = piece.stop - piece.start
    return count


def _solve_row(
    solver: "Solver[Any]", at: tuple[int, int], bodies: Bodies, time: float, found: Ensemble
) -> None:
    start = row_of(bodies.omega, at[0])
    try:
        if bodies.attitude is None or found.attitude is None:
            found.omega[at] = solver(start, time)
        else:
            turn = row_of(bodies.attitude, at[0])
            found.omega[at], found.attitude[at] = solver(start, time, turn)
        found.status[at] = ENDS.index(solver.status)
        if found.estimates is not None:
            found.estimates[at] = np.array([solver.error, solver.growth], float)
    except InputError:
        found.omega[at], found.status[at] = np.nan, Statuses.REFUSED
        for array in (found.attitude, found.estimates):
            if array is not None:
                array[at] = np.nan
