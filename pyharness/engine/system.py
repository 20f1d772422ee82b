"""The equations of motion of a scene with a recorded torque, as one tape.

An inertia that changes becomes part of the torque.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from pyharness.model.attitude import IDENTITY, quaternion_rates
from pyharness.model.changing import rates_of_changing
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque, of_law, replayed, torque_of
from pyharness.model.symbols import Recorder
from pyharness.model.tape import Tape
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import Triple


def system_of(scene: Scene, attitude: bool) -> Tape:
    """Return the equations of motion of a scene with recorded torque and principal axes as a tape.

    They are equations 16-18 of the thesis and, if `attitude`, q' = q (0, omega)/2.
    """
    assert isinstance(scene.torque, StateTorque)
    assert scene.torque.tape is not None
    recorder = Recorder()
    time, x, y, z, *q = recorder.inputs()
    torque = torque_of(scene.torque.tape, time, (x, y, z), q)
    rates: list[Any] = [
        coefficient * product + component / moment
        for coefficient, product, component, moment in zip(
            scene.euler_coefficients, (y * z, z * x, x * y), torque, _divisors(scene), strict=True
        )
    ]
    if attitude:
        rates += quaternion_rates((x, y, z), q)
    return recorder.tape(rates)


def is_recorded(scene: Scene) -> bool:
    """Return whether the torque depends on the state, or the inertia changes."""
    return isinstance(scene.torque, StateTorque) or scene.changing is not None


def with_constant_body(scene: Scene) -> Scene:
    """Return a scene with the same solution whose inertia does not change with time.

    It has A = B = C = 0, and omega' as its torque. With the inertia I and the torque N, omega'
    follows from I omega' = N - I' omega - omega x (I omega).
    """
    changing, torque = scene.changing, scene.torque
    if changing is None:
        return scene
    if isinstance(torque, TorqueLaw):
        torque = of_law(torque)
    tape = torque.tape
    if tape is not None:
        found = replayed(
            lambda time, omega, q: rates_of_changing(
                changing, time, omega, torque_of(tape, time, omega, q)
            )
        )
    else:
        found = replace(
            torque,
            function=lambda time, omega, q=IDENTITY: rates_of_changing(
                changing, time, omega, torque.at(time, omega, q)
            ),
        )
    return replace(scene, changing=None, coefficients=(0.0, 0.0, 0.0), torque=found)


def slopes_of(scene: Scene) -> Callable[[float, Sequence[float]], list[float]]:
    """Return the right-hand side f(t, state) under a torque of the state; NaN where singular.

    The state is omega (rad/s), with or without the quaternion.
    """
    torque = scene.torque
    assert isinstance(torque, StateTorque)
    a, b, c = scene.euler_coefficients
    first, second, third = _divisors(scene)

    def slopes(time: float, state: Sequence[float]) -> list[float]:
        x, y, z = (float(w) for w in state[:3])
        q = [float(w) for w in state[3:]] or IDENTITY
        n1, n2, n3 = torque.at(float(time), (x, y, z), q)
        found = [n1 / first + a * y * z, n2 / second + b * x * z, n3 / third + c * x * y]
        if len(state) > 3:
            found += quaternion_rates((x, y, z), q)
        return found

    return slopes


def _divisors(scene: Scene) -> Triple:
    return scene.moments or (1.0, 1.0, 1.0)
