"""The equations of motion of a scene with a recorded torque, as one tape of operations."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

from pyharness.model.attitude import IDENTITY, quaternion_rates
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque, torque_of
from pyharness.model.symbols import MOST_OPERATIONS, Recorder
from pyharness.model.tape import N_INPUTS, Tape
from pyharness.model.values import Triple


def system_of(scene: Scene, attitude: bool) -> Tape:
    """Return the equations of motion of a scene with recorded torque and principal axes as a tape.

    They are equations 16-18 of the thesis and, if `attitude`, q' = q (0, omega)/2; then the rates
    of the scene's own states. The inputs are the time and the unknowns in this order.
    """
    assert isinstance(scene.torque, StateTorque)
    assert scene.torque.tape is not None
    body = scene.euler_coefficients, scene.moments or (1.0, 1.0, 1.0)
    return _system(scene.torque.tape, *body, attitude, len(scene.states))


# Recording takes longer than most solutions; many initial states share one system.
@lru_cache(maxsize=64)
def _system(
    tape: Tape, coefficients: Triple, divisors: Triple, attitude: bool, n_states: int
) -> Tape:
    own = 7 if attitude else 3
    most = 2 * len(tape.operations) + MOST_OPERATIONS
    recorder = Recorder(most, max(N_INPUTS, 1 + own + n_states))
    time, *unknowns = recorder.inputs()
    x, y, z, *q = unknowns[: own if n_states else 7]
    states = unknowns[own : own + n_states]
    torque = torque_of(tape, time, (x, y, z), q or IDENTITY, *states)
    rates: list[Any] = [
        coefficient * product + component / moment
        for coefficient, product, component, moment in zip(
            coefficients, (y * z, z * x, x * y), torque[:3], divisors, strict=True
        )
    ]
    if attitude:
        rates += quaternion_rates((x, y, z), q)
    return recorder.tape([*rates, *torque[3:]])


def is_recorded(scene: Scene) -> bool:
    """Return whether the torque depends on the state, or the inertia changes."""
    return isinstance(scene.torque, StateTorque) or scene.changing is not None


def slopes_of(scene: Scene) -> Callable[[float, Sequence[float]], list[float]]:
    """Return the right-hand side f(t, state) under a torque of the state; NaN where singular.

    The state is omega (rad/s), with or without the quaternion.
    """
    torque = scene.torque
    assert isinstance(torque, StateTorque)
    a, b, c = scene.euler_coefficients
    first, second, third = scene.moments or (1.0, 1.0, 1.0)

    def slopes(time: float, state: Sequence[float]) -> list[float]:
        x, y, z = (float(w) for w in state[:3])
        q = [float(w) for w in state[3:]] or IDENTITY
        n1, n2, n3 = torque.at(float(time), (x, y, z), q)
        found = [n1 / first + a * y * z, n2 / second + b * x * z, n3 / third + c * x * y]
        if len(state) > 3:
            found += quaternion_rates((x, y, z), q)
        return found

    return slopes
