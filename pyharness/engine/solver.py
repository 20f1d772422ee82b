"""The class `Solver`: a scene prepared for one method, for many fast calls through C."""

import math
import reprlib
from dataclasses import replace
from functools import cached_property, partial
from types import GenericAlias
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from pyharness.engine.compiled_call import CompiledCall, compiled_call
from pyharness.engine.many_prepared import many_starts, many_states
from pyharness.engine.plan import RK4_OR_TAYLOR, Plan
from pyharness.engine.problem import estimate_or_none
from pyharness.engine.recorded import packed_scene
from pyharness.engine.registry import FIXED_STEP, GAUSS
from pyharness.engine.sensitivity import (
    closed_form_estimate,
    growth_of_rounding,
    is_sensitive,
    motion_growth,
    torque_noise,
)
from pyharness.engine.system import is_recorded
from pyharness.model.attitude import IDENTITY, unit_quaternion
from pyharness.model.codes import Methods, Places
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, extension
from pyharness.model.principal import axes_and_turn
from pyharness.model.scene import Scene
from pyharness.model.state_torque import of_law
from pyharness.model.trajectory import WITH_ALL_ROWS, Array, Trajectory, digits_left
from pyharness.model.values import Number, Numbers, number, three, three_floats

if TYPE_CHECKING:
    from pyharness._solver import BoundKernel, Result
else:
    Result = TypeVar("Result")
    try:
        from pyharness._solver import BoundKernel
    except ImportError:  # not built: `extension` raises NotBuiltError when a solver is made

        class BoundKernel:  # noqa: D101
            __class_getitem__ = classmethod(GenericAlias)


CODES = {
    "closed-form": Methods.CLOSED_FORM,
    "sphere": Methods.SPHERE,
    RK4_OR_TAYLOR: Methods.QUICK_OR_TAYLOR,
    "taylor": Methods.TAYLOR,
    **{name: getattr(Methods, name.upper().replace("-", "_")) for name in FIXED_STEP},
    "quick": Methods.QUICK,
    **{f"gauss-{stages}": Methods.GAUSS + stages for stages in range(1, 9)},
}
PREPARED = ("auto", *(name for name in CODES if name not in ("sphere", RK4_OR_TAYLOR)))

_FEW_WAVES = 16  # fewer waves take less time than releasing the GIL


class Solver(BoundKernel[Result]):
    """A solver of a scene, prepared for one method by `prepare`.

    Call it as ``solver(omega, t_end)`` or ``solver(omega, t_end, out=out)``: three numbers
    (rad/s), and the final time (s), positive, negative or 0. A call returns omega (rad/s) at
    `t_end` as a new array of shape (3,), or in `out`, a contiguous array of three floats, which may
    be `omega`.

    A solver prepared with ``attitude=True`` is called as ``solver(omega, t_end, attitude)``, with
    the initial quaternion from body to space, scalar first; by default it is the scene's, or
    (1, 0, 0, 0). It returns omega and the quaternion at `t_end`, shape (4,), as new arrays.

    Invalid arguments raise an InputError and leave `out` unchanged. Calls are fastest with arrays
    of floats and a unit quaternion. If the kernel could not finish, or an argument is not finite,
    the result is NaN and `status` has the reason.

    Threads may share a solver. The kernel releases the interpreter's lock (GIL), unless the
    solution takes less time than releasing it. Solvers can be copied and pickled, without the
    status of the last call.

    Attributes
    ----------
    scene : Scene
        The prepared scene.
    plan : Plan
        The chosen method, and the parts that are computed, with reasons; about principal axes.
    status, error, growth, digits, steps, method
        Reports on this thread's last call, unless it raised an error.
    many : callable
        A function that solves from many initial states in one call.

    Examples
    --------
    >>> from pyharness import case_scene, prepare
    >>> solver = prepare(case_scene(1))
    >>> solver([1.0, 1.0, 1.0], 2.0)
    array([6., 6., 6.])
    >>> solver.status
    'complete'
    """

    scene: Scene
    plan: Plan
    with_attitude: bool
    packed: Array
    _packed_with_gil: Array | None
    settings: tuple[float, str, float]  # requested tolerance, method, and factor on the work limit

    # The base class binds a kernel to its data in C, because Python code in a call would take as
    # long as an easy solution.
    def __new__(
        cls, scene: Scene, chosen: Plan, tolerance: float, asked: str, effort: float,
        with_attitude: bool,
    ) -> Self:  # fmt: skip
        """Create a solver; users call `prepare` instead."""
        entry = extension()
        kernel = entry.solve_packed_attitude if with_attitude else entry.solve_packed
        packed = packed_scene(chosen.scene, _code(chosen, with_attitude), tolerance, effort)
        packed_with_gil = None
        if chosen.closed_form and packed.size < Places.WAVES + 4 * _FEW_WAVES:
            # The call that keeps the GIL has no fallback, which may take long. If it fails, the
            # kernel is called again without the GIL.
            packed_with_gil = packed.copy()
            is_sphere = chosen.closed_form == "sphere" and not with_attitude
            packed_with_gil[Places.METHOD] = CODES["sphere" if is_sphere else "closed-form"]
        axes = None
        if scene.inertia is not None:
            columns, turn = axes_and_turn(scene)
            axes = tuple(columns), turn
        solver = super().__new__(
            cls, kernel, packed, partial(_check, scene, with_attitude), packed_with_gil,
            (scene.attitude or IDENTITY) if with_attitude else None,
            scene.changing.span if scene.changing else (-math.inf, math.inf), axes,
        )  # fmt: skip
        solver.scene, solver.plan, solver.with_attitude = scene, chosen, with_attitude
        solver.packed, solver._packed_with_gil = packed, packed_with_gil
        solver.settings = tolerance, asked, effort
        return solver

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the arguments for `copy` and `pickle`."""
        return type(self), (self.scene, self.plan, *self.settings, self.with_attitude)

    def __repr__(self) -> str:
        """Return the solver's class, scene and method."""
        return f"<{type(self).__name__} of '{self.scene.name}' by {self.plan.method}>"

    @cached_property
    def many(self) -> Any:
        """Return the function that solves many initial states in one call.

        ``solver.many(omega, t_end, threads=1, out=None)`` takes `omega` (rad/s) of shape (n, 3),
        and `t_end` (s), a number or of shape (n,). It returns omega (rad/s), shape (n, 3), in `out`
        unless None, and the statuses of `Ensemble`, int8, shape (n,). A row does not depend on the
        others or on `threads`, but may differ by rounding from a single call. Invalid arguments
        raise an InputError; a body whose moment reaches 0 before `t_end` is REFUSED.

        With attitude it is ``solver.many(omega, t_end, attitude=None, threads=1, out=None)``,
        with quaternions of shape (n, 4) or (4,), and returns omega, attitudes and statuses; `out`
        may be an Ensemble, or an array for omega.
        """
        if self.with_attitude:
            return partial(many_states, self)
        slowly = partial(many_starts, self)
        if self.scene.inertia is not None or self.scene.changing is not None:
            return slowly
        from pyharness._many import ManyStarts

        return ManyStarts(extension().solve_packed_many, self.packed, self._packed_with_gil, slowly)

    @cached_property
    def packed_for_lanes(self) -> Array:
        """Return the array for the kernel of many bodies, with a torque in space recorded."""
        if self.packed[Places.METHOD] != Methods.SPACE_TORQUE:
            return self.packed
        scene, (tolerance, _, effort) = self.plan.scene, self.settings
        try:
            recorded = replace(scene, torque=of_law(scene.law))
            return packed_scene(recorded, Methods.TAPE, tolerance, effort)
        except InputError:  # too many terms to be recorded
            return self.packed

    @property
    def ctypes(self) -> CompiledCall:
        """Return the solver for compiled code, such as numba's; C code uses `capsule`."""
        return compiled_call(self)

    def trajectory(self, omega: Numbers, times: Number | Numbers) -> Trajectory:
        """Return the trajectory from `omega` (rad/s) at `times` (s), as `solve` computes it."""
        from pyharness.engine.registry import METHODS
        from pyharness.engine.solve import solve

        scene = replace(self.scene, omega=three("omega", omega))
        tolerance, asked, effort = self.settings
        method = "taylor" if asked == "quick" else asked
        # `solve` expects the tolerance 1 for a method with a fixed step.
        tolerance = max(tolerance, METHODS[method].finest)
        return solve(scene, times, method, tolerance, effort=effort, attitude=self.with_attitude)

    @property
    def method(self) -> str:
        """Return the name of the method of the last call.

        It is `plan.method`, unless the kernel chose `quick` or `taylor`, or used `plan.fallback`.
        """
        steps = 0 if self._ending is None else self._ending[1]  # negative if it chose `quick`
        if not steps:
            return self.plan.method
        if self.plan.method == RK4_OR_TAYLOR:
            return "quick" if steps < 0 else "taylor"
        return self.plan.fallback or self.plan.method

    @property
    def status(self) -> str:
        """Return how the last call ended; ``complete`` before the first.

        It is ``gave up`` if the work limit was exceeded or the phase has no correct digit left, and
        ``refused`` if the method does not apply. It is ``sensitive`` if amplified rounding errors
        exceed the tolerance. The test for ``sensitive`` takes microseconds for a closed form,
        milliseconds for Gauss collocation.
        """
        return self._judge()[0]

    @property
    def error(self) -> float | None:
        """Return the estimated error of the last result (relative, or rad), or None if unknown."""
        return self._judge()[1]

    @property
    def growth(self) -> float | None:
        """Return the error amplification of the last motion, or None, as in `Trajectory`."""
        return self._judge()[2]

    @property
    def digits(self) -> float | None:
        """Return the number of correct decimal digits of the last result, or None."""
        return digits_left(self.error)

    @property
    def steps(self) -> int:
        """Return the steps of the last call; for Gauss collocation, its right-hand sides."""
        return 0 if self._ending is None else abs(self._ending[1])

    def _judge(self) -> tuple[str, float | None, float | None]:
        ending = self._ending
        if ending is None:
            return "complete", None, None
        number, steps, of_kernel, grown, omega0, t_end = ending
        status = ENDS[number]
        if status not in WITH_ALL_ROWS:
            return status, None, None
        error, growth = estimate_or_none(of_kernel), estimate_or_none(grown)
        scene = self.plan.scene
        if self.plan.closed_form and not steps:
            noise = torque_noise(scene, omega0, t_end)
            error, growth = closed_form_estimate(scene, omega0, t_end, noise)
            amplified = growth_of_rounding(scene, growth)
        elif self.plan.method in GAUSS:
            growth = motion_growth(replace(scene, omega=omega0), t_end)
            amplified = growth
            noise = torque_noise(scene, omega0, t_end, abs(t_end) / scene.step_size)
        else:
            return status, error, growth
        is_blurred = is_sensitive(amplified, self.settings[0], noise)
        return "sensitive" if is_blurred else status, error, growth


def _check(
    scene: Scene, with_attitude: bool, omega0: object, t_end: object, third: object
) -> tuple[tuple[float, ...], float]:
    """Return a start and `t_end` (s) from arguments that C does not accept."""
    start, time = three_floats("omega", omega0), number("t_end", t_end)
    if scene.changing is not None and math.isfinite(time):
        scene.changing.check([time])
    if with_attitude:
        usual = scene.attitude or IDENTITY
        return (*start, *(usual if third is None else unit_quaternion("attitude", third)[0])), time
    if third is not None and (found := no_buffer(third)):
        raise InputError(f"out: {found}; allowed: a writable array of three float64 side by side")
    return start, time


def no_buffer(out: object) -> str:
    """Return a description of `out` if three floats can't be written into it, else ""."""
    if not isinstance(out, np.ndarray):
        try:
            return reprlib.repr(out)
        except ValueError:  # Python refuses to print an integer of too many digits
            return "a number of too many digits to be shown"
    flags = out.flags
    if out.dtype.char != "d" or not out.dtype.isnative or out.shape != (3,):
        return f"{out.dtype} of shape {out.shape}"
    if not flags.writeable:
        return "an array that is read-only"
    return "" if flags.c_contiguous and flags.aligned else f"an array with strides {out.strides}"


def _code(chosen: Plan, with_attitude: bool) -> int:
    if is_recorded(chosen.scene):
        return Methods.TAPE
    if with_attitude and chosen.scene.torque.in_space:
        return Methods.SPACE_TORQUE
    if chosen.closed_form == "sphere" and not with_attitude:
        return CODES["sphere"]
    if chosen.method == "closed-form" or (with_attitude and chosen.closed_form):
        # The closed form refuses a perturbation whose square underflows. The kernel then uses the
        # Taylor series, unless the closed form was requested.
        return Methods.CLOSED_FORM_OR_TAYLOR if chosen.fallback else CODES["closed-form"]
    return CODES[chosen.method]
