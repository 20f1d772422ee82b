"""Scenes with other axes, other signs, or another time 0."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pyharness.engine.system.parameters import varied_expression
from pyharness.model.attitude import Quaternion
from pyharness.model.changing import Changing, ChangingInertia, ChangingMoments
from pyharness.model.errors import InputError
from pyharness.model.inertia_function import InertiaFunction
from pyharness.model.scene import Scene, Triple, checked_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import TIME, Linear, Operation, Table, Tape
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
    parts: Any = tuple(later_law(x, by) if isinstance(x, TorqueLaw) else later(x, by)
                       for x in torque.parts)  # fmt: skip
    if torque.tape is None:
        return replace(torque, function=partial(call_later, torque.function, by))
    varied, named = torque.varied, torque.parameters
    if torque.constants:
        varied, named = varied_expression(torque), torque.constants
    return replace(
        torque, tape=later_tape(torque.tape, by), varied=varied and later_tape(varied, by),
        parameters=named, parts=parts, expression=(), constants=(), terms=(),
    )  # fmt: skip


def call_later(function: Any, by: float, time: Any, *state: Any) -> Any:
    return function(time + by, *state)


def later_tape(tape: Tape, by: float) -> Tape:
    """Return the function of t + `by` (s) as a function of t."""
    n = tape.n_inputs

    # The first operation, in the first slot after the inputs, computes the old time.
    def moved(slot: int) -> int:
        return n if slot == TIME else slot + (slot >= n)

    def moved_sum(linear: Linear) -> Linear:
        terms = sorted((moved(slot), factor) for slot, factor in linear.terms)
        return Linear(linear.constant, tuple(terms))

    operations = [Operation("linear", (), Linear(by, ((TIME, 1.0),)))]
    for kind, operands, linear, table in tape.operations:
        if table is not None:
            table = Table(table.breaks - by, table.pieces)
        own = None if linear is None else moved_sum(linear)
        operations.append(Operation(kind, tuple(map(moved, operands)), own, table))
    return Tape(tuple(operations), tuple(map(moved_sum, tape.outputs)), n)


def later_law(law: TorqueLaw, by: float) -> TorqueLaw:
    sines: list[Wave] = []
    cosines: list[Wave] = []

    def times(values: Triple, factor: float) -> Triple:
        return values[0] * factor, values[1] * factor, values[2] * factor

    for amplitude, f in law.sines:
        sines.append((times(amplitude, math.cos(f * by)), f))
        cosines.append((times(amplitude, math.sin(f * by)), f))
    for amplitude, f in law.cosines:
        cosines.append((times(amplitude, math.cos(f * by)), f))
        sines.append((times(amplitude, -math.sin(f * by)), f))
    c, r = law.constant, law.rate
    constant = (c[0] + r[0] * by, c[1] + r[1] * by, c[2] + r[2] * by)
    found = TorqueLaw(constant, r, tuple(sines), tuple(cosines), law.frame)
    if law.named is not None:
        object.__setattr__(found, "named", later(law.named, by))
    return found


def later_inertia(changing: Changing, by: float) -> Changing:
    if isinstance(changing, InertiaFunction):
        return replace(changing, tape=later_tape(changing.tape, by), written=())
    if isinstance(changing, ChangingMoments):
        return ChangingMoments(_shifted(changing.polynomials, by))
    assert isinstance(changing, ChangingInertia)
    matrices = np.moveaxis(np.array(changing.matrices), 0, -1)
    return ChangingInertia(np.moveaxis(_shifted(matrices, by), -1, 0))


def _shifted(polynomials: Any, by: float) -> Any:
    """Return coefficients of p(t + `by`) in the last axis, from those of p(t)."""
    if not isinstance(polynomials, np.ndarray):
        return [_shifted(np.array(each), by) for each in polynomials]
    found = np.zeros_like(polynomials)
    for k in range(polynomials.shape[-1])[::-1]:  # Horner's scheme
        found[..., 1:] = found[..., :-1] + by * found[..., 1:]
        found[..., 0] = by * found[..., 0]
        found[..., 0] += polynomials[..., k]
    return found


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
    torque = later(torque, by) if isinstance(torque, StateTorque) else later_law(torque, by)
    attitude = scene.attitude if attitude is None else attitude
    moved = scene if scene.changing is None else _with_inertia(scene, by)
    return replace(moved, omega=(first, second, third), torque=torque, attitude=attitude, t0=0.0)


def _with_inertia(scene: Scene, by: float) -> Scene:
    assert scene.changing is not None
    return replace(scene, changing=later_inertia(scene.changing, by))
