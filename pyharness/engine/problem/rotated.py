"""Scenes with other axes, other signs, or another time 0."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pyharness.model.attitude import Quaternion
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, Triple, checked_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import N_INPUTS, TIME, Linear, Operation, Table, Tape
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.model.trajectory import Array


def rotated(scene: Scene, turn: Callable[[Triple], Triple], body: bool) -> Scene:
    """Return the scene with `turn` applied to omega, torque vectors and, if `body`, moments.

    `turn` must be a rotation for a StateTorque.
    """

    def waves(each: tuple[Wave, ...]) -> tuple[Wave, ...]:
        return tuple((turn(amplitude), frequency) for amplitude, frequency in each)

    checked_scene(scene, any_axes=True, any_torque=True, any_state=True)
    law = scene.torque
    if isinstance(law, StateTorque):
        law = law.rotated(axes_of(turn))
    elif not law.in_space:
        law = TorqueLaw(turn(law.constant), turn(law.rate), waves(law.sines), waves(law.cosines))
    return replace(
        scene,
        omega=turn(scene.omega),
        moments=turn(scene.moments) if body and scene.moments else scene.moments,
        torque=law,
    )


def axes_of(turn: Callable[[Triple], Triple]) -> Array:
    return np.array([turn((1.0, 0.0, 0.0)), turn((0.0, 1.0, 0.0)), turn((0.0, 0.0, 1.0))])


def later(torque: StateTorque, by: float) -> StateTorque:
    """Return the torque of t + `by` (s) as a function of t."""
    if torque.tape is None:
        raise InputError(
            "an opaque torque can't be shifted in time; allowed: a torque that can be recorded"
        )

    # The first operation, in the first slot after the inputs, computes the old time.
    def moved(slot: int) -> int:
        return N_INPUTS if slot == TIME else slot + (slot >= N_INPUTS)

    def moved_sum(linear: Linear) -> Linear:
        terms = sorted((moved(slot), factor) for slot, factor in linear.terms)
        return Linear(linear.constant, tuple(terms))

    operations = [Operation("linear", (), Linear(by, ((TIME, 1.0),)))]
    for kind, operands, linear, table in torque.tape.operations:
        if table is not None:
            table = Table(table.breaks - by, table.pieces)
        own = None if linear is None else moved_sum(linear)
        operations.append(Operation(kind, tuple(map(moved, operands)), own, table))
    outputs = tuple(map(moved_sum, torque.tape.outputs))
    return StateTorque(Tape(tuple(operations), outputs), None, torque.needs_attitude)


def restarted_at(
    scene: Scene, omega: Array, by: float, attitude: Quaternion | None = None
) -> Scene:
    """Return the scene whose time 0 is the time `by` (s) of `scene`.

    `omega` (rad/s) and `attitude` are the state then.
    """
    first, second, third = (float(w) for w in omega)
    torque = scene.torque
    if torque.needs_attitude and attitude is None:
        kind = "about the axes of space" if torque.in_space else "that depends on the attitude"
        raise InputError(
            f"a scene with a torque {kind} can't be restarted without the attitude at that time"
        )
    if isinstance(torque, StateTorque):
        torque = later(torque, by)
    else:
        sines: list[Wave] = []
        cosines: list[Wave] = []

        def times(values: Triple, factor: float) -> Triple:
            return values[0] * factor, values[1] * factor, values[2] * factor

        for amplitude, f in torque.sines:
            sines.append((times(amplitude, math.cos(f * by)), f))
            cosines.append((times(amplitude, math.sin(f * by)), f))
        for amplitude, f in torque.cosines:
            cosines.append((times(amplitude, math.cos(f * by)), f))
            sines.append((times(amplitude, -math.sin(f * by)), f))
        c, r = torque.constant, torque.rate
        constant = (c[0] + r[0] * by, c[1] + r[1] * by, c[2] + r[2] * by)
        torque = TorqueLaw(constant, r, tuple(sines), tuple(cosines), torque.frame)
    attitude = scene.attitude if attitude is None else attitude
    return replace(scene, omega=(first, second, third), torque=torque, attitude=attitude)
