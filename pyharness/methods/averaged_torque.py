"""The torque of a scene as a function of arrays, for the method `averaged`."""

import math
from typing import NamedTuple

import numpy as np

from pyharness.dynamics.array_tape import outputs_at
from pyharness.methods.averaged_coordinates import Torque
from pyharness.methods.problem import normalized
from pyharness.model.array_type import Array
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import N_INPUTS, TIME, Linear, Operation, Tape
from pyharness.model.torque_law import TorqueLaw


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


class _Slot(NamedTuple):
    """The direct dependence of a slot of a tape on time, not that by way of omega.

    `fastest` is the highest frequency of its waves (rad/s), and infinite if the slot is more than a
    sum of products of waves and powers of the time. `rate` is the derivative with respect to time
    (1/s), if it is constant; otherwise it is NaN.
    """

    fastest: float
    rate: float

    @property
    def is_constant(self) -> bool:
        return self.fastest == 0.0 and self.rate == 0.0


def fastest_of(torque: TorqueLaw | StateTorque) -> float:
    """Return the highest frequency of the waves of a torque (rad/s).

    Raise InputError if the torque depends on time in a way that a macro-step may miss, as a pulse.
    """
    if isinstance(torque, TorqueLaw):
        return max((abs(f) for a, f in torque.sines + torque.cosines if any(a)), default=0.0)
    assert torque.tape is not None
    fastest = _fastest_of_tape(torque.tape)
    if fastest == math.inf:
        raise InputError(
            "averaged may miss changes of this torque with time; allowed: a torque whose time is "
            "only in powers, and in sines and cosines of low frequency, or another method"
        )
    return fastest


def _fastest_of_tape(tape: Tape) -> float:
    slots = [_Slot(0.0, 1.0 if slot == TIME else 0.0) for slot in range(N_INPUTS)]
    for operation in tape.operations:
        slots.append(_result(operation, slots))
    return max(_combined(output, slots).fastest for output in tape.outputs)


def _combined(linear: Linear, slots: list[_Slot]) -> _Slot:
    used = [(slots[slot], factor) for slot, factor in linear.terms if factor != 0.0]
    return _Slot(
        max((each.fastest for each, _ in used), default=0.0),
        math.fsum(each.rate * factor for each, factor in used),
    )


def _result(operation: Operation, slots: list[_Slot]) -> _Slot:
    if operation.linear is not None:
        return _combined(operation.linear, slots)
    if operation.table is not None:
        return _Slot(math.inf, math.nan)
    first, *others = (slots[slot] for slot in operation.operands)
    if first.is_constant and all(each.is_constant for each in others):
        return _Slot(0.0, 0.0)
    if operation.kind == "product":
        return _Slot(first.fastest + others[0].fastest, math.nan)
    if operation.kind == "quotient" and others[0].is_constant:
        return _Slot(first.fastest, math.nan)
    if operation.kind in ("sine", "cosine") and first.fastest == 0.0 and math.isfinite(first.rate):
        return _Slot(abs(first.rate), math.nan)
    return _Slot(math.inf, math.nan)
