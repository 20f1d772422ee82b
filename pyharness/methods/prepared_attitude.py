"""A scene prepared for calls that give the attitude beside omega."""

from dataclasses import replace

import numpy as np

from pyharness.methods.plan import Plan, plan
from pyharness.methods.problem import known, series_kernel
from pyharness.methods.registry import REGISTRY
from pyharness.methods.sensitivity import closed_form_estimate, is_sensitive
from pyharness.model.attitude import IDENTITY, Quaternion, unit_quaternion
from pyharness.model.errors import InputError
from pyharness.model.extension import COMPLETE, ENDS, REFUSED, extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import WITH_ALL_ROWS, Array, digits_left
from pyharness.model.values import Number, Numbers, Triple, number, three_floats

_Told = tuple[str, float | None, float | None]  # status, error, growth


class AttitudeSolver:
    """A scene prepared for one method, with attitude.

    Call it as ``solver(omega0, t_end)`` or ``solver(omega0, t_end, attitude0)``: `omega0` three
    numbers (rad/s), `t_end` in seconds on either side of 0, `attitude0` a quaternion, scalar first,
    from body to space, by default the scene's, or the axes of space. It returns omega, shape (3,),
    and the attitude, shape (4,), at `t_end`; NaN where the kernel could not finish, and `status`
    says why. What is none of these is refused with an InputError.

    Attributes
    ----------
    plan : Plan
        What was decided, and why.
    steps : int
        Of the last call; 0 of a closed form.
    """

    def __init__(self, chosen: Plan, tolerance: float, effort: float) -> None:
        """Normalize what does not change; `prepare` is the way to make one."""
        self.plan = chosen
        self.steps = 0
        self._told: _Told = ("complete", None, None)
        # Start and time of a closed form, which says how good it is when it is asked.
        self._asked: tuple[Triple, float] | None = None
        self._tolerance, self._effort = tolerance, effort
        self._kernel, self._given = series_kernel(chosen.scene)

    @property
    def status(self) -> str:
        """How the last call ended: complete, sensitive, overflow, refused or gave up."""
        return self._settled()[0]

    @property
    def error(self) -> float | None:
        """Estimated error of omega over its largest on the way, or of the attitude's angle (rad).

        None where it is unknown.
        """
        return self._settled()[1]

    @property
    def growth(self) -> float | None:
        """What the motion of the last call made of a small difference; None where unknown."""
        return self._settled()[2]

    @property
    def digits(self) -> float | None:
        """Decimal digits that are left of the last result; None where unknown."""
        return digits_left(self.error)

    def __call__(
        self, omega0: Numbers, t_end: Number, attitude0: Numbers | None = None
    ) -> tuple[Array, Array]:
        """Return omega (rad/s) and attitude at `t_end` (s)."""
        start, time = three_floats("omega0", omega0), number("t_end", t_end)
        attitude = self.plan.scene.attitude or IDENTITY
        if attitude0 is not None:
            attitude, _ = unit_quaternion("attitude0", attitude0)
        self._asked = None
        if not np.isfinite([*start, time]).all():
            return self._nothing("overflow")
        found = None
        if self.plan.closed_form:
            found = self._by_form(start, attitude, time)
            if found is None and self.plan.fallback is None:
                return self._nothing("refused")
        return self._by_series(start, attitude, time) if found is None else found

    def _by_form(
        self, start: Triple, attitude: Quaternion, time: float
    ) -> tuple[Array, Array] | None:
        scene = self.plan.scene
        rows, attitudes, _, status = extension().torque_free_attitude_solution(
            scene.moments, start, attitude, [time]
        )
        if status == REFUSED:
            return None
        self.steps = 0
        if status != COMPLETE:
            return self._nothing(ENDS[status])
        self._asked = start, time
        return rows[:, 0], attitudes[:, 0]

    def _by_series(self, start: Triple, attitude: Quaternion, time: float) -> tuple[Array, Array]:
        joint = np.empty((4, 2), order="F")
        joint[:, 0] = attitude
        work = np.array([self._effort, 0.0, -1.0, -1.0, 0.0])
        rows, _, status, steps = getattr(extension(), self._kernel)(
            *self._given,
            start,
            [time],
            self._tolerance,
            n_attitudes=1,
            attitudes=joint,
            effort=work,
        )
        self.steps = steps
        if ENDS[status] not in WITH_ALL_ROWS:
            return self._nothing(ENDS[status])
        self._told = ENDS[status], known(work[2]), known(work[3])
        return rows[:, 0], joint[:, 1]

    def _nothing(self, status: str) -> tuple[Array, Array]:
        self._told = status, None, None
        return np.full(3, np.nan), np.full(4, np.nan)

    def _settled(self) -> _Told:
        if self._asked is not None:
            coefficients = self.plan.scene.euler_coefficients
            error, growth = closed_form_estimate(coefficients, *self._asked)
            sensitive = is_sensitive(growth, self._tolerance)
            self._told = "sensitive" if sensitive else "complete", error, growth
            self._asked = None
        return self._told


def prepared_attitude(scene: Scene, method: str, tolerance: float, effort: float) -> AttitudeSolver:
    """Return a solver; InputError where the method carries no attitude."""
    if not REGISTRY[method].attitude:
        able = ", ".join(each.name for each in REGISTRY.values() if each.attitude)
        raise InputError(f"method {method} carries no attitude; allowed: {able}")
    chosen = plan(replace(scene, attitude=scene.attitude or IDENTITY), method, tolerance, rows=True)
    return AttitudeSolver(chosen, tolerance, effort)
