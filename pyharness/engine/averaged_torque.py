"""The torque of a scene as a function of arrays, for the method `averaged`."""

import math
from typing import NamedTuple

import numpy as np

from pyharness.engine.averaged_coordinates import Torque
from pyharness.engine.problem import normalized
from pyharness.engine.recorded import outputs_at
from pyharness.model.array_type import Array
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import N_INPUTS, TIME, Linear, Operation, Tape
from pyharness.model.torque_law import TorqueLaw

_MOST_DEGREE = 8.0


def torque_of(scene: Scene) -> tuple[Torque, bool]:
    """Return the torque over the moments as a function, and whether it may depend on time."""
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
    """The dependence of a slot of a tape on omega and time."""

    degree: float = 0.0  # of the polynomial; infinite for operations other than polynomials, waves
    fastest: float = 0.0  # highest frequency of the waves, rad/s
    rate: float | None = None  # 1/s, of a slot that is linear in time alone


def fastest_of(torque: TorqueLaw | StateTorque) -> float:
    """Return the highest frequency of the waves of a torque (rad/s).

    Raise InputError if the degree of a recorded torque exceeds 8 or is infinite, because a
    macro-step may miss a pulse, or an effect in a narrow range of omega.
    """
    if isinstance(torque, TorqueLaw):
        return max((abs(f) for a, f in torque.sines + torque.cosines if any(a)), default=0.0)
    assert torque.tape is not None
    found = _all_of(torque.tape)
    if found.degree > _MOST_DEGREE:
        raise InputError(
            "averaged may miss changes of this torque; allowed: a recorded torque that is a "
            f"polynomial of degree {_MOST_DEGREE:.0f} at most in omega and time, times sines and "
            "cosines of low frequency, or another method"
        )
    return found.fastest


def _all_of(tape: Tape) -> _Slot:
    slots = [_Slot(1.0, rate=1.0) if slot == TIME else _Slot(1.0) for slot in range(N_INPUTS)]
    for operation in tape.operations:
        slots.append(_result(operation, slots))
    outputs = [_combined(output, slots) for output in tape.outputs]
    return _Slot(max(each.degree for each in outputs), max(each.fastest for each in outputs))


def _combined(linear: Linear, slots: list[_Slot]) -> _Slot:
    used = [(slots[slot], factor) for slot, factor in linear.terms]
    rates = [factor * each.rate for each, factor in used if each.rate is not None]
    return _Slot(
        max((each.degree for each, _ in used), default=0.0),
        max((each.fastest for each, _ in used), default=0.0),
        math.fsum(rates) if len(rates) == len(used) else None,
    )


def _result(operation: Operation, slots: list[_Slot]) -> _Slot:
    if operation.linear is not None:
        return _combined(operation.linear, slots)
    used = [slots[slot] for slot in operation.operands]
    if operation.kind == "product":
        return _Slot(sum(each.degree for each in used), sum(each.fastest for each in used))
    if operation.kind in ("sine", "cosine") and used[0].rate is not None:
        return _Slot(0.0, abs(used[0].rate))
    return _Slot(math.inf)
