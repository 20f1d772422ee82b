"""How a prepared solver's last call ended, and how good its result is."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

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
from pyharness.model.trajectory import WITH_ALL_ROWS, digits_left
from pyharness.model.values import Triple


class LastCall:
    """What a solver, with attitude or without, says of this thread's last call."""

    plan: Plan
    _given: tuple[float, str, float]  # tolerance, method and effort as asked for

    if TYPE_CHECKING:

        @property
        def _ending(self) -> tuple[int, int, float, float, Triple, float] | None: ...

    def __reduce__(self) -> tuple[Any, ...]:
        """Let a copy, in this process or another, be prepared as this one was."""
        return type(self), (self.plan, *self._given)

    def __repr__(self) -> str:
        """Say the scene and the method."""
        return f"<{type(self).__name__} of '{self.plan.scene.name}' by {self.plan.method}>"

    @property
    def status(self) -> str:
        """How this thread's last call ended: complete, sensitive, overflow, refused or gave up.

        ``sensitive`` is a result too, but what the motion makes of rounding exceeds the tolerance:
        `digits` says what is left. A closed form and Gauss collocation work that out when they are
        asked, in microseconds and milliseconds. ``complete``, in 0 steps, before a call. What was
        refused at the door, or interrupted, is none.
        """
        return self._found()[0]

    @property
    def error(self) -> float | None:
        """Estimated error of this thread's last result, over the largest omega on the way.

        With attitude the larger of that and of the angle's (rad). None where the method estimates
        none, and where there is no result.
        """
        return self._found()[1]

    @property
    def growth(self) -> float | None:
        """What the motion of this thread's last call makes of a small difference, at least 1.

        The largest norm of the derivative of omega at the end by omega at any time before; None
        where it is unknown.
        """
        return self._found()[2]

    @property
    def digits(self) -> float | None:
        """Decimal digits that are left of this thread's last result; None where unknown."""
        return digits_left(self.error)

    @property
    def steps(self) -> int:
        """Steps of this thread's last call; right-hand sides of Gauss, 0 of a closed form."""
        return abs(self._counted())

    def _counted(self) -> int:
        """Return the steps of this thread's last call, as the kernel counts them."""
        ending = self._ending
        return 0 if ending is None else ending[1]

    def _found(self) -> tuple[str, float | None, float | None]:
        """Return status, error and growth of this thread's last call."""
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
