"""Power, work and momentum of trajectories, against integrals that SciPy computes beside them."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import Scene, TorqueLaw, opaque, solve
from pyharness.engine.torques.term_file import KINDS
from pyharness.model.trajectory import Array
from pyharness.torques import damping, gravity_gradient, wheels
from tests.engine.test_terms import INERTIA, LAW, H, matrix, stored

MOMENTS = (3.0, 4.0, 5.0)
OMEGA = (0.3, -0.5, 0.8)
ATTITUDE = (0.3, 0.5, -0.2, 0.7)
TIMES = [-1.5, -0.4, 0.0, 0.7, 2.0]
GENTLE = TorqueLaw((0.1, -0.2, 0.3), (0.05, 0.0, 0.1), [((0.3, 0.1, 0.2), 2.0)])


def written(t: Any, omega: Any, q: Any) -> Any:
    """Return a torque that depends on time, omega and attitude."""
    return [0.3 * np.sin(2.0 * t) * q[0], -0.2 * omega[1] ** 3, q[1] * omega[0] / (2.0 + q[2] ** 2)]


def switched(t: float, omega: Array) -> list[float]:
    """Return a torque that no tape can have."""
    return [-0.1 * abs(omega[0]), 0.2, math.floor(0.0 * t) * 1.0]


TORQUES: dict[str, Any] = {
    "law": GENTLE,
    "law in space": TorqueLaw(GENTLE.constant, GENTLE.rate, GENTLE.sines, frame="space"),
    **{name: each.function(**each.sample) for name, each in KINDS.items()},
    "wheels under a law": wheels(0.3 * H, GENTLE),
    "sum": gravity_gradient(INERTIA, 0.7) + damping(0.1) + GENTLE,
    "function": written,
    "opaque": opaque(switched),
}


def scene_with(torque: Any, full: bool = False, **changed: Any) -> Scene:
    """Return the scene of the checks, with principal moments or a full inertia matrix."""
    body: dict[str, Any] = {"inertia": INERTIA} if full else {"moments": MOMENTS}
    return Scene("check", **{"omega": OMEGA, "attitude": ATTITUDE, "torque": torque, **body,
                             **changed})  # fmt: skip


def torque_at(scene: Scene, time: float, omega: Array, attitude: Array) -> Array:
    """Return the torque of a scene about the body axes (N m)."""
    if isinstance(scene.torque, TorqueLaw):
        value = np.array(scene.torque.at(time))
        return matrix(attitude).T @ value if scene.torque.in_space else value
    return np.array(scene.torque.at(time, omega.tolist(), attitude.tolist()))


def integrals(scene: Scene, end: float) -> Array:
    """Return omega, the attitude and the integral of the power at the time `end` (s)."""
    inertia = np.diag(scene.moments) if scene.moments else np.array(scene.inertia)

    def slopes(t: float, state: Array) -> list[float]:
        omega, (a, b, c, d) = state[:3], state[3:7]
        torque = torque_at(scene, t, omega, state[3:7])
        x, y, z = omega
        rate = np.linalg.solve(inertia, torque - np.cross(omega, inertia @ omega))
        turn = [-b * x - c * y - d * z, a * x + c * z - d * y, a * y + d * x - b * z,
                a * z + b * y - c * x]  # fmt: skip
        return [*rate, *(0.5 * np.array(turn)), torque @ omega]

    state = np.array([*scene.omega, *scene.attitude, 0.0])  # type: ignore[misc]
    # Integrations end where a table or a pulse changes.
    stops = [t for t in (-1.0, -0.7, 0.5, 0.7, 1.0) if 0.0 < t / (end or 1.0) < 1.0]
    begin = 0.0
    for stop in [*sorted(stops, key=abs), end]:
        # The smallest change of the time keeps each integration within one piece.
        within = (np.nextafter(begin, stop), np.nextafter(stop, begin))
        found = solve_ivp(slopes, within, state, method="DOP853", rtol=1e-12, atol=1e-14)
        begin, state = stop, found.y[:, -1]
    return state


# An opaque torque can't be transformed to principal axes.
CHECKED = [(name, full) for name in TORQUES for full in (False, True) if name != "opaque"]


@pytest.mark.sampled
@pytest.mark.parametrize(("name", "full"), [*CHECKED, ("opaque", False)])
def test_work_is_the_integral_of_the_power(name: str, full: bool) -> None:
    scene = scene_with(TORQUES[name], full)
    method = "dop853" if name == "opaque" else "auto"
    found: Any = solve(scene, TIMES, method, 1e-11, attitude=True)
    power, work = found.power(), found.work()
    for n, time in enumerate(TIMES):
        torque = torque_at(scene, time, found.omega[n], found.attitude[n])
        assert power[n] == pytest.approx(torque @ found.omega[n], rel=1e-12, abs=1e-12)
        if time:
            assert work[n] == pytest.approx(integrals(scene, time)[7], rel=0.0, abs=3e-10)
    # With a full matrix, omega is transformed to the principal axes and back.
    assert abs(work[TIMES.index(0.0)]) <= (1e-15 if full else 0.0)
    assert np.abs(work).max() > 1e-3
    energy = found.energy()
    assert work == pytest.approx(energy - energy[2], abs=1e-14)
    if name in ("damping", "drag", "magnetic_damping"):
        assert (power < 0.0).all()
        assert (np.diff(work) < 0.0).all()


@pytest.mark.parametrize("end", [3.0, -3.0])
def test_small_work_keeps_its_digits(end: float) -> None:
    """A weak torque accelerates a sphere with much energy, for which the work is known."""
    scene = scene_with(TorqueLaw((0.0, 0.0, 1e-9)), moments=(3.0,) * 3, omega=(0.0, 0.0, 7.3))
    change = 1e-9 * end / 3.0
    wanted = 1e-9 * (7.3 + 0.5 * change) * end  # torque times angle
    found = solve(scene, end)
    energy = 0.5 * 3.0 * 7.3**2
    assert found.work()[0] == pytest.approx(wanted, rel=0.0, abs=3.0 * 7.3 * 2.0**-50)
    # The omega that binary64 has decides the work; the formula adds no error to it.
    exact = 1.5 * (found.omega[0, 2] - 7.3) * (found.omega[0, 2] + 7.3)
    assert found.work()[0] == pytest.approx(exact, rel=1e-14)
    assert abs(found.energy()[0] - energy - exact) > 1e-9 * abs(exact)


def test_steady_wheels_do_no_work_and_motors_do() -> None:
    still = solve(scene_with(wheels(H)), TIMES)
    assert np.abs(still.work()).max() < 1e-11
    assert np.abs(still.power()).max() < 1e-14
    assert np.abs(solve(scene_with(wheels(H, LAW)), TIMES).work()).max() > 0.1


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("motor", [None, LAW])
def test_momentum_of_body_and_wheels_is_constant_in_space(
    full: bool, motor: TorqueLaw | None
) -> None:
    found: Any = solve(scene_with(wheels(H, motor), full), TIMES, attitude=True)
    momenta = [H if motor is None else stored(t) for t in TIMES]
    wheel = [matrix(q) @ h for q, h in zip(found.attitude, momenta, strict=True)]
    total = found.angular_momentum("space") + np.array(wheel)
    assert np.abs(found.angular_momentum("space") - total).max() > 0.5
    assert total == pytest.approx(np.tile(total[2], (len(TIMES), 1)), abs=2e-11)


def test_every_order_of_times_and_no_attitude_have_the_same_work() -> None:
    scene = scene_with(damping(0.3))
    forward = solve(scene, TIMES)
    backward = solve(scene, TIMES[::-1])
    assert backward.work().tolist() == forward.work()[::-1].tolist()
    assert backward.power().tolist() == forward.power()[::-1].tolist()
    # Time is rescaled for a fast body.
    fast = scene_with(TorqueLaw((0.0, 0.0, 1e200)), moments=(3.0,) * 3, omega=(0.0, 0.0, 1e100))
    found = solve(fast, 1e-100)
    assert found.work()[0] == pytest.approx(1e200 * (1.0 + 0.5 / 3.0), rel=1e-12)
    assert found.power()[0] == pytest.approx(1e300 * (1.0 + 1.0 / 3.0), rel=1e-12)


def test_rows_before_an_overflow_have_power_and_work() -> None:
    scene = scene_with(lambda t, w: 3.0 * w / (1.0 - t), moments=(3.0,) * 3)
    found = solve(scene, [0.5, 2.0])
    assert found.ended == "overflow"
    first = 1.5 * np.dot(OMEGA, OMEGA)
    assert found.work() == pytest.approx([3.0 * first], rel=1e-10)
    none = solve(scene, [2.0, 3.0])
    assert none.power().shape == none.work().shape == (0,)
