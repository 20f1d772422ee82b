"""Known faults of integrators, each with the motion that a faulty integrator computes.

This motion comes from a changed scene, or from changed true states. An integrator that converges
to it has the fault.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pyharness.engine.solve import solve
from pyharness.model.attitude import product
from pyharness.model.errors import WorkLimitError
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import checked_torque
from pyharness.model.torque_law import TorqueLaw, law_value
from pyharness.model.trajectory import Array

_TOLERANCE = 1e-11
_EFFORT = 0.005  # work limit; a faulty motion can oscillate too fast to be computed
_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_DEGREES = 180.0 / math.pi


class State(NamedTuple):
    """Angular velocities (rad/s), shape (n, 3), and quaternions, scalar first, shape (n, 4)."""

    omega: Array
    attitude: Array


@dataclass(frozen=True)
class Fault:
    """A fault of an integrator, with the changes that it makes to a motion."""

    name: str
    says: str  # a sentence that describes the fault
    # Returns the scene that the faulty integrator solves, or None if the fault has no effect.
    scene: Callable[[Scene], Scene | None] = lambda scene: scene
    # Returns the times (s) of the answered states, from the requested times and step size (s).
    times: Callable[[Array, float], Array] = lambda times, step: times
    # Returns the faulty states from the states at these times and the unchanged scene.
    state: Callable[[State, Scene], State] = lambda state, scene: state
    of_step: bool = False  # whether the error of the states decreases with the step size

    def motion(self, scene: Scene, times: Array, step: float) -> State | None:
        """Return the faulty states at `times` (s), or None if the fault has no effect."""
        other = self.scene(scene)
        if other is None:
            return None
        return self.state(true_motion(other, self.times(times, step)), scene)


def true_motion(scene: Scene, times: Array) -> State:
    run = solve(scene, times.tolist(), tolerance=_TOLERANCE, attitude=True, effort=_EFFORT)
    if run.attitude is None or len(run.omega) < len(times):
        raise ArithmeticError("the motion does not reach the last time")
    return State(run.omega, run.attitude)


def _moments(scene: Scene) -> Triple:
    assert scene.moments is not None
    return scene.moments


def _gyroscopic(scene: Scene, omega: Any) -> list[Any]:
    x, y, z = omega
    a, b, c = (m * w for m, w in zip(_moments(scene), omega, strict=True))
    return [y * c - z * b, z * a - x * c, x * b - y * a]


def _with_gyroscopic(*factors: float, applied: float = 1.0) -> Callable[[Scene], Scene]:
    """Return a change of scenes: torque times `applied`, -omega x (I omega) times `factors`."""

    def changed(scene: Scene) -> Scene:
        def torque(t: Any, omega: Any) -> list[Any]:
            each = zip(law_value(scene.law, t), factors, _gyroscopic(scene, omega), strict=True)
            return [applied * n + (1.0 - factor) * part for n, factor, part in each]

        return replace(scene, torque=checked_torque(torque))

    return changed


def _with_torque(change: Callable[[Scene], Any]) -> Callable[[Scene], Scene | None]:
    def changed(scene: Scene) -> Scene | None:
        if scene.torque.is_zero:
            return None
        return replace(scene, torque=checked_torque(change(scene)))

    return changed


def _without(**part: Any) -> Callable[[Scene], Scene | None]:
    def changed(scene: Scene) -> Scene | None:
        law = replace(scene.law, **part)
        return None if law == scene.law else replace(scene, torque=law)

    return changed


def _frozen(scene: Scene) -> TorqueLaw:
    law = scene.law
    values = np.array(law.constant) + sum(np.array(amplitude) for amplitude, _ in law.cosines)
    return TorqueLaw(values)


def _undivided(scene: Scene) -> Callable[[Any, Any], list[Any]]:
    return lambda t, omega: [
        m * n for m, n in zip(_moments(scene), law_value(scene.law, t), strict=True)
    ]


def _in_order(*order: int) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, moments=np.take(_moments(scene), order).tolist())


def in_space(attitude: Array, vectors: Array) -> Array:
    """Return the components along space axes, shape (n, 3), of `vectors` in body axes."""
    q = attitude.T
    turned = product(product(q, (np.zeros(len(vectors)), *vectors.T)), _conjugate(q))
    return np.array(turned[1:]).T


def _conjugate(q: Any) -> Any:
    return q[0], -q[1], -q[2], -q[3]


def _with_space_rates(scene: Scene) -> Scene:
    """Return a scene for -omega and the conjugate of q, for the wrong q' = (0, omega) q/2."""
    # Correct is q' = q (0, omega)/2. With the wrong rate the conjugate p of q satisfies the correct
    # p' = p (0, -omega)/2, and -omega satisfies Euler's equations with both terms negated.
    start, back = _conjugate(scene.attitude), np.negative(scene.omega).tolist()
    opposite = _with_gyroscopic(-1.0, -1.0, -1.0, applied=-1.0)(scene)
    return replace(opposite, omega=back, attitude=start)


def _with_doubled_rates(scene: Scene) -> Scene:
    """Return a scene for twice omega, for the wrong q' = q (0, omega)."""
    halved = _with_gyroscopic(0.5, 0.5, 0.5, applied=2.0)(scene)
    return replace(halved, omega=np.multiply(2.0, scene.omega).tolist())


def _with_fast_torque(scene: Scene) -> Scene:
    law = scene.law
    rate = [2.0 * x for x in law.rate]
    sines, cosines = ([(a, 2.0 * f) for a, f in waves] for waves in (law.sines, law.cosines))
    return replace(scene, torque=TorqueLaw(law.constant, rate, sines, cosines, law.frame))


def _of_thesis(half: State, scene: Scene) -> State:
    """Return 2 y(t/2) - y(0) for y = omega and attitude, from the states `half` at t/2."""
    attitude = 2.0 * half.attitude - np.array(scene.attitude)
    return State(
        2.0 * half.omega - np.array(scene.omega),
        attitude / np.linalg.norm(attitude, axis=1, keepdims=True),
    )


FAULTS = (
    Fault("gyroscopic-missing", "the gyroscopic term omega x (I omega) is missing",
          _with_gyroscopic(0.0, 0.0, 0.0)),
    Fault("gyroscopic-sign", "the gyroscopic term has the opposite sign",
          _with_gyroscopic(-1.0, -1.0, -1.0)),
    *(
        Fault(f"gyroscopic-sign-{axis + 1}",
              f"the gyroscopic term of axis {axis + 1} has the opposite sign",
              _with_gyroscopic(*(-1.0 if k == axis else 1.0 for k in range(3))))
        for axis in range(3)
    ),
    Fault("gyroscopic-half", "half of the gyroscopic term is missing",
          _with_gyroscopic(0.5, 0.5, 0.5)),
    Fault("omega-in-space", "omega is given about the axes of space, not of the body",
          state=lambda state, scene: State(in_space(state.attitude, state.omega), state.attitude)),
    Fault("omega-in-degrees", "omega is given in degrees per second",
          state=lambda state, scene: State(_DEGREES * state.omega, state.attitude)),
    Fault("torque-missing", "the torque is ignored", _with_torque(lambda scene: TorqueLaw())),
    Fault("torque-frozen", "the torque keeps its value at time 0", _with_torque(_frozen)),
    Fault("torque-rate-missing", "the linear part of the torque is ignored",
          _without(rate=(0.0, 0.0, 0.0))),
    Fault("torque-sines-missing", "the sines of the torque are ignored", _without(sines=())),
    Fault("torque-cosines-missing", "the cosines of the torque are ignored", _without(cosines=())),
    Fault("torque-in-space", "the torque acts about the axes of space, not of the body",
          _with_torque(lambda scene: replace(scene.law, frame="space"))),
    Fault("torque-undivided", "the torque is not divided by the moments", _with_torque(_undivided)),
    Fault("torque-sign", "the torque has the opposite sign",
          _with_torque(lambda scene: lambda t, omega: -law_value(scene.law, t))),
    *(
        Fault(f"moments-{''.join(str(axis + 1) for axis in order)}",
              f"the moments are used in the order {', '.join(str(axis + 1) for axis in order)}",
              _in_order(*order))
        for order in ((0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))
    ),
    Fault("half-speed", "time passes at half speed: the state is that of half the time",
          times=lambda times, step: 0.5 * times),
    Fault("double-speed", "time passes at double speed: the state is that of twice the time",
          times=lambda times, step: 2.0 * times),
    Fault("thesis-runge-kutta", "the state is 2 y(t/2) - y(0), as in the Runge-Kutta program of "
          "the thesis: stages build on one another, and no step begins at the last result",
          _with_fast_torque, times=lambda times, step: 0.5 * times, state=_of_thesis),
    Fault("step-late", "the state is that of one step before the requested time",
          times=lambda times, step: times - step, of_step=True),
    Fault("step-early", "the state is that of one step after the requested time",
          times=lambda times, step: times + step, of_step=True),
    Fault("half-step-late", "the state is that of half a step before the requested time",
          times=lambda times, step: times - 0.5 * step, of_step=True),
    Fault("half-step-early", "the state is that of half a step after the requested time",
          times=lambda times, step: times + 0.5 * step, of_step=True),
    Fault("quaternion-transposed", "the quaternion is the conjugate, from space to body",
          state=lambda state, scene: State(state.omega, state.attitude * _CONJUGATE)),
    Fault("scalar-last", "the scalar of the quaternion is last, not first",
          state=lambda state, scene: State(state.omega, state.attitude[:, [1, 2, 3, 0]])),
    Fault("attitude-from-identity", "the initial attitude is ignored",
          state=lambda state, scene: State(
              state.omega, np.array(product(_conjugate(scene.attitude), state.attitude.T)).T)),
    Fault("attitude-frame", "the quaternion advances as if omega were about the axes of space",
          _with_space_rates,
          state=lambda state, scene: State(-state.omega, state.attitude * _CONJUGATE)),
    Fault("attitude-rate", "the quaternion rotates at twice the rate, without the factor 1/2",
          _with_doubled_rates,
          state=lambda state, scene: State(0.5 * state.omega, state.attitude)),
)  # fmt: skip
"""The known faults; faults of omega are first."""

OUTPUTS = ("quaternion-transposed", "scalar-last", "attitude-from-identity")
"""Faults of the attitude alone; their `state` applies to any states."""


def motions(scene: Scene, times: Array, step: float) -> Iterator[tuple[Fault, State]]:
    """Yield each fault with an effect, and its states; NaN if the last time is not reached."""
    for fault in FAULTS:
        with np.errstate(all="ignore"):
            try:
                found = fault.motion(scene, times, step)
            except (ArithmeticError, WorkLimitError):
                found = State(*(np.full((len(times), width), np.nan) for width in (3, 4)))
        if found is not None:
            yield fault, found
