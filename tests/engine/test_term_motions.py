"""Integrals of the motion under the torque terms."""

from typing import Any

import numpy as np
import pytest

from pyharness import Scene, solve
from pyharness.model.trajectory import Array
from pyharness.torques import attitude_control, gravity_gradient, magnetic_dipole
from tests.engine.test_terms import MOMENTS, ORBIT, TARGET, M, V, matrix


def integrated(scene: Scene, end: float) -> tuple[Array, Array]:
    """Return 50 times, and omega and the attitude at these times."""
    found = solve(scene, np.linspace(0.0, end, 50), tolerance=1e-13, attitude=True)
    return found.time, found.y.T


def scene_with(torque: Any, **changed: Any) -> Scene:
    fields: dict[str, Any] = {
        "omega": (0.3, -0.5, 0.8),
        "moments": MOMENTS,
        "attitude": (0.3, 0.5, -0.2, 0.7),
    }
    return Scene("check", torque=torque, **(fields | changed))


def test_gravity_gradient_keeps_jacobis_integral() -> None:
    times, found = integrated(scene_with(gravity_gradient(MOMENTS, ORBIT)), 10.0)
    jacobi, energy = [], []
    for t, state in zip(times, found, strict=True):
        omega, r = state[:3], matrix(state[3:])
        up = r.T @ [np.cos(ORBIT * t), np.sin(ORBIT * t), 0.0]
        energy.append(0.5 * omega @ (MOMENTS * omega))
        potential = 1.5 * ORBIT**2 * up @ (MOMENTS * up)
        jacobi.append(energy[-1] - ORBIT * (r @ (MOMENTS * omega))[2] + potential)
    assert np.ptp(energy) > 0.1
    assert np.ptp(jacobi) < 1e-10


def test_a_rod_along_the_vertical_librates_and_across_it_leaves() -> None:
    """A small angle oscillates at the rate n sqrt(3 (I2 - I1)/I3), the known result."""
    moments = (1.0, 3.0, 3.0)
    rate = ORBIT * np.sqrt(3.0 * 2.0 / 3.0)
    angle = 1e-6
    for first, grows in ((angle, False), (np.pi / 2.0 + angle, True)):
        scene = scene_with(
            gravity_gradient(moments, ORBIT), moments=moments, omega=(0.0, 0.0, ORBIT),
            attitude=(np.cos(first / 2.0), 0.0, 0.0, np.sin(first / 2.0)),
        )  # fmt: skip
        times, found = integrated(scene, 3.0)
        turned = 2.0 * np.unwrap(np.arctan2(found[:, 6], found[:, 3])) - ORBIT * times
        wanted = np.cosh(rate * times) if grows else np.cos(rate * times)
        assert turned - (first - angle) == pytest.approx(angle * wanted, abs=1e-9)


def test_the_spring_of_attitude_control_has_its_potential() -> None:
    _, found = integrated(scene_with(attitude_control(3.0, 0.0, TARGET)), 5.0)
    cosine = [(np.trace(matrix(TARGET).T @ matrix(q)) - 1.0) / 2.0 for q in found[:, 3:]]
    energy = 0.5 * (found[:, :3] ** 2 @ MOMENTS)
    total = energy + 3.0 * (1.0 - np.array(cosine))
    assert np.ptp(energy) > 0.1
    assert np.ptp(total) < 1e-10


def test_a_dipole_keeps_the_momentum_about_a_constant_field() -> None:
    _, found = integrated(scene_with(magnetic_dipole(M, V)), 5.0)
    space = np.array([matrix(s[3:]) @ (MOMENTS * s[:3]) for s in found])
    energy = 0.5 * (found[:, :3] ** 2 @ MOMENTS)
    potential = np.array([-M @ matrix(q).T @ V for q in found[:, 3:]])
    assert np.ptp(space @ [1.0, 0.0, 0.0]) > 0.1
    assert np.ptp(space @ V) < 1e-10
    assert np.ptp(energy + potential) < 1e-10
