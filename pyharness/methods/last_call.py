"""The status of the last call of a prepared solver, and the error estimates of its result."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pyharness.methods.compiled_call import CompiledCall, compiled_call
from pyharness.methods.plan import Plan
from pyharness.methods.problem import known
from pyharness.methods.registry import GAUSS
from pyharness.methods.sensitivity import (
    closed_form_estimate,
    is_sensitive,
    motion_growth,
    torque_noise,
)
from pyharness.model.extension import ENDS
from pyharness.model.scene import Scene
from pyharness.model.trajectory import WITH_ALL_ROWS, Trajectory, digits_left
from pyharness.model.values import Number, Numbers, Triple, three


class LastCall:
    """The base class of all prepared solvers, which reports how the last call in a thread ended.

    A prepared solver, which the function `prepare` returns, solves one scene by one method, for
    many initial omegas. The reports are status, error estimate, error amplification and number of
    steps.
    """

    plan: Plan
    _given: tuple[float, str, float]  # requested tolerance, method, and factor on the work limit
    _with_attitude = False

    if TYPE_CHECKING:

        @property
        def _ending(self) -> tuple[int, int, float, float, Triple, float] | None: ...

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the arguments from which `copy` and `pickle` recreate the solver."""
        return type(self), (self.plan, *self._given)

    def __repr__(self) -> str:
        """Return a text that names the solver's class, its scene and its method."""
        return f"<{type(self).__name__} of '{self.plan.scene.name}' by {self.plan.method}>"

    @property
    def _scene_of_calls(self) -> Scene:
        """The scene about the axes to which the arguments and results of calls refer."""
        return self.plan.scene

    @property
    def ctypes(self) -> CompiledCall:
        """Return the solver as a function for compiled code, such as that of numba.

        The attribute `capsule` is the solver for code in C, with the header in the folder
        `pyharness.get_include()`.
        """
        return compiled_call(self)

    def trajectory(self, omega0: Numbers, times: Number | Numbers) -> Trajectory:
        """Return the trajectory from `omega0` (rad/s) at `times` (s), as `solve` computes it.

        `omega0` is the angular velocity at time 0. The times must be strictly monotonic; they may
        be positive and negative. A solver of the attitude starts from the attitude of the scene, or
        from (1, 0, 0, 0) if the scene has none. Raise InputError if `omega0` is not three finite
        numbers, or if the times are not strictly monotonic.
        """
        from pyharness.methods.registry import METHODS
        from pyharness.methods.solve import solve

        scene = replace(self._scene_of_calls, omega=three("omega0", omega0))
        tolerance, asked, effort = self._given
        method = "taylor" if asked == "quick" else asked
        # A method with a fixed step takes no tolerance. For such a method `solve` expects 1.
        tolerance = max(tolerance, METHODS[method].finest)
        return solve(scene, times, method, tolerance, effort=effort, attitude=self._with_attitude)

    @property
    def status(self) -> str:
        """Return how this thread's last call ended, as text.

        The texts are ``complete``, ``sensitive``, ``overflow``, ``refused`` and ``gave up``. The
        text ``gave up`` means that the work limit was exceeded, or that no correct digit of the
        motion's phase was left. The text ``refused`` means that the method does not apply to the
        arguments of the call. A ``sensitive`` call has a result, but rounding errors amplified by
        the motion exceed the solver's tolerance; `digits` is its number of correct digits. For a
        closed form and for Gauss collocation, whether a call was sensitive is computed when the
        status is read. This takes microseconds for a closed form, and milliseconds for Gauss
        collocation. Before the first call the status is ``complete``. A call that raised an
        InputError or was interrupted does not count.
        """
        return self._found()[0]

    @property
    def error(self) -> float | None:
        """Return the estimated error of this thread's last result.

        The error of omega is relative to the largest component of omega from 0 to the end. If the
        solver computes the attitude too, the estimate is the larger of two errors: that of omega
        and that of the attitude's angle (rad). The estimate is None if the method does not estimate
        its error, or if the call had no result.
        """
        return self._found()[1]

    @property
    def growth(self) -> float | None:
        """Return the error amplification of the motion of this thread's last call, at least 1.

        The error amplification is the largest norm of the state-transition matrices, the
        derivatives of omega at the end with respect to omega at any earlier time. The result is
        None if the method does not determine it, or if the call had no result.
        """
        return self._found()[2]

    @property
    def digits(self) -> float | None:
        """Return the number of correct decimal digits of this thread's last result.

        The number follows from the estimated error, and is None if the error is unknown.
        """
        return digits_left(self.error)

    @property
    def steps(self) -> int:
        """Return the number of steps of this thread's last call.

        For Gauss collocation the result is the number of evaluations of the right-hand side
        instead. For a closed form, and before the first call, it is 0.
        """
        return abs(self._counted())

    def _counted(self) -> int:
        """Return the number of steps of the last call, negative if the kernel chose `quick`.

        The method `quick` is a Runge-Kutta method for few digits. The kernel chooses between
        `quick` and the Taylor series only if the solver's attribute `plan` names the method `quick
        or taylor`.
        """
        ending = self._ending
        return 0 if ending is None else ending[1]

    def _found(self) -> tuple[str, float | None, float | None]:
        """Return the status of this thread's last call, its estimated error and its `growth`.

        `growth` is the error amplification of the motion. The error and `growth` are None if they
        are unknown.
        """
        ending = self._ending
        if ending is None:
            return "complete", None, None
        number, steps, of_kernel, grown, omega0, t_end = ending
        status = ENDS[number]
        if status not in WITH_ALL_ROWS:
            return status, None, None
        error, growth = known(of_kernel), known(grown)
        scene = self.plan.scene
        if self.plan.closed_form and not steps:
            noise = torque_noise(scene, omega0, t_end)
            error, growth = closed_form_estimate(scene, omega0, t_end, noise)
        elif self.plan.method in GAUSS:
            growth = motion_growth(replace(scene, omega=omega0), t_end)
            noise = torque_noise(scene, omega0, t_end, abs(t_end) / scene.step_size)
        else:
            return status, error, growth
        is_blurred = is_sensitive(growth, self._given[0], noise)
        return "sensitive" if is_blurred else status, error, growth
