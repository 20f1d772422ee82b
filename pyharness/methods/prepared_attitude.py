"""A scene prepared for calls that give the attitude beside omega."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Self

from pyharness.methods.last_call import LastCall
from pyharness.methods.packed import packed_scene
from pyharness.methods.plan import Plan, plan
from pyharness.methods.registry import check_attitude
from pyharness.model.attitude import IDENTITY, Quaternion, unit_quaternion
from pyharness.model.codes import Methods, Places
from pyharness.model.extension import extension
from pyharness.model.scene import Scene
from pyharness.model.values import number, three_floats

if TYPE_CHECKING:
    from pyharness._solver import BoundAttitudeKernel
else:
    try:
        from pyharness._solver import BoundAttitudeKernel
    except ImportError:  # not built, as `extension` says when a solver is made
        BoundAttitudeKernel = object


class AttitudeSolver(LastCall, BoundAttitudeKernel):
    """A scene prepared for one method, with attitude.

    Call it as ``solver(omega0, t_end)`` or ``solver(omega0, t_end, attitude0)``: `omega0` three
    numbers (rad/s), `t_end` in seconds on either side of 0, `attitude0` a quaternion, scalar first,
    from body to space, by default the scene's, or the axes of space. It returns omega, shape (3,),
    and the attitude, shape (4,), at `t_end`, both new; NaN where the kernel could not finish, and
    `status` says why. What is none of these is refused with an InputError. Fastest are arrays of
    floats, and an `attitude0` of length 1.

    Threads, copies and pickles are as with `Solver`.

    Attributes
    ----------
    plan : Plan
        What was decided, and why.
    """

    def __new__(cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0) -> Self:
        """Pack what does not change; `prepare` is the way to make one."""
        scene, code = chosen.scene, Methods.TAYLOR
        attitude = scene.attitude or IDENTITY
        if scene.torque.in_space:
            code = Methods.SPACE_TORQUE
        elif chosen.closed_form:
            code = Methods.CLOSED_FORM_OR_TAYLOR if chosen.fallback else Methods.CLOSED_FORM
        kernel = extension().solve_packed_attitude
        packed, packed_with_gil = packed_scene(scene, code, tolerance, effort), None
        if chosen.closed_form:  # without torque, so that it has no wave
            packed_with_gil = packed.copy()
            packed_with_gil[Places.METHOD] = Methods.CLOSED_FORM
        solver = super().__new__(
            cls, kernel, packed, partial(_check, attitude), packed_with_gil, attitude
        )
        solver.plan = chosen
        solver._given = tolerance, asked, effort
        return solver


def prepared_attitude(scene: Scene, method: str, tolerance: float, effort: float) -> AttitudeSolver:
    """Return a solver; InputError where the method carries no attitude."""
    return AttitudeSolver(attitude_plan(scene, method, tolerance), tolerance, method, effort)


def attitude_plan(scene: Scene, method: str, tolerance: float) -> Plan:
    """Return the plan of a scene with attitude; InputError where the method carries none."""
    check_attitude(method)
    return plan(replace(scene, attitude=scene.attitude or IDENTITY), method, tolerance, rows=True)


def _check(
    usual: Quaternion, omega0: object, t_end: object, attitude0: object
) -> tuple[tuple[float, ...], float]:
    """Convert what a call was given and can't read at once; InputError for what is none."""
    start, time = three_floats("omega0", omega0), number("t_end", t_end)
    attitude = usual if attitude0 is None else unit_quaternion("attitude0", attitude0)[0]
    return (*start, *attitude), time
