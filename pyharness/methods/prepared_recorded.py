"""Prepared solvers of scenes whose torque depends on the state."""

import math
import threading
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.methods.last_call import LastCall
from pyharness.methods.plan import Plan, plan
from pyharness.methods.prepared_inertia import axes_and_turn, rotated, turned_back
from pyharness.methods.recorded import kernel_tape, system
from pyharness.methods.registry import METHODS
from pyharness.methods.solve import solve
from pyharness.methods.solver import no_buffer
from pyharness.model.arrays import buffer_of, check_rows, rows_of, threads_of
from pyharness.model.attitude import IDENTITY, Quaternion, product, unit_quaternion
from pyharness.model.codes import Statuses
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.pieces import for_each_piece
from pyharness.model.principal import principal
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.model.values import Number, Numbers, Triple, number, three, three_floats

_WITH_RESULT = (Statuses.COMPLETE, Statuses.SENSITIVE)

# Status, steps, estimated error, error amplification, initial omega and final time of a call.
Ending = tuple[int, int, float, float, Triple, float]


class PreparedTape(LastCall):
    """The common part of the prepared solvers of scenes whose torque depends on the state.

    The equations of motion are recorded once, when the solver is made.
    """

    with_attitude = False

    def __init__(self, scene: Scene, method: str, tolerance: float, effort: float) -> None:
        """Record the equations of motion of `scene`; users call `prepare` instead.

        `method` is the name of the requested method. `tolerance` is the largest allowed error,
        relative to the largest |omega|. `effort` multiplies the work limit of a call. Raise
        InputError if the torque is opaque.
        """
        start = (scene.attitude or IDENTITY) if self.with_attitude else None
        self._scene = replace(scene, attitude=start)
        self._axes: Array | None = None
        self._turn: Quaternion = IDENTITY
        if scene.inertia is not None:
            self._axes, self._turn = axes_and_turn(scene)
        about_principal = principal(self._scene)[0]
        self.plan: Plan = plan(about_principal, method, tolerance)
        self._given = tolerance, method, effort
        self._tape = kernel_tape(system(about_principal))
        self._last = threading.local()

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the arguments from which `copy` and `pickle` recreate the solver."""
        tolerance, method, effort = self._given
        return type(self), (self._scene, method, tolerance, effort)

    @property
    def _ending(self) -> Ending | None:
        return getattr(self._last, "ending", None)

    @property
    def method(self) -> str:
        """Return the name of the method that solves the scene."""
        return self.plan.method

    def trajectory(self, omega0: Numbers, times: Number | Numbers) -> Trajectory:
        """Return the trajectory from `omega0` (rad/s) at `times` (s), as `solve` computes it.

        The times must be strictly monotonic; they may be positive and negative. Raise InputError if
        `omega0` is not three finite numbers, or if the times are not strictly monotonic.
        """
        tolerance, method, effort = self._given
        scene = replace(self._scene, omega=three("omega0", omega0))
        tolerance = max(tolerance, METHODS[method].finest)
        return solve(scene, times, method, tolerance, effort=effort, attitude=self.with_attitude)

    def _solved(
        self, omega0: Any, t_end: float, attitude: Quaternion | None
    ) -> tuple[Array, Array, Ending]:
        """Return omega (rad/s), the attitude, and the report of a call."""
        first, second, third = omega0
        start = (first, second, third)
        q = attitude or self._scene.attitude or IDENTITY
        given: Any = start
        if self._axes is not None:
            given, q = rotated(np.array(start), self._axes.T), product(q, self._turn)
        joint = np.empty((4, 2 if self.with_attitude else 1), order="F")
        joint[:, 0] = q
        tolerance, _, effort = self._given
        work = np.array([effort, 0.0, -1.0, -1.0, 0.0])
        nothing = np.full(3, math.nan), np.full(4, math.nan)
        if not all(map(math.isfinite, (*start, *q, t_end))):
            return *nothing, (Statuses.REFUSED, 0, -1.0, -1.0, start, t_end)
        rows, _, status, steps = extension().tape_rows(
            *self._tape, given, [t_end], tolerance, joint, work
        )
        ending = int(status), int(steps), float(work[2]), float(work[3]), start, t_end
        if status not in _WITH_RESULT:
            return *nothing, ending
        omega, found = rows[:, 0], joint[:, -1]
        if self._axes is not None:
            omega = rotated(omega, self._axes)
            found = turned_back(found, self._turn)
        return omega, found.copy(), ending


class RecordedSolver(PreparedTape):
    """A solver, made by `prepare`, of one scene whose torque depends on the state.

    It is called in the same way as a `Solver`. If the scene has a full inertia matrix, omegas are
    about the axes of the matrix.
    """

    def __call__(self, omega0: Numbers, t_end: Number, *, out: Array | None = None) -> Array:
        """Return omega (rad/s) at `t_end` (s), shape (3,).

        `omega0` is the initial omega (rad/s). If the keyword argument `out`, an array of three
        floats, is not None, the result is written into it and `out` is returned. Raise InputError
        for an argument of another type or shape.
        """
        start = three_floats("omega0", omega0)
        if out is not None and (found := no_buffer(out)):
            raise InputError(
                f"out: {found}; allowed: a writable array of three float64 side by side"
            )
        omega, _, self._last.ending = self._solved(start, number("t_end", t_end), None)
        if out is None:
            return omega
        out[:] = omega
        return out

    def many(
        self, omega0: Any, t_end: Any, *, threads: int = 1, out: Array | None = None
    ) -> tuple[Array, NDArray[np.int8]]:
        """Return omega (rad/s) at `t_end` (s) from n initial omegas, shape (n, 3), and n statuses.

        `omega0` (rad/s) has shape (n, 3), and `t_end` is one number or has shape (n,). The result
        is written into `out` if that is not None. The statuses are those of `Ensemble`. A body that
        could not be solved is NaN. Each result is bit-for-bit identical to that of a single call,
        for any number of threads. Raise InputError for an argument of another type or shape.
        """
        starts, times = rows_of("omega0", omega0, 3), rows_of("t_end", t_end)
        n = len(starts)
        check_rows("t_end", times, n)
        omega = np.empty((n, 3)) if out is None else buffer_of("out", out, (n, 3), "d")
        status = np.empty(n, np.int8)

        def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
            for i in range(piece.start, piece.stop):
                if given_up[0]:
                    return
                time = float(times[i if len(times) > 1 else 0])
                omega[i], _, (status[i], *_) = self._solved(starts[i].tolist(), time, None)

        for_each_piece(enter, n, threads_of(threads))
        return omega, status


class RecordedAttitudeSolver(PreparedTape):
    """A solver, made by `prepare`, of omega and attitude under a torque that depends on the state.

    It is called in the same way as an `AttitudeSolver`. If the scene has a full inertia matrix,
    omegas are about the axes of the matrix, and attitudes rotate from these axes to space.
    """

    with_attitude = True

    def __call__(
        self, omega0: Numbers, t_end: Number, attitude0: Numbers | None = None
    ) -> tuple[Array, Array]:
        """Return omega (rad/s), shape (3,), and the attitude, shape (4,), at `t_end` (s).

        `omega0` is the initial omega (rad/s), and `attitude0` the initial quaternion from body to
        space, scalar first. By default it is the scene's, or (1, 0, 0, 0) if the scene has none.
        Raise InputError for an argument of another type or shape.
        """
        start, time = three_floats("omega0", omega0), number("t_end", t_end)
        attitude = None if attitude0 is None else unit_quaternion("attitude0", attitude0)[0]
        omega, found, self._last.ending = self._solved(start, time, attitude)
        return omega, found
