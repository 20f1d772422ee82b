"""Known faults of integrators, each with the motion that a faulty integrator computes.

A fault is recognised if an integrator converges to its motion, which is our solution of another
scene or in other conventions.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pyharness.engine.solve import solve
from pyharness.model.attitude import product
from pyharness.model.scene import Scene
from pyharness.model.state_torque import checked_torque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array

_TOLERANCE = 1e-11
_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_DEGREES = 180.0 / math.pi


class State(NamedTuple):
    """Angular velocities (rad/s), shape (n, 3), and attitudes, shape (n, 4)."""

    omega: Array
    attitude: Array


@dataclass(frozen=True)
class Fault:
    """A fault of an integrator: its name, a sentence on it, and its motion.

    `motion` takes a scene, times (s) and a step size (s), and returns None if the fault has no
    effect. If `of_step`, its states approach the true ones as the step decreases.
    """

    name: str
    says: str
    motion: Callable[[Scene, Array, float], State | None]
    of_step: bool = False


def true_motion(scene: Scene, times: Array) -> State:
    """Return the states at ascending times (s); raise ArithmeticError if one is missing."""
    run = solve(scene, times.tolist(), tolerance=_TOLERANCE, attitude=True)
    if run.attitude is None or len(run.omega) < len(times):
        raise ArithmeticError("the motion does not reach the last time")
    return State(run.omega, run.attitude)


def _cross(a: Any, b: Any) -> list[Any]:
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def _law(scene: Scene, t: Any) -> list[Any]:
    law = scene.law
    found = []
    for axis in range(3):
        value = law.constant[axis] + law.rate[axis] * t
        for amplitude, frequency in law.sines:
            value = value + amplitude[axis] * np.sin(frequency * t)
        for amplitude, frequency in law.cosines:
            value = value + amplitude[axis] * np.cos(frequency * t)
        found.append(value)
    return found


def _with_gyroscopic(x: float, y: float, z: float) -> Callable[[Scene, Array, float], State]:
    """Return a motion whose gyroscopic term -omega x (I omega) is multiplied by x, y and z."""

    def motion(scene: Scene, times: Array, step: float) -> State:
        moments = scene.moments
        assert moments is not None

        def torque(t: Any, omega: Any) -> list[Any]:
            term = _cross(omega, [m * w for m, w in zip(moments, omega, strict=True)])
            each = zip(_law(scene, t), (x, y, z), term, strict=True)
            return [n + (1.0 - factor) * part for n, factor, part in each]

        return true_motion(replace(scene, torque=checked_torque(torque)), times)

    return motion


def _with_law(change: Callable[[Scene], Any]) -> Callable[[Scene, Array, float], State | None]:
    def motion(scene: Scene, times: Array, step: float) -> State | None:
        if scene.torque.is_zero:
            return None
        return true_motion(replace(scene, torque=checked_torque(change(scene))), times)

    return motion


def _without(**part: Any) -> Callable[[Scene, Array, float], State | None]:
    def motion(scene: Scene, times: Array, step: float) -> State | None:
        law = replace(scene.law, **part)
        return None if law == scene.law else true_motion(replace(scene, torque=law), times)

    return motion


def _frozen(scene: Scene) -> TorqueLaw:
    law = scene.law
    values = np.array(law.constant) + sum(np.array(amplitude) for amplitude, _ in law.cosines)
    return TorqueLaw(constant=tuple(np.broadcast_to(values, 3).tolist()))


def _undivided(scene: Scene) -> Callable[[Any, Any], list[Any]]:
    moments = scene.moments
    assert moments is not None
    return lambda t, omega: [m * n for m, n in zip(moments, _law(scene, t), strict=True)]


def _in_order(order: tuple[int, int, int]) -> Callable[[Scene, Array, float], State]:
    def motion(scene: Scene, times: Array, step: float) -> State:
        assert scene.moments is not None
        a, b, c = (scene.moments[axis] for axis in order)
        return true_motion(replace(scene, moments=(a, b, c)), times)

    return motion


def _at_times(change: Callable[[Array, float], Array]) -> Callable[[Scene, Array, float], State]:
    def motion(scene: Scene, times: Array, step: float) -> State:
        return true_motion(scene, change(times, step))

    return motion


def _of_state(change: Callable[[State, Scene], State]) -> Callable[[Scene, Array, float], State]:
    def motion(scene: Scene, times: Array, step: float) -> State:
        return change(true_motion(scene, times), scene)

    return motion


def space_omega(state: State, scene: Scene) -> State:
    """Return states with omega about the axes of space instead of the body."""
    q = state.attitude.T
    zeros = np.zeros(len(state.omega))
    turned = product(product(q, (zeros, *state.omega.T)), _conjugate(q))
    return State(np.array(turned[1:]).T, state.attitude)


def _conjugate(q: Any) -> Any:
    return q[0], -q[1], -q[2], -q[3]


def _of_output(name: str) -> Callable[[Scene, Array, float], State]:
    return _of_state(
        lambda state, scene: State(state.omega, as_output(name, state.attitude, scene))
    )


def as_output(name: str, attitude: Array, scene: Scene) -> Array:
    """Return attitudes with the fault `name` of `OUTPUTS`."""
    if name == "attitude-from-identity":
        assert scene.attitude is not None
        return np.array(product(_conjugate(scene.attitude), attitude.T)).T
    return attitude * _CONJUGATE if name == "quaternion-transposed" else attitude[:, [1, 2, 3, 0]]


def _space_rates(scene: Scene, times: Array, step: float) -> State:
    """Return the motion with q' = (0, omega) q/2 instead of q' = q (0, omega)/2.

    The conjugate p of q satisfies p' = p (0, -omega)/2, and -omega satisfies Euler's equations with
    opposite gyroscopic term and torque; the motion is computed for p and -omega.
    """
    moments = scene.moments
    assert moments is not None
    assert scene.attitude is not None

    def torque(t: Any, omega: Any) -> list[Any]:
        term = _cross(omega, [m * w for m, w in zip(moments, omega, strict=True)])
        return [2.0 * each - n for each, n in zip(term, _law(scene, t), strict=True)]

    x, y, z = scene.omega
    other = replace(
        scene,
        torque=checked_torque(torque),
        omega=(-x, -y, -z),
        attitude=_conjugate(scene.attitude),
    )
    found = true_motion(other, times)
    return State(-found.omega, found.attitude * _CONJUGATE)


def _doubled_rates(scene: Scene, times: Array, step: float) -> State:
    """Return the motion with q' = q (0, omega), from a body with twice the omega."""
    moments = scene.moments
    assert moments is not None

    def torque(t: Any, omega: Any) -> list[Any]:
        term = _cross(omega, [m * w for m, w in zip(moments, omega, strict=True)])
        return [2.0 * n + 0.5 * each for n, each in zip(_law(scene, t), term, strict=True)]

    x, y, z = scene.omega
    found = true_motion(
        replace(scene, torque=checked_torque(torque), omega=(2.0 * x, 2.0 * y, 2.0 * z)), times
    )
    return State(0.5 * found.omega, found.attitude)


def _thesis_program(scene: Scene, times: Array, step: float) -> State:
    """Return 2 y(t/2) - y(0), normalised; y is the motion if torques vary twice as fast."""
    law = scene.law
    x, y, z = law.rate
    fast = replace(
        law,
        rate=(2.0 * x, 2.0 * y, 2.0 * z),
        sines=tuple((amplitude, 2.0 * frequency) for amplitude, frequency in law.sines),
        cosines=tuple((amplitude, 2.0 * frequency) for amplitude, frequency in law.cosines),
    )
    half = true_motion(replace(scene, torque=fast), 0.5 * times)
    attitude = 2.0 * half.attitude - np.array(scene.attitude)
    return State(
        2.0 * half.omega - np.array(scene.omega),
        attitude / np.linalg.norm(attitude, axis=1, keepdims=True),
    )


def _shift(steps: float) -> Callable[[Array, float], Array]:
    return lambda times, step: times + steps * step


_ORDERS = ((0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))

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
          _of_state(space_omega)),
    Fault("omega-in-degrees", "omega is given in degrees per second",
          _of_state(lambda state, scene: State(_DEGREES * state.omega, state.attitude))),
    Fault("torque-missing", "the torque is ignored", _with_law(lambda scene: TorqueLaw())),
    Fault("torque-frozen", "the torque keeps its value at time 0", _with_law(_frozen)),
    Fault("torque-rate-missing", "the linear part of the torque is ignored",
          _without(rate=(0.0, 0.0, 0.0))),
    Fault("torque-sines-missing", "the sines of the torque are ignored", _without(sines=())),
    Fault("torque-cosines-missing", "the cosines of the torque are ignored", _without(cosines=())),
    Fault("torque-in-space", "the torque acts about the axes of space, not of the body",
          _with_law(lambda scene: replace(scene.law, frame="space"))),
    Fault("torque-undivided", "the torque is not divided by the moments", _with_law(_undivided)),
    Fault("torque-sign", "the torque has the opposite sign",
          _with_law(lambda scene: lambda t, omega: [-n for n in _law(scene, t)])),
    *(
        Fault(f"moments-{''.join(str(axis + 1) for axis in order)}",
              f"the moments are used in the order {', '.join(str(axis + 1) for axis in order)}",
              _in_order(order))
        for order in _ORDERS
    ),
    Fault("half-speed", "time passes at half speed: the state is that of half the time",
          _at_times(lambda times, step: 0.5 * times)),
    Fault("double-speed", "time passes at double speed: the state is that of twice the time",
          _at_times(lambda times, step: 2.0 * times)),
    Fault("thesis-runge-kutta", "the state is 2 y(t/2) - y(0), as in the Runge-Kutta program of "
          "the thesis: stages build on one another, and no step begins at the last result",
          _thesis_program),
    Fault("step-late", "the state is that of one step before the requested time",
          _at_times(_shift(-1.0)), of_step=True),
    Fault("step-early", "the state is that of one step after the requested time",
          _at_times(_shift(1.0)), of_step=True),
    Fault("half-step-late", "the state is that of half a step before the requested time",
          _at_times(_shift(-0.5)), of_step=True),
    Fault("half-step-early", "the state is that of half a step after the requested time",
          _at_times(_shift(0.5)), of_step=True),
    Fault("quaternion-transposed", "the quaternion is the conjugate, from space to body",
          _of_output("quaternion-transposed")),
    Fault("scalar-last", "the scalar of the quaternion is last, not first",
          _of_output("scalar-last")),
    Fault("attitude-from-identity", "the initial attitude is ignored",
          _of_output("attitude-from-identity")),
    Fault("attitude-frame", "the quaternion advances as if omega were about the axes of space",
          _space_rates),
    Fault("attitude-rate", "the quaternion rotates at twice the rate, without the factor 1/2",
          _doubled_rates),
)  # fmt: skip
"""The known faults; faults of omega are first."""

OUTPUTS = ("quaternion-transposed", "scalar-last", "attitude-from-identity")
"""The faults of the attitude alone, which `as_output` applies to any states."""


def motions(scene: Scene, times: Array, step: float) -> Iterator[tuple[Fault, State]]:
    """Yield each fault that has an effect in the scene, with its states at `times` (s).

    The states are NaN if the motion does not reach the last time.
    """
    for fault in FAULTS:
        with np.errstate(all="ignore"):
            try:
                found = fault.motion(scene, times, step)
            except ArithmeticError:
                rows = len(times)
                found = State(np.full((rows, 3), np.nan), np.full((rows, 4), np.nan))
        if found is not None:
            yield fault, found
