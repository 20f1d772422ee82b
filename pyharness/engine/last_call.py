"""The status and error estimates of this thread's last call of a prepared solver.

Calls that raised an error or were interrupted do not count.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pyharness.engine.compiled_call import CompiledCall, compiled_call
from pyharness.engine.plan import Plan
from pyharness.engine.problem import estimate_or_none
from pyharness.engine.registry import GAUSS
from pyharness.engine.sensitivity import (
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
    """The base class of prepared solvers."""

    plan: Plan
    _given: tuple[float, str, float]  # requested tolerance, method, and factor on the work limit
    _with_attitude = False

    if TYPE_CHECKING:

        @property
        def _ending(self) -> tuple[int, int, float, float, Triple, float] | None: ...

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the arguments for `copy` and `pickle`."""
        return type(self), (self.plan, *self._given)

    def __repr__(self) -> str:
        """Return the solver's class, scene and method."""
        return f"<{type(self).__name__} of '{self.plan.scene.name}' by {self.plan.method}>"

    @property
    def _scene_of_calls(self) -> Scene:
        return self.plan.scene

    @property
    def ctypes(self) -> CompiledCall:
        """Return the solver for compiled code, such as numba's; C code uses `capsule`."""
        return compiled_call(self)

    def trajectory(self, omega0: Numbers, times: Number | Numbers) -> Trajectory:
        """Return the trajectory from `omega0` (rad/s) at `times` (s), as `solve` computes it."""
        from pyharness.engine.registry import METHODS
        from pyharness.engine.solve import solve

        scene = replace(self._scene_of_calls, omega=three("omega0", omega0))
        tolerance, asked, effort = self._given
        method = "taylor" if asked == "quick" else asked
        # `solve` expects the tolerance 1 for a method with a fixed step.
        tolerance = max(tolerance, METHODS[method].finest)
        return solve(scene, times, method, tolerance, effort=effort, attitude=self._with_attitude)

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
        return abs(self._counted())

    def _counted(self) -> int:
        """Return the steps of the last call, negative if the kernel chose `quick`."""
        ending = self._ending
        return 0 if ending is None else ending[1]

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
        elif self.plan.method in GAUSS:
            growth = motion_growth(replace(scene, omega=omega0), t_end)
            noise = torque_noise(scene, omega0, t_end, abs(t_end) / scene.step_size)
        else:
            return status, error, growth
        is_blurred = is_sensitive(growth, self._given[0], noise)
        return "sensitive" if is_blurred else status, error, growth
