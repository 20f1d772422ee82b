"""Prepared solvers whose calls return the attitude together with omega."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from pyharness.dynamics.system import is_recorded
from pyharness.methods.last_call import LastCall
from pyharness.methods.many_attitudes import many_attitudes
from pyharness.methods.packed import packed_scene
from pyharness.methods.plan import Plan, plan
from pyharness.methods.registry import check_attitude
from pyharness.model.attitude import IDENTITY, Quaternion, unit_quaternion
from pyharness.model.codes import Methods, Places
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.scene import Scene
from pyharness.model.state_torque import of_law
from pyharness.model.trajectory import Array
from pyharness.model.values import number, three_floats

if TYPE_CHECKING:
    from pyharness._solver import BoundAttitudeKernel
else:
    try:
        from pyharness._solver import BoundAttitudeKernel
    except ImportError:  # not built: `extension` raises NotBuiltError when a solver is made
        BoundAttitudeKernel = object


class AttitudeSolver(LastCall, BoundAttitudeKernel):
    """A solver of omega and attitude of a scene, prepared for one method.

    Call it as ``solver(omega0, t_end)`` or ``solver(omega0, t_end, attitude0)``. `omega0` is the
    initial angular velocity, three numbers (rad/s). `t_end` is the final time in seconds, positive,
    negative or 0. `attitude0` is the attitude at time 0, a quaternion from body to space, scalar
    first. By default it is the scene's attitude. If the scene has none, it is (1, 0, 0, 0), so that
    the body's axes are parallel to the axes of space at time 0.

    A call returns two new arrays: omega (rad/s), shape (3,), and the attitude, shape (4,), at
    `t_end`. If the kernel could not finish, both are NaN and `status` states the reason. An
    argument of another type or shape raises an InputError. Calls are fastest with arrays of floats
    and a unit quaternion. Threads may share a solver, and a solver can be copied and pickled.

    Attributes
    ----------
    plan : Plan
        The chosen method, and the parts of the computation that are carried out, with reasons.
    many : callable
        A function that solves the scene from many initial omegas and attitudes in one call.
    """

    _with_attitude = True
    packed: Array
    _code: int

    def __new__(cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0) -> Self:
        """Create a solver and pack the data that all calls share; users call `prepare` instead.

        `chosen` is the plan: the scene, and the chosen method. `tolerance` is the largest allowed
        error, relative to the largest |omega|. `asked` is the name of the requested method, such as
        `auto`. `effort` multiplies the work limit of a call.
        """
        scene, code = chosen.scene, Methods.TAYLOR
        attitude = scene.attitude or IDENTITY
        if is_recorded(scene):
            code = Methods.TAPE
        elif scene.torque.in_space:
            code = Methods.SPACE_TORQUE
        elif chosen.closed_form:
            code = Methods.CLOSED_FORM_OR_TAYLOR if chosen.fallback else Methods.CLOSED_FORM
        kernel = extension().solve_packed_attitude
        packed, packed_with_gil = packed_scene(scene, code, tolerance, effort), None
        if chosen.closed_form:  # then there is no torque, and no wave can make a call slow
            packed_with_gil = packed.copy()
            packed_with_gil[Places.METHOD] = Methods.CLOSED_FORM
        solver = super().__new__(
            cls, kernel, packed, partial(_check, attitude), packed_with_gil, attitude
        )
        solver.plan, solver.packed, solver._code = chosen, packed, code
        solver._given = tolerance, asked, effort
        return solver

    @cached_property
    def many(self) -> Callable[..., tuple[Array, Array, NDArray[np.int8]]]:
        """Return the function that solves many initial omegas and attitudes in one call.

        Call it as ``solver.many(omega0, t_end, attitude0=None, threads=1, out=None)``. `omega0`
        (rad/s) has shape (n, 3). `t_end` (s) is one number or has shape (n,). `attitude0` has shape
        (n, 4) or (4,), and by default it is the scene's attitude, as in a call of the solver. A
        call returns three arrays: omega at `t_end` (rad/s), shape (n, 3); the attitudes, shape (n,
        4); and the statuses, int8, shape (n,), with the values that `Ensemble` documents. They are
        written into the Ensemble or the array of omega that is passed as `out`, if it is not None.
        The result of a row does not depend on the other rows or on the number of threads. An
        argument of another type or shape raises an InputError.
        """
        return partial(many_attitudes, self, self._code)

    @cached_property
    def packed_for_lanes(self) -> Array:
        """Return the data of the scene for the kernel that solves several bodies side by side.

        This kernel takes recorded torques. A torque about the axes of space is therefore recorded
        as a function of time and attitude, unless it has too many terms.
        """
        if self._code != Methods.SPACE_TORQUE:
            return self.packed
        scene, (tolerance, _, effort) = self.plan.scene, self._given
        try:
            recorded = replace(scene, torque=of_law(scene.law))
            return packed_scene(recorded, Methods.TAPE, tolerance, effort)
        except InputError:
            return self.packed


def prepared_attitude(scene: Scene, method: str, tolerance: float, effort: float) -> AttitudeSolver:
    """Return a solver of omega and attitude, prepared for many calls with the same scene.

    `method` is a name in `pyharness.methods.solver.PREPARED`. `tolerance` limits the error of
    omega, relative to the largest |omega|, and the error of the attitude's angle (rad). `effort`
    multiplies the work limit of a call, some ten seconds. Raise InputError if the method can't
    propagate attitudes.
    """
    return AttitudeSolver(attitude_plan(scene, method, tolerance), tolerance, method, effort)


def attitude_plan(scene: Scene, method: str, tolerance: float) -> Plan:
    """Return the plan for omega and attitude of a scene: the method, and the computed parts.

    `method` is the name of the requested method, and `tolerance` is the largest allowed error,
    relative to the largest |omega|. If the scene has no attitude, its attitude at time 0 is (1, 0,
    0, 0). Raise InputError if the method can't propagate attitudes.
    """
    check_attitude(method)
    return plan(replace(scene, attitude=scene.attitude or IDENTITY), method, tolerance, rows=True)


def _check(
    usual: Quaternion, omega0: object, t_end: object, attitude0: object
) -> tuple[tuple[float, ...], float]:
    """Convert the arguments of a solver call if the C function can't read their types.

    Return two values. The first is a tuple of the three numbers of `omega0` (rad/s) and the four
    numbers of the initial quaternion. The second is `t_end` (s) as a float. The initial quaternion
    is `attitude0`, or `usual` if `attitude0` is None. Raise InputError for a wrong type or number
    of values.
    """
    start, time = three_floats("omega0", omega0), number("t_end", t_end)
    attitude = usual if attitude0 is None else unit_quaternion("attitude0", attitude0)[0]
    return (*start, *attitude), time
