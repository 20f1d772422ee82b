"""Each ready torque equals an independent formula, in every form of its arguments."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpydoc.validate import validate
from scipy.interpolate import KroghInterpolator
from scipy.spatial.transform import Rotation

from pyharness import Scene, StateTorque, TorqueLaw, events, principal, torques
from pyharness.engine.system.recorded import slopes_of
from pyharness.engine.torques.ready import LAW as LAW_FORM
from pyharness.engine.torques.ready import MATRIX, QUATERNION, VECTOR, Argument
from pyharness.engine.torques.term_file import KINDS
from pyharness.model.scene_file import scene_text
from pyharness.model.trajectory import Array
from pyharness.torques import damping, gravity_gradient, wheels

Formula = Callable[..., Array]  # of time, omega, the matrix R, and arguments by name
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


def vector(t: float, law: Any = LAW) -> Array:
    """Return the value of a law, or of three numbers."""
    if not isinstance(law, TorqueLaw):
        return np.array([0.0] * 3 if law is None else law)
    waves = [np.multiply(a, np.sin(f * t)) for a, f in law.sines]
    waves += [np.multiply(a, np.cos(f * t)) for a, f in law.cosines]
    found: Array = np.array(law.constant) + np.multiply(law.rate, t) + sum(waves, np.zeros(3))
    return found


def stored(t: float, start: Any = H, law: Any = LAW) -> Array:
    """Return `start` plus the integral of a law from 0 to t, by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    values = np.array([vector(t * (1.0 + x) / 2.0, law) for x in nodes])
    found: Array = start + t / 2.0 * (weights @ values)
    return found


def full(value: Any) -> Array:
    """Return a matrix that is specified by a number, its diagonal, or its rows."""
    found: Array = np.array(value, dtype=float)
    return found if found.ndim == 2 else found * np.eye(3)


def matrix(quaternion: Any) -> Array:
    """Return the matrix R from body to space of a quaternion, scalar first."""
    found: Array = Rotation.from_quat(np.roll(quaternion, -1)).as_matrix()
    return found


def control(t: float, omega: Array, r: Array, stiffness: Any, gain: Any, target: Any) -> Array:
    """Return the attitude control, from the error as a matrix."""
    error = matrix(target).T @ r
    # The vector 2 e0 e is the axis times the sine of the angle: the antisymmetric part.
    sine = 0.5 * np.array(
        [error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]]
    )
    return -full(stiffness) @ sine - full(gain) @ omega


def power_of_speed(
    t: float, omega: Array, r: Array, coefficients: Any, per_axis: bool = False
) -> Array:
    sizes = omega if per_axis else np.linalg.norm(omega)
    terms = [full(c) @ (sizes ** (2 * n) * omega) for n, c in enumerate(coefficients)]
    return np.array(-np.sum(terms, axis=0))


def gradient(t: float, omega: Array, r: Array, inertia: Any, rate: float) -> Array:
    up = r.T @ [np.cos(rate * t), np.sin(rate * t), 0.0]
    return 3.0 * rate**2 * np.cross(up, full(inertia) @ up)


def coils(t: float, omega: Array, r: Array, gain: float, field: Any) -> Array:
    """Return the torque of the coils, with the rate of a law by a difference quotient."""
    if not isinstance(field, TorqueLaw):
        b = r.T @ field
        return np.array(-gain * (b @ b * omega - (omega @ b) * b))
    step = 1e-5

    def about_body(dt: float) -> Array:
        found: Array = (r @ Rotation.from_rotvec(omega * dt).as_matrix()).T @ vector(t + dt, field)
        return found

    rate = (about_body(step) - about_body(-step)) / (2.0 * step)
    return np.cross(-gain * rate, about_body(0.0))


def interpolated(
    t: float, omega: Array, r: Array, times: Any, values: Any, interpolation: str = "linear"
) -> Array:
    t = np.clip(t, times[0], times[-1])
    if interpolation == "held":
        return np.array(values[np.searchsorted(times, t, "right") - 1])
    if interpolation == "linear":
        return np.array([np.interp(t, times, column) for column in np.transpose(values)])
    # With four times at most, the spline is one polynomial.
    assert len(times) <= 4
    return np.array(KroghInterpolator(times, values)(t))


def within_pulses(
    t: float, omega: Array, r: Array, starts: Any, durations: Any, torque: Any
) -> Array:
    acting = (np.array(starts) <= t) & (t < np.add(starts, durations))
    return np.array(acting @ np.broadcast_to(torque, (len(starts), 3)))


def spinning(t: float, omega: Array, r: Array, momentum: Any, motor: Any = None) -> Array:
    return -np.cross(omega, stored(t, momentum, motor)) - vector(t, motor)


FORMULAS: dict[str, Formula] = {
    "damping": lambda t, w, r, matrix: -full(matrix) @ w,
    "drag": power_of_speed,
    "rate_control": lambda t, w, r, gain, target=(0, 0, 0): -full(gain) @ (w - target),
    "attitude_control": lambda t, w, r, stiffness, gain, target=(1, 0, 0, 0): control(
        t, w, r, stiffness, gain, target
    ),
    "wheels": spinning,
    "gravity_gradient": gradient,
    "magnetic_dipole": lambda t, w, r, moment, field: np.cross(moment, r.T @ vector(t, field)),
    "magnetic_damping": coils,
    "in_space": lambda t, w, r, torque: r.T @ vector(t, torque),
    "table": interpolated,
    "pulses": within_pulses,
}


def forms(argument: Argument, form: Any) -> list[Any]:
    """Return values of an argument's form."""
    if "enum" in form:
        return list(form["enum"])
    if "anyOf" in form:
        return [value for each in form["anyOf"] for value in forms(argument, each)]
    if form.get("items") == MATRIX:
        return [forms(argument, MATRIX)]
    if form.get("items") == VECTOR and argument.form != form:
        return [[V.tolist(), M.tolist()]]
    if argument.is_of_body:
        return [MOMENTS, INERTIA.tolist()]
    found: dict[str, list[Any]] = {
        str(VECTOR): [V.tolist()], str(MATRIX): [0.3, V.tolist(), D.tolist()],
        str(LAW_FORM): [V.tolist(), LAW_IN_SPACE if argument.frame == "space" else LAW],
        str(QUATERNION): [TARGET], "boolean": [True],
    }  # fmt: skip
    return found.get(form.get("type", str(form)), [])


def samples() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield names of ready torques with arguments in all forms, and without the optional ones."""
    for name, ready in KINDS.items():
        yield name, ready.sample
        yield name, {key: x for key, x in ready.sample.items() if key not in ready.defaults}
        for key, argument in ready.arguments.items():
            for value in forms(argument, argument.form):
                yield name, ready.sample | {key: value}


CASES: dict[str, tuple[StateTorque, Formula]] = {
    f"{name} {number}": (KINDS[name].function(**given), partial(FORMULAS[name], **given))
    for number, (name, given) in enumerate(samples())
}


def limit(formula: Any) -> float:
    """Return the error of a formula; a difference quotient is less accurate than others."""
    return (
        1e-8
        if formula.func is coils and isinstance(formula.keywords["field"], TorqueLaw)
        else 1e-13
    )


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
        error = np.abs(torque.at(t, omega, attitude) - wanted).max()
        assert error < limit(formula) * (1.0 + np.abs(wanted).max())
        # The negative of a quaternion is the same attitude.
        assert torque.at(t, omega, -attitude) == torque.at(t, omega, attitude)
        turns = np.abs(formula(t, omega, matrix(attitude[::-1])) - wanted).max() > 0.0
        assert torque.needs_attitude == turns


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
    masses, distance = np.random.default_rng(62).uniform(1, 2, 3), 1e4
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


@pytest.mark.parametrize(
    "name",
    [f"torques.{n}" for n in torques.__all__ if n != "opaque"]
    + [f"events.{n}" for n in events.__all__ if n != "Event"],
)
def test_docstrings_are_complete(name: str) -> None:
    errors = validate(f"pyharness.{name}")["errors"]
    allowed = ("SA01", "SA04") + ("ES01",) * name.startswith("events.")
    assert [each for each in errors if each[0] not in allowed] == []
