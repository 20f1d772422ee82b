"""Integrals of the motion under the torque terms, with SciPy's integrator."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import Scene, TorqueLaw
from pyharness.dynamics.system import slopes_of
from pyharness.model.trajectory import Array
from pyharness.torques import (
    attitude_control,
    damping,
    drag,
    gravity_gradient,
    magnetic_damping,
    magnetic_dipole,
    rate_control,
    wheels,
)
from tests.dynamics.test_terms import LAW, MOMENTS, ORBIT, TARGET, D, H, M, V, matrix, momentum


def integrated(scene: Scene, end: float, power: Any = None) -> tuple[Array, Array]:
    """Return 50 times and the states at these times, with the integral of `power` appended."""
    slopes = slopes_of(scene)
    assert scene.attitude is not None

    def right(t: float, state: Array) -> list[float]:
        # A term of the wrong sign would otherwise accelerate the body, and take for ever.
        assert np.abs(state[:3]).max() < 100.0
        found = slopes(t, state[:7].tolist())
        return [*found, power(t, state)] if power else found

    start = [*scene.omega, *scene.attitude] + ([0.0] if power else [])
    times = np.linspace(0.0, end, 50)
    found = solve_ivp(
        right, (0.0, end), start, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times
    )
    assert found.success
    return times, found.y.T


def scene_with(torque: Any, **changed: Any) -> Scene:
    """Return the scene of the checks, about principal axes, with a torque."""
    fields: dict[str, Any] = {
        "omega": (0.3, -0.5, 0.8),
        "moments": MOMENTS,
        "attitude": (0.3, 0.5, -0.2, 0.7),
    }
    return Scene("check", torque=torque, **(fields | changed))


def test_damping_loses_the_energy_that_it_dissipates() -> None:
    dissipating = D @ D.T
    scene = scene_with(damping(dissipating))
    _, found = integrated(scene, 2.0, lambda t, s: s[:3] @ dissipating @ s[:3])
    energy = 0.5 * (found[:, :3] ** 2 @ MOMENTS)
    assert energy[-1] < 0.5 * energy[0]
    assert np.abs(energy + found[:, 7] - energy[0]).max() < 1e-11


def test_cubic_drag_follows_its_closed_form() -> None:
    """For a sphere, the equation I w' = -k w^3 has the solution w0/sqrt(1 + 2 k w0^2 t/I)."""
    scene = scene_with(drag([0.0, 0.7]), moments=(2.0, 2.0, 2.0))
    times, found = integrated(scene, 5.0)
    start = np.linalg.norm(scene.omega)
    wanted = start / np.sqrt(1.0 + 0.7 * start**2 * times)
    assert np.linalg.norm(found[:, :3], axis=1) == pytest.approx(wanted, rel=1e-11)


def test_rate_control_reaches_its_target() -> None:
    scene = scene_with(rate_control(4.0, (0.0, 0.0, 0.4)))
    _, found = integrated(scene, 40.0)
    assert found[-1, :3] == pytest.approx((0.0, 0.0, 0.4), abs=1e-9)


@pytest.mark.parametrize("motor", [None, LAW])
def test_wheels_keep_the_momentum_in_space(motor: TorqueLaw | None) -> None:
    times, found = integrated(scene_with(wheels(H, motor)), 5.0)
    stored = np.array([H if motor is None else momentum(t) for t in times])
    body = found[:, :3] * MOMENTS + stored
    space = [matrix(q) @ each for q, each in zip(found[:, 3:], body, strict=True)]
    assert np.abs(space - space[0]).max() < 1e-10
    if motor is None:
        length = np.linalg.norm(body, axis=1)
        assert np.abs(length - length[0]).max() < 1e-11
        # A constant momentum of the wheels does no work.
        energy = found[:, :3] ** 2 @ MOMENTS
        assert np.abs(energy - energy[0]).max() < 1e-10


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
            gravity_gradient(moments, ORBIT),
            moments=moments,
            omega=(0.0, 0.0, ORBIT),
            attitude=(np.cos(first / 2.0), 0.0, 0.0, np.sin(first / 2.0)),
        )
        times, found = integrated(scene, 3.0)
        turned = 2.0 * np.unwrap(np.arctan2(found[:, 6], found[:, 3])) - ORBIT * times
        wanted = np.cosh(rate * times) if grows else np.cos(rate * times)
        assert turned - (first - angle) == pytest.approx(angle * wanted, abs=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_attitude_control_reaches_its_target(sign: float) -> None:
    """The quaternion that is nearer to the start is reached: the body does not unwind."""
    control = attitude_control(3.0, 4.0, TARGET)
    start = sign * np.array([0.6, -0.1, 0.5, 0.4])
    scene = scene_with(control, attitude=start, omega=(0.0, 0.0, 0.0))
    _, found = integrated(scene, 60.0)
    assert found[-1, :3] == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert found[-1, 3:] == pytest.approx(sign * np.array(TARGET), abs=1e-9)


def test_the_spring_of_attitude_control_has_its_potential() -> None:
    scene = scene_with(attitude_control(3.0, 0.0, TARGET))
    _, found = integrated(scene, 5.0)
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


def test_coils_stop_the_rotation_across_the_field_and_follow_one_that_rotates() -> None:
    rotating = TorqueLaw(
        sines=[((0.0, 1.0, 0.0), 0.3)], cosines=[((1.0, 0.0, 0.0), 0.3)], frame="space"
    )
    for field, wanted in (((1.0, 0.0, 0.0), 0.0), (rotating, 0.3)):
        scene = scene_with(magnetic_damping(2.0, field), moments=(2.0, 2.0, 2.0))
        _, found = integrated(scene, 60.0)
        space = matrix(found[-1, 3:]) @ found[-1, :3]
        assert space[2] == pytest.approx(wanted, abs=1e-6)
