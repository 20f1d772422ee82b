"""The torque of a scene as a function of arrays, for the method `averaged`."""

import numpy as np

from pyharness.dynamics.array_tape import outputs_at
from pyharness.methods.averaged_coordinates import Torque
from pyharness.methods.problem import normalized
from pyharness.model.array_type import Array
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque


def torque_of(scene: Scene) -> tuple[Torque, bool]:
    """Return the torque over the moments as a function, and whether it depends on time."""
    if isinstance(scene.torque, StateTorque):
        return _state_torque(scene, scene.torque), True
    _, constant, rate, sines, cosines = normalized(scene)
    waves = [(np.sin, each) for each in sines.T] + [(np.cos, each) for each in cosines.T]
    if not (waves or rate.any()):
        return lambda time, omega: list(constant), False

    def torque(time: Array, omega: list[Array]) -> list[Array]:
        found = [c + r * time for c, r in zip(constant, rate, strict=True)]
        for function, (*amplitude, frequency) in waves:
            wave = function(frequency * time)
            found = [each + a * wave for each, a in zip(found, amplitude, strict=True)]
        return found

    return torque, True


def _state_torque(scene: Scene, given: StateTorque) -> Torque:
    """Return a recorded torque over the moments as a function of time and omega."""
    tape = given.tape
    if tape is None or given.needs_attitude:
        raise InputError(
            "averaged can't evaluate this torque; allowed: a torque that can be recorded and does "
            "not depend on the attitude"
        )
    moments = scene.moments or (1.0, 1.0, 1.0)

    def torque(time: Array, omega: list[Array]) -> list[Array]:
        shape = np.broadcast_shapes(time.shape, omega[0].shape)
        flat = [np.broadcast_to(each, shape).ravel() for each in (time, *omega)]
        found = outputs_at(tape, flat[0], np.array(flat[1:]).T) / moments
        return [each.reshape(shape) for each in found.T]

    return torque
