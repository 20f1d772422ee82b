"""Scenes with a torque that depends on the state, about other axes and with another time 0."""

from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, StateTorque, solve, torques
from pyharness.checks.scenes.state_scenes import READY, STEADY, TURNING, draw, ready
from pyharness.engine.problem.rotated import axes_of, later, restarted_at, rotated
from pyharness.model.scene import Triple

MOMENTS = [4.0, 3.0, 2.0]


def torque_of(name: str, source: Random) -> StateTorque:
    """Return a random torque of one kind."""
    if name in READY:
        return ready(source, name, MOMENTS, 1.5)
    torque = draw(source, (name,))[0].torque
    assert isinstance(torque, StateTorque)
    return torque


@pytest.mark.parametrize("name", [*READY, *STEADY, *TURNING])
def test_later_torque_has_the_values_of_the_later_time(name: str) -> None:
    source = Random(f"later {name}")
    torque = torque_of(name, source)
    for by in (0.0, 0.7, -1.3):
        shifted = later(torque, by)
        assert shifted.needs_attitude == torque.needs_attitude
        for _ in range(5):
            time, *state = (source.uniform(-1.0, 1.0) for _ in range(8))
            omega, attitude = state[:3], state[3:]
            wanted = torque.at(time + by, omega, attitude)
            assert shifted.at(time, omega, attitude) == pytest.approx(wanted, rel=1e-12, abs=1e-12)


def _cyclic(v: Triple) -> Triple:
    return v[1], v[2], v[0]


def test_rotated_scene_has_the_rotated_motion() -> None:
    moments = (4.0, 3.0, 2.0)

    def torque(t: float, w: np.ndarray) -> list[float]:
        return [-0.1 * w[0] + w[1] * w[2], np.sin(t * w[1]), -0.3 * w[2]]

    scene = Scene("plain", (0.3, 1.0, -0.5), moments=moments, torque=torque)
    other = rotated(scene, _cyclic, body=True)
    assert other.moments == (3.0, 2.0, 4.0)
    plain, turned = (solve(each, 2.0).omega[0] for each in (scene, other))
    assert axes_of(_cyclic) @ turned == pytest.approx(plain, abs=1e-12)
    assert turned.tolist() == pytest.approx(list(_cyclic(tuple(plain))), abs=1e-12)


def test_motion_continues_after_a_restart() -> None:
    table = torques.table([0.5, 1.0, 1.5], np.eye(3), "linear")
    torque = table + torques.gravity_gradient(MOMENTS, 0.7)
    scene = Scene("whole", (0.3, 1.0, -0.5), moments=MOMENTS, torque=torque, attitude=(1, 0, 0, 0))
    whole: Any = solve(scene, [0.8, 2.0], attitude=True)
    w, x, y, z = whole.attitude[0].tolist()
    rest: Any = solve(restarted_at(scene, whole.omega[0], 0.8, (w, x, y, z)), 1.2, attitude=True)
    assert rest.omega[0] == pytest.approx(whole.omega[1], abs=3e-12)
    assert rest.attitude[0] == pytest.approx(whole.attitude[1], abs=3e-12)
