"""Integration step by step, while the user changes torque or state."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval

from pyharness.engine.system.recorded import LONGEST_TRIAL, Step, kernel_tape, taylor_step
from pyharness.engine.system.singular import SingularError, undefined_operation
from pyharness.model.array_type import Maybe
from pyharness.model.attitude import IDENTITY, quaternion_rates, unit_quaternion
from pyharness.model.changing import rates_of_changing
from pyharness.model.constant_body import rates_about_body_axes
from pyharness.model.errors import InputError
from pyharness.model.keywords import with_hints
from pyharness.model.scene import Scene, any_scene
from pyharness.model.state_torque import StateTorque, of_law, torque_of
from pyharness.model.symbols import MOST_OPERATIONS, Recorder
from pyharness.model.tape import Tape, float_outputs
from pyharness.model.trajectory import Array
from pyharness.model.values import boolean, finite, number, three_floats, tolerance_of

FINEST = 1e-14  # smallest tolerance of a step
_DEFAULT = 1e-9
_MOST_GUESSES = 8  # of the omega or state that a step from rest reaches
# Names that users of SciPy or heyoka may expect.
_INSTEAD = {
    **dict.fromkeys(("propagate_until", "propagate_for", "integrate"), "until(time)"),
    **dict.fromkeys(("state", "y", "w"), "omega, attitude or states"), "t": "time",
}  # fmt: skip
_MOST, _LOOK = 1e8, 100_000  # most steps of `until`, and steps between its forecasts


class Stepper:
    """A motion that is computed step by step by Taylor series.

    Use it if a controller or an impact changes torque or omega between steps. Otherwise
    `pyharness.solve` is faster, and estimates the error of its result.

    Parameters
    ----------
    scene : Scene
        The body, its torque and its state at time 0. The torque must not be opaque.
    tolerance : float, optional
        The largest allowed error of a step. It is relative to the largest |omega| so far for omega,
        and to the largest absolute value so far for an own state; for the attitude, it is an angle
        (rad). Default is 1e-9.
    attitude : bool, optional
        Whether the attitude is computed, as in `pyharness.solve`.

    Attributes
    ----------
    time : float
        The time (s); at first `Scene.t0`.
    omega : ndarray, shape (3,)
        The angular velocity (rad/s). It may be set.
    attitude : ndarray, shape (4,), or None
        The quaternion from body to space, scalar first. It may be set.
    states : dict of str to float
        The scene's own states (`Scene.states`). A dict of some or all may be set.
    held_torque : ndarray, shape (3,)
        A torque about the body axes, added to the scene's torque, in N m; for a body given by
        coefficients, torque over moment in rad/s2. It is 0 at first, and remains until set again,
        even with another scene.
    scene : Scene
        The scene. If another scene is set, time, omega, attitude and states are kept.
    steps : int
        The number of steps so far.

    Raises
    ------
    InputError
        If the scene can't be computed step by step, or an argument is out of range.

    Examples
    --------
    A brake reduces a speed of 2 rad/s, until it is 1 rad/s:

    >>> from pyharness import Scene, Stepper
    >>> wheel = Stepper(Scene("wheel", (0.0, 0.0, 2.0), moments=(1.0, 1.0, 2.0)))
    >>> wheel.held_torque = (0.0, 0.0, -0.5)
    >>> while wheel.omega[2] > 1.0 + 1e-6:
    ...     _ = wheel.until(wheel.time + 0.25)
    >>> wheel.held_torque = (0.0, 0.0, 0.0)
    >>> wheel.until(10.0)
    10.0
    >>> wheel.omega.round(6)
    array([0., 0., 1.])
    """

    # With slots, setting another name, such as `torque`, is an error.
    __slots__ = (
        "_begin", "_largest", "_last", "_n", "_origin", "_own_sizes", "_packed",
        "_scene", "_state", "_steps", "_tape", "_time", "_tolerance", "_trial",
    )  # fmt: skip

    @with_hints
    def __init__(
        self, scene: Scene, tolerance: float = _DEFAULT, *, attitude: bool | None = None
    ) -> None:
        self._time = self._begin = any_scene(scene).t0
        wants = scene.has_attitude
        attitude = wants if attitude is None else boolean("attitude", attitude)
        self._steps = 0
        self._tolerance = tolerance_of(tolerance, FINEST)
        if not FINEST <= self._tolerance <= 1.0:
            raise InputError(f"tolerance is {self._tolerance:g}; allowed: {FINEST:g} to 1")
        self._n = 7 if attitude else 3
        self.scene = scene
        own = [each.start for each in scene.states]
        self._own_sizes = np.array([each.scale for each in scene.states])
        self._state = np.array([0.0] * self._n + own + [0.0] * 3)
        self._state[:3] = scene.omega
        if attitude:
            self._state[3:7] = unit_quaternion("attitude", scene.attitude or IDENTITY)[0]
        self._origin = [self._time, *self._state.tolist()]
        self._trial, self._largest = LONGEST_TRIAL, 0.0
        self._last = Step(0.0, 0.0, self._state[None], self._state)

    def __getattr__(self, name: str) -> Any:
        instead = _INSTEAD.get(name)
        hint = f"; write {instead}" if instead else ""
        raise AttributeError(f"a Stepper has no attribute '{name}'{hint}", name=name, obj=self)

    def __repr__(self) -> str:
        steps = f"{self._steps} step{'' if self._steps == 1 else 's'}"
        return f"<Stepper of '{self._scene.name}' at t = {self._time:g} s after {steps}>"

    @property
    def time(self) -> float:
        """The time (s)."""
        return self._time

    @property
    def steps(self) -> int:
        """The number of steps so far."""
        return self._steps

    @property
    def scene(self) -> Scene:
        """The scene, with the state at time 0."""
        return self._scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        any_scene(scene)
        torque = scene.torque if isinstance(scene.torque, StateTorque) else of_law(scene.torque)
        if torque.tape is None:
            raise InputError(
                "an opaque torque can't be computed step by step; allowed: a torque that can be "
                "recorded, or held_torque"
            )
        if torque.needs_attitude and self._n == 3:
            raise InputError("the torque depends on the attitude; give attitude=True")
        names = [each.name for each in scene.states]
        if hasattr(self, "_scene") and names != list(self.states):
            raise InputError(
                f"the scene has the states {names}; allowed: those of the first scene, "
                f"{list(self.states)}"
            )
        self._tape = _equations(scene, torque.tape, self._n)
        self._packed = kernel_tape(self._tape)
        self._scene = scene

    @property
    def omega(self) -> Array:
        """The angular velocity (rad/s), shape (3,)."""
        return _copy_fixed(self._state[:3])

    @omega.setter
    def omega(self, values: Sequence[float] | Array) -> None:
        self._set(slice(0, 3), _check_three("omega", values))

    @property
    def attitude(self) -> Maybe[Array]:
        """The quaternion from body to space, scalar first, shape (4,), or None."""
        return _copy_fixed(self._state[3:7]) if self._n == 7 else None

    @attitude.setter
    def attitude(self, values: Sequence[float] | Array) -> None:
        if self._n == 3:
            raise InputError("attitude is not computed; allowed: Stepper(scene, attitude=True)")
        self._set(slice(3, 7), unit_quaternion("attitude", values)[0])

    @property
    def states(self) -> Mapping[str, float]:
        """The scene's own states by name; assign a dict of some or all to change them."""
        names = (each.name for each in self._scene.states)
        own = self._state[self._n : -3].tolist()
        return MappingProxyType(dict(zip(names, own, strict=True)))

    @states.setter
    def states(self, values: Mapping[str, float]) -> None:
        found = dict(self.states)
        if not isinstance(values, Mapping) or not set(values) <= set(found):
            allowed = ", ".join(found) or "none: the scene has no states of its own"
            raise InputError(f"states: {values!r}; allowed: a dict of {allowed}")
        found |= {name: finite(f"states: {name}", each) for name, each in values.items()}
        self._set(slice(self._n, -3), list(found.values()))

    @property
    def held_torque(self) -> Array:
        """The torque added to the torque of the scene (N m or rad/s2), shape (3,)."""
        return _copy_fixed(self._state[-3:])

    @held_torque.setter
    def held_torque(self, values: Sequence[float] | Array) -> None:
        self._set(slice(-3, None), _check_three("held_torque", values))

    def step(self, longest: float = math.inf) -> float:
        """Take the longest step that the tolerance allows, and return the new time (s).

        `longest` limits the step (s); if negative, the step leads back in time. Steps end where a
        table of the torque changes. Raise InputError for an unsuitable `longest`, or at a
        singularity.
        """
        longest = number("longest", longest)
        end = self._time + longest
        if not abs(end - self._time) > 0.0:
            least = 0.5 * math.ulp(self._time)
            raise InputError(
                f"longest is {longest:g} s; allowed: a positive or negative number, larger than "
                f"{least:g} at this time"
            )
        return self._advance(end)

    def _advance(self, end: float) -> float:
        taken = self._take_step(end)
        self._begin, self._last = self._time, taken
        self._trial, self._time = taken.next_trial(self._trial), taken.time
        self._state = taken.state.copy()
        self._state[3 : self._n] = _normalised(self._state[3 : self._n])
        self._largest = max(self._largest, float(np.abs(self._state[:3]).max()))
        self._steps += 1
        return self._time

    def _take_step(self, end: float) -> Step:
        self._largest = max(self._largest, float(np.abs(self._state[:3]).max()))
        # For a body at rest, a guess of the omega that it reaches.
        scale = self._largest or math.sqrt(np.abs(self._rates()[:3]).max()) or 1.0
        # Errors of own states are relative to these sizes; a state that is 0 so far has a guess.
        sizes = own_sizes = np.maximum(self._own_sizes, np.abs(self._state[self._n : -3]))
        self._own_sizes = own_sizes
        if not own_sizes.all():
            rates = np.abs(self._rates()[self._n : -3])
            guess = rates * min(abs(end - self._time), self._trial, 1.0 / scale)
            sizes = np.where(own_sizes > 0.0, own_sizes, np.where(rates > 0.0, guess, math.inf))
        guesses = 0
        while True:
            tolerances = np.full(len(self._state), math.inf)
            tolerances[:3] = self._tolerance * scale
            tolerances[3 : self._n] = 0.5 * self._tolerance
            tolerances[self._n : -3] = self._tolerance * sizes
            taken = taylor_step(
                self._packed, self._time, self._state, tolerances, self._tolerance, self._trial, end
            )
            if taken.h == 0.0:
                before = [self._begin, *self._last.terms[0].tolist()]
                here = [self._time, *self._state.tolist()]
                what = undefined_operation(self._tape, self._origin, before, here)
                raise SingularError(what, self._time)
            reached = float(np.abs(taken.state[:3]).max())
            own = np.abs(taken.state[self._n : -3])
            is_far = (own_sizes == 0.0) & (own > 0.0) & (own < 0.5 * sizes)
            is_guessed = self._largest > 0.0 or not 0.0 < reached < 0.5 * scale
            # Near a root of time, the guesses would shrink with the steps.
            if (is_guessed and not is_far.any()) or guesses == _MOST_GUESSES:
                return taken
            guesses += 1
            if self._largest == 0.0 and reached > 0.0:
                scale = min(scale, reached)
            sizes, self._trial = np.where(is_far, own, sizes), abs(taken.h)

    def _rates(self) -> Array:
        try:
            return np.array(float_outputs(self._tape, [self._time, *self._state.tolist()]))
        except ArithmeticError:
            return np.zeros(len(self._state))

    def until(self, time: float) -> float:
        """Take steps to `time` (s), later or earlier, and return the new time (s).

        Raise InputError as `step` does, or if more than 1e8 steps would be needed.
        """
        end, begin, first = finite("time", time), self._time, self._steps
        while self._time != end:
            self._advance(end)
            taken = self._steps - first
            if taken % _LOOK == 0 and abs(end - begin) * taken > _MOST * abs(self._time - begin):
                raise InputError(
                    f"time is {end:g} s; allowed: times that 1e8 steps reach; {taken} steps "
                    f"reached {self._time:g} s"
                )
        return self._time

    def at(self, times: float | Sequence[float] | Array) -> Array:
        """Return the state at times (s) within the last step, without changes made after it.

        It is omega (rad/s), the quaternion if computed, and own states, of shape (m,), or (m, n)
        for n times. Raise InputError for a time outside the step.
        """
        try:
            given: Array = np.asarray(times, dtype=float)
        except (OverflowError, TypeError, ValueError):
            raise InputError(f"times are {times!r}; allowed: numbers") from None
        low, high = sorted((self._begin, self._begin + self._last.h))
        # The end of a step is rounded.
        slack = 4.0 * math.ulp(max(abs(low), abs(high)))
        if not np.all((given >= low - slack) & (given <= high + slack)):
            raise InputError(f"t is outside the last step; allowed: {low!r} to {high!r} s")
        share: Any = (given - self._begin) / (self._last.h or 1.0)
        state: Array = polyval(share, self._last.terms[:, :-3])
        state[3 : self._n] = _normalised(state[3 : self._n])
        return state

    def _set(self, place: slice, values: Sequence[float]) -> None:
        self._state = self._state.copy()
        self._state[place] = values
        if self._steps == 0:
            self._last = Step(0.0, 0.0, self._state[None], self._state)


def _equations(scene: Scene, torque: Tape, n: int) -> Tape:
    """Return the recorded rates of omega, attitude (if n is 7), own states and held torque."""
    recorder = Recorder(2 * MOST_OPERATIONS, n + len(scene.states) + 4)
    time, *unknowns = recorder.inputs()
    omega: Any = np.array(unknowns[:3], dtype=object)
    q: Any = unknowns[3:n] or IDENTITY
    found = torque_of(torque, time, omega, q, *unknowns[n:-3])
    total = found[:3] + np.array(unknowns[-3:], dtype=object)
    if scene.changing is not None:
        rates: Any = rates_of_changing(scene.changing, time, omega, total)
    elif scene.inertia is None:
        x, y, z = omega
        products = np.array([y * z, z * x, x * y], dtype=object)
        moments = np.array(scene.moments or (1.0, 1.0, 1.0))
        rates = np.array(scene.euler_coefficients) * products + total / moments
    else:
        rates = rates_about_body_axes(scene.inertia, omega, total)
    rates = list(rates)
    if n == 7:
        rates += quaternion_rates(omega, q)
    return recorder.tape([*rates, *found[3:], 0.0, 0.0, 0.0])


def _check_three(name: str, values: object) -> tuple[float, ...]:
    return tuple(finite(name, each) for each in three_floats(name, values))


# Changing a copy would not change the motion; therefore it is read-only.
def _copy_fixed(values: Array) -> Array:
    found = values.copy()
    found.setflags(write=False)
    return found


def _normalised(q: Array) -> Array:
    return q / np.sqrt(np.sum(q * q, axis=0)) if len(q) else q
