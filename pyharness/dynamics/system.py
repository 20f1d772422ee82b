"""The equations of motion of a scene with a recorded torque, as one tape."""

from collections.abc import Callable, Sequence
from typing import Any

from pyharness.model.attitude import IDENTITY
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque, torque_of
from pyharness.model.symbols import Recorder
from pyharness.model.tape import Tape
from pyharness.model.values import Triple


def system_of(scene: Scene, attitude: bool) -> Tape:
    """Return the right-hand side of the equations of motion of a scene as a tape.

    The outputs are the derivatives of the three components of omega (equations 16-18 of the thesis)
    and, if `attitude` is true, those of the quaternion q, which satisfies q' = q (0, omega)/2. The
    scene must have a recorded torque, and principal axes.
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
        a, b, c, d = q
        rates += [
            -0.5 * (b * x + c * y + d * z),
            0.5 * (a * x + c * z - d * y),
            0.5 * (a * y + d * x - b * z),
            0.5 * (a * z + b * y - c * x),
        ]
    return recorder.tape(rates)


def slopes_of(scene: Scene) -> Callable[[float, Sequence[float]], list[float]]:
    """Return the right-hand side f(t, state) of the equations of motion of a scene, in floats.

    The state is omega (rad/s), followed by the attitude, a quaternion, if the scene has one. The
    torque of the scene depends on the state. A rate is NaN where the torque is singular.
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
            w, i, j, k = q
            found += [
                -0.5 * (i * x + j * y + k * z),
                0.5 * (w * x + j * z - k * y),
                0.5 * (w * y + k * x - i * z),
                0.5 * (w * z + i * y - j * x),
            ]
        return found

    return slopes


def _divisors(scene: Scene) -> Triple:
    return scene.moments or (1.0, 1.0, 1.0)
