"""Conversion of changing inertias and torques in space to torques about the body axes."""

from dataclasses import replace
from typing import Any

from pyharness.model.attitude import IDENTITY
from pyharness.model.changing import rates_of_changing
from pyharness.model.scene import Scene
from pyharness.model.state_torque import of_law, replayed, torque_of
from pyharness.model.torque_law import TorqueLaw


def with_constant_body(scene: Scene) -> Scene:
    """Return a scene of the same solution with a constant inertia and a torque about the body axes.

    For a changing inertia I and torque N, the new coefficients are 0. The new torque is omega' from
    I omega' = N - I' omega - omega x (I omega).
    """
    changing, torque = scene.changing, scene.torque
    if changing is None:
        return replace(scene, torque=of_law(scene.law)) if torque.in_space else scene
    if isinstance(torque, TorqueLaw):
        torque = of_law(torque)
    tape = torque.tape
    if tape is not None:

        def rates(time: Any, omega: Any, q: Any, *own: Any) -> list[Any]:
            torque = torque_of(tape, time, omega, q, *own)
            return [*rates_of_changing(changing, time, omega, torque[:3]), *torque[3:]]

        found = replayed(rates, torque.own)
    else:
        found = replace(
            torque,
            function=lambda time, omega, q=IDENTITY: rates_of_changing(
                changing, time, omega, torque.at(time, omega, q)
            ),
        )
    return replace(scene, changing=None, coefficients=(0.0, 0.0, 0.0), torque=found)
