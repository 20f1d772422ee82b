"""Each torque term equals an independent formula, about the axes of the body."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpydoc.validate import validate
from scipy.spatial.transform import Rotation

from pyharness import Scene, StateTorque, TorqueLaw, principal, torques
from pyharness.engine.recorded import slopes_of
from pyharness.model.scene_file import scene_text
from pyharness.model.trajectory import Array
from pyharness.torques import (
    attitude_control,
    damping,
    drag,
    gravity_gradient,
    in_space,
    magnetic_damping,
    magnetic_dipole,
    rate_control,
    wheels,
)

Formula = Callable[[float, Array, Array], Array]  # of time, omega and the matrix R
SOURCE = np.random.default_rng(60)
D = SOURCE.normal(size=(3, 3))
K = SOURCE.normal(size=(3, 3))
V, M, H = SOURCE.normal(size=(3, 3))
INERTIA = np.array([[3.0, 0.4, -0.2], [0.4, 4.0, 0.3], [-0.2, 0.3, 5.0]])
MOMENTS = (2.0, 3.0, 4.0)
TARGET = (0.5, -0.1, 0.7, 0.5)
C0, RATE, S1, S2, C1, C2 = SOURCE.normal(size=(6, 3))
WAVES: dict[str, Any] = {
    "sines": [(S1, 1.5), (S2, 0.7), (S2, 0.0)],
    "cosines": [(C1, 2.0), (C2, 0.0)],
}
LAW = TorqueLaw(C0, RATE, **WAVES)
LAW_IN_SPACE = TorqueLaw(C0, RATE, **WAVES, frame="space")
ORBIT = 1.3


def vector(t: float) -> Array:
    """Return the value of LAW."""
    found: Array = C0 + RATE * t + S1 * np.sin(1.5 * t) + S2 * np.sin(0.7 * t)
    found += C1 * np.cos(2.0 * t) + C2
    return found


def momentum(t: float) -> Array:
    """Return H plus the integral of LAW from 0 to t, by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    values = np.array([vector(t * (1.0 + x) / 2.0) for x in nodes])
    found: Array = H + t / 2.0 * (weights @ values)
    return found


def matrix(quaternion: Any) -> Array:
    """Return the matrix R from body to space of a quaternion, scalar first."""
    found: Array = Rotation.from_quat(np.roll(quaternion, -1)).as_matrix()
    return found


def control(t: float, omega: Array, r: Array) -> Array:
    """Return the attitude control with the matrices D and K, from the error as a matrix."""
    error = matrix(TARGET).T @ r
    # The vector 2 e0 e is the axis times the sine of the angle: the antisymmetric part.
    sine = 0.5 * np.array(
        [error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]]
    )
    return -D @ sine - K @ omega


def gradient(inertia: Array) -> Formula:
    def torque(t: float, omega: Array, r: Array) -> Array:
        up = r.T @ [np.cos(ORBIT * t), np.sin(ORBIT * t), 0.0]
        return 3.0 * ORBIT**2 * np.cross(up, inertia @ up)

    return torque


def coils(t: float, omega: Array, r: Array) -> Array:
    """Return the torque of the coils, with the rate of the field by a difference quotient."""
    step = 1e-5

    def field(dt: float) -> Array:
        turn = Rotation.from_rotvec(omega * dt).as_matrix()
        found: Array = (r @ turn).T @ vector(t + dt)
        return found

    rate = (field(step) - field(-step)) / (2.0 * step)
    return np.cross(-0.8 * rate, field(0.0))


CASES: dict[str, tuple[StateTorque, Formula]] = {
    "damping": (damping(D), lambda t, w, r: -D @ w),
    "damping by a number": (damping(0.3), lambda t, w, r: -0.3 * w),
    "damping by axes": (damping(V), lambda t, w, r: -V * w),
    "drag": (drag([0.2, D, V]), lambda t, w, r: -0.2 * w - D @ w * (w @ w) - V * w * (w @ w) ** 2),
    "cubic drag": (drag([0, 2]), lambda t, w, r: -2.0 * np.linalg.norm(w) ** 2 * w),
    "drag by axes": (
        drag([0.2, D, V], per_axis=True),
        lambda t, w, r: -0.2 * w - D @ w**3 - V * w**5,
    ),
    "rate control": (rate_control(K, V), lambda t, w, r: -K @ (w - V)),
    "attitude control": (attitude_control(D, K, TARGET), control),
    "wheels": (wheels(H), lambda t, w, r: -np.cross(w, H)),
    "wheels with motors": (wheels(H, LAW), lambda t, w, r: -np.cross(w, momentum(t)) - vector(t)),
    "wheels with a constant motor": (wheels(H, V), lambda t, w, r: -np.cross(w, H + t * V) - V),
    "gravity gradient, moments": (gravity_gradient(MOMENTS, ORBIT), gradient(np.diag(MOMENTS))),
    "gravity gradient, matrix": (gravity_gradient(INERTIA, ORBIT), gradient(INERTIA)),
    "dipole": (magnetic_dipole(M, V), lambda t, w, r: np.cross(M, r.T @ V)),
    "dipole in a field of time": (
        magnetic_dipole(M, LAW_IN_SPACE),
        lambda t, w, r: np.cross(M, r.T @ vector(t)),
    ),
    "coils": (magnetic_damping(0.8, LAW_IN_SPACE), coils),
    "coils in a constant field": (
        magnetic_damping(0.8, V),
        lambda t, w, r: -0.8 * (V @ V * w - (w @ (r.T @ V)) * (r.T @ V)),
    ),
    "in space": (in_space(LAW_IN_SPACE), lambda t, w, r: r.T @ vector(t)),
    "constant in space": (in_space(V), lambda t, w, r: r.T @ V),
}
# A difference quotient is less accurate than the other formulas.
LIMITS = {"coils": 1e-8}
IN_BODY = ("damping", "drag", "rate control", "wheels")


def states(count: int) -> list[tuple[float, Any, Any]]:
    """Return random times, angular velocities and attitudes."""
    source = np.random.default_rng(61)
    quaternions = source.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    return [(source.uniform(-3, 3), source.normal(size=3), each) for each in quaternions]


@pytest.mark.parametrize("name", CASES)
def test_a_term_equals_its_formula(name: str) -> None:
    torque, formula = CASES[name]
    for t, omega, attitude in states(20):
        wanted = formula(t, omega, matrix(attitude))
        limit = LIMITS.get(name, 1e-13) * (1.0 + np.abs(wanted).max())
        assert np.abs(torque.at(t, omega, attitude) - wanted).max() < limit
        # The negative of a quaternion is the same attitude.
        assert torque.at(t, omega, -attitude) == torque.at(t, omega, attitude)
    assert torque.needs_attitude is not any(each in name for each in IN_BODY)


def test_the_file_of_wheels_has_the_motor_that_was_given() -> None:
    for motor in (None, V):
        text = scene_text(Scene("", (1, 0, 0), moments=MOMENTS, torque=wheels(H, motor)))
        assert ("motor" in text) == (motor is not None)


def test_wheels_with_a_slow_motor_have_no_cancellation() -> None:
    slow = wheels((0, 0, 0), TorqueLaw(sines=[((0, 0, 1.0), 1e-9)]))
    # The momentum is f t^2/2 to 18 digits, and the motor's torque f t.
    found = slow.at(2.0, (1.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    assert found == pytest.approx((-2e-9, 2e-9, -2e-9), rel=1e-15, abs=0.0)


def test_gravity_gradient_is_the_torque_of_newtons_law() -> None:
    """The torque on six masses, far from the centre, differs in the order of size/distance."""
    source = np.random.default_rng(62)
    masses, distance = source.uniform(1, 2, 3), 1e4
    points = np.concatenate([np.diag([1.0, 1.5, 0.7]), -np.diag([1.0, 1.5, 0.7])])
    weights = np.concatenate([masses, masses])
    inertia = sum(
        w * (p @ p * np.eye(3) - np.outer(p, p)) for p, w in zip(points, weights, strict=True)
    )
    torque = gravity_gradient(np.diag(inertia), ORBIT)
    for t, _, attitude in states(3):
        r = matrix(attitude)
        place = distance * np.array([np.cos(ORBIT * t), np.sin(ORBIT * t), 0.0])
        wanted = np.zeros(3)
        for point, weight in zip(points, weights, strict=True):
            x = place + r @ point
            force = -(ORBIT**2) * distance**3 * weight * x / np.linalg.norm(x) ** 3
            wanted += r.T @ np.cross(r @ point, force)
        assert np.abs(torque.at(t, [0.0] * 3, attitude) - wanted).max() < 1e-3


def test_differences_of_nearly_equal_moments_are_exact() -> None:
    least = 2.0**-52
    torque = gravity_gradient((1.0, 1.0, 1.0 + least), 1.0)
    for _, omega, attitude in states(5):
        x, y, z = matrix(attitude)[0]
        wanted = 3.0 * least * np.array([y * z, -x * z, 0.0])
        assert torque.at(0.0, omega, attitude) == pytest.approx(wanted, rel=1e-12, abs=1e-40)


def test_the_components_are_about_the_axes_of_the_body_not_the_principal_ones() -> None:
    total = sum((torque for torque, _ in CASES.values()), damping(0.0))
    scene = Scene("full", (0.0, 0.0, 1.0), inertia=INERTIA, torque=total, attitude=(1, 0, 0, 0))
    bare, axes = principal(scene)
    slopes = slopes_of(bare)
    assert np.abs(axes - np.eye(3)).max() > 0.1
    for t, omega, attitude in states(10):
        r = matrix(attitude)
        torque = sum(formula(t, omega, r) for _, formula in CASES.values())
        wanted = np.linalg.solve(INERTIA, torque - np.cross(omega, INERTIA @ omega))
        turned = np.roll(Rotation.from_matrix(r @ axes).as_quat(), 1)
        found = axes @ slopes(t, [*(axes.T @ omega), *turned])[:3]
        assert found == pytest.approx(wanted, rel=1e-7, abs=1e-7)


# The documentation.


@pytest.mark.parametrize("name", [n for n in torques.__all__ if n != "opaque"])
def test_docstrings_are_complete(name: str) -> None:
    errors = validate(f"pyharness.torques.{name}")["errors"]
    assert [each for each in errors if each[0] not in ("SA01", "SA04")] == []
