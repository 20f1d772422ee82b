"""Conversion of changing inertias and torques in space to torques about the body axes."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from pyharness.model.attitude import IDENTITY
from pyharness.model.changing import rates_of_changing
from pyharness.model.principal import principal
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque, has_switches, of_law, replayed, torque_of
from pyharness.model.tape import Tape
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import Matrix


def integrated(scene: Scene) -> Scene:
    """Return the scene about principal axes or, under a torque with switches, body axes."""
    torque = scene.torque
    if scene.inertia is None or uses_principal_axes(scene):
        return principal(scene)[0]
    # Rounding in a rotation might move the initial state off a switch's threshold.
    assert isinstance(torque, StateTorque)
    assert torque.tape is not None
    rates = _rates(torque.tape, torque.own, scene.inertia)
    return replace(scene, inertia=None, coefficients=(0.0, 0.0, 0.0), torque=rates)


def uses_principal_axes(scene: Scene) -> bool:
    return scene.inertia is not None and not has_switches(scene.torque)


@lru_cache(maxsize=64)
def _rates(tape: Tape, own: tuple[str, ...], inertia: Matrix) -> StateTorque:
    def rates(time: Any, omega: Any, q: Any, *states: Any) -> list[Any]:
        torque = np.array(torque_of(tape, time, omega, q, *states))
        return [*rates_about_body_axes(inertia, omega, torque[:3]), *torque[3:]]

    return replayed(rates, own)


def rates_about_body_axes(inertia: Matrix, omega: Any, torque: Any) -> Any:
    """Return omega' (rad/s2) for a full inertia matrix; all vectors are about the body axes."""
    about, axes = principal(Scene("", (0.0, 0.0, 0.0), inertia=inertia))
    x, y, z = omega @ axes
    # About the body axes, large terms would cancel.
    products = np.array(about.euler_coefficients) * np.array([y * z, z * x, x * y])
    return axes @ (products + torque @ axes / np.array(about.moments))


def with_constant_body(scene: Scene) -> Scene:
    """Return a scene of the same solution, with constant inertia and no torque about space axes."""
    changing, torque = scene.changing, scene.torque
    if changing is None:
        return replace(scene, torque=of_law(scene.law)) if torque.in_space else scene
    # Euler's coefficients become 0, and the torque becomes omega', which follows from
    # I omega' = N - I' omega - omega x (I omega), with inertia I and torque N.
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
