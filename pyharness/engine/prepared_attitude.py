"""Prepared solvers whose calls return the attitude together with omega."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.last_call import LastCall
from pyharness.engine.many_attitudes import many_attitudes
from pyharness.engine.packed import packed_scene
from pyharness.engine.plan import Plan, plan
from pyharness.engine.registry import check_attitude
from pyharness.engine.system import is_recorded
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

    Call it as ``solver(omega0, t_end)`` or ``solver(omega0, t_end, attitude0)``: three numbers
    (rad/s), the final time (s), positive, negative or 0, and the initial quaternion from body to
    space, scalar first. By default it is the scene's, or (1, 0, 0, 0).

    A call returns two new arrays: omega (rad/s), shape (3,), and the attitude, shape (4,), at
    `t_end`. Both are NaN if the kernel could not finish; `status` has the reason. Invalid arguments
    raise an InputError. Calls are fastest with arrays of floats and a unit quaternion. Threads may
    share a solver; it can be copied and pickled.

    Attributes
    ----------
    plan : Plan
        The chosen method, and the parts that are computed, with reasons.
    many : callable
        A function that solves from many initial omegas and attitudes in one call.
    """

    _with_attitude = True
    packed: Array
    _code: int

    def __new__(cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0) -> Self:
        """Create a solver; users call `prepare` instead."""
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
        if chosen.closed_form:  # there is then no torque, whose waves could make a call slow
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

        ``solver.many(omega0, t_end, attitude0=None, threads=1, out=None)`` is as in `Solver`, with
        quaternions of shape (n, 4) or (4,). It returns omega (rad/s), attitudes and statuses; `out`
        may be an Ensemble, or an array for omega.
        """
        return partial(many_attitudes, self, self._code)

    @cached_property
    def packed_for_lanes(self) -> Array:
        """Return the array for the kernel of many bodies, with a torque in space recorded."""
        if self._code != Methods.SPACE_TORQUE:
            return self.packed
        scene, (tolerance, _, effort) = self.plan.scene, self._given
        try:
            recorded = replace(scene, torque=of_law(scene.law))
            return packed_scene(recorded, Methods.TAPE, tolerance, effort)
        except InputError:  # too many terms to be recorded
            return self.packed


def prepared_attitude(scene: Scene, method: str, tolerance: float, effort: float) -> AttitudeSolver:
    """Return a solver of omega and attitude; raise InputError if the method has no attitude."""
    return AttitudeSolver(attitude_plan(scene, method, tolerance), tolerance, method, effort)


def attitude_plan(scene: Scene, method: str, tolerance: float) -> Plan:
    """Return the plan for omega and attitude, or raise InputError if the method has none."""
    check_attitude(method)
    return plan(replace(scene, attitude=scene.attitude or IDENTITY), method, tolerance, rows=True)


def _check(
    usual: Quaternion, omega0: object, t_end: object, attitude0: object
) -> tuple[tuple[float, ...], float]:
    """Return omega with quaternion, and `t_end` (s), from arguments that C does not accept."""
    start, time = three_floats("omega0", omega0), number("t_end", t_end)
    attitude = usual if attitude0 is None else unit_quaternion("attitude0", attitude0)[0]
    return (*start, *attitude), time
