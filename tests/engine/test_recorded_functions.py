"""Recorded functions have the values of NumPy, also with switches of a tilted body."""

import math
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pyharness import InputError, Scene, Taylor, prepare, principal, solve
from pyharness.model.state_torque import recorded
from tests.engine.entry_points import ball, check_ends, ends_of
from tests.refused import refused

Torque = Callable[[Any, Any], Any]


_TILTED = np.array([[3.0, 0.3, -0.2], [0.3, 4.0, 0.1], [-0.2, 0.1, 2.5]])


def _friction(t: Any, w: Any) -> Any:
    return [-0.3 * w[0], -0.3 * w[1] * np.abs(w[1]), 0.0]


def _push(t: Any, w: Any) -> Any:
    return [np.where(w[1] > 0.0, -1.0, 1.0) * w[0], np.where(np.sin(w[1]) > 0.0, 2.0, -2.0), 0.0]


@pytest.mark.parametrize("omega", [(1.2, 0.0, -0.36), (1.3, 0.0, -0.36), (0.05, 0.0, 0.0)])
@pytest.mark.parametrize("torque", [_friction, _push])
def test_a_component_of_a_tilted_body_may_begin_at_a_level(torque: Torque, omega: Any) -> None:
    """Regression test: rounding errors of principal axes moved it off, so that results differed."""

    def slope(t: float, w: Any) -> Any:
        total = np.array(torque(t, w), dtype=float) - np.cross(w, _TILTED @ w)
        return np.linalg.solve(_TILTED, total)

    scene = Scene("", omega, torque=torque, inertia=_TILTED)
    truth = solve_ivp(slope, (0.0, 1.0), omega, rtol=1e-8, atol=1e-10, max_step=0.1).y[:, -1]
    check_ends(ends_of(scene, 1.0), truth, abs=1e-6)
    found: Any = solve(scene, 1.0, dense_output=True)
    assert found.sol.derivative(0.0)[:3] == pytest.approx(slope(0.0, np.array(omega)), abs=1e-12)
    assert found.energy()[-1] == pytest.approx(0.5 * truth @ _TILTED @ truth, abs=1e-6)


@pytest.mark.parametrize("omega", [(1.2, 0.0, -0.36), (1.3, 0.0, -0.36), (0.7, 0.0, 0.2)])
def test_an_operand_that_begins_as_a_rounding_error_may_cross_its_level(omega: Any) -> None:
    """Regression test: a step to its root was rejected until the work limit."""
    scene = principal(Scene("", omega, torque=_friction, inertia=_TILTED))[0]
    assert solve(scene, 1.0).ended == "complete"
    assert solve(scene, 1e-3).ended == "complete"


def test_a_tilted_symmetric_body_keeps_its_digits_in_a_long_motion() -> None:
    """Regression test: its error was five times the tolerance, because large products cancelled."""
    turn = Rotation.from_rotvec((0.4, 0.2, 0.7)).as_matrix()
    inertia = turn @ np.diag([1.0, 1.0, 0.3]) @ turn.T
    scene = Scene(
        "", turn @ [0.7, 0.0, 0.05], inertia=0.5 * (inertia + inertia.T),
        torque=lambda t, w: [np.where(w @ w > -1.0, 0.0, 1.0), 0.0, 0.0],
    )  # fmt: skip
    phase = 0.7 * 0.05 * 2000.0
    truth = turn @ [0.7 * np.cos(phase), -0.7 * np.sin(phase), 0.05]
    found: Any = solve(scene, 2000.0)
    assert np.abs(found.omega[-1] - truth).max() / 0.7 < min(found.error, 1e-10)


@pytest.mark.parametrize(
    ("moments", "omega", "end"), [((1e-6, 1.0, 1.0 + 5e-7), (0.4, -1.1, 0.7), 1.0),
                                  ((1.0, 2.0, 3.0), (1e-3, 1.0, 0.0), 20.0)],
)  # fmt: skip
def test_a_tilted_body_keeps_its_digits(moments: Any, omega: Any, end: float) -> None:
    """The second motion amplifies errors 1e5 times; the reference has none to amplify."""
    turn = Rotation.from_rotvec((0.4, 0.2, 0.7)).as_matrix()
    inertia = turn @ np.diag(moments) @ turn.T
    scene = Scene(
        "", turn @ omega, inertia=0.5 * (inertia + inertia.T),
        torque=lambda t, w: [0.0, -1e-7 * np.clip(w[1], -0.2, 0.2), 0.0],
    )  # fmt: skip
    about, axes = principal(scene)
    expected = axes @ solve(about, end, "reference").omega[-1]
    assert solve(scene, end, "reference").omega[-1] == pytest.approx(expected, rel=0.0, abs=1e-15)
    assert solve(scene, end).omega[-1] == pytest.approx(expected, rel=0.0, abs=1e-10)


def test_an_attitude_of_a_tilted_body_may_begin_at_a_level() -> None:
    def torque(t: Any, w: Any, q: Any) -> Any:
        return np.where(q[2] > 0.0, 1.0, 0.0) * np.ones(3)

    scene = Scene(
        "", (0.0, 0.0, 0.0), torque=torque, inertia=_TILTED, attitude=(1.0, 0.0, 0.0, 0.0)
    )
    assert not solve(scene, 1.0).omega.any()
    assert not prepare(scene, attitude=True)(np.zeros(3), 1.0)[0].any()


@pytest.mark.parametrize("size", [1e-9, 1.0])
def test_event_whose_record_differs_is_called_with_numbers(size: float) -> None:
    def event(t: Any, omega: Any) -> Any:
        return size * (omega[0] - (0.25 if isinstance(t, float) else 0.2))

    found: Any = solve(ball(lambda t, omega: [-0.1, 0.0, 0.0]), [2.0], events=event)
    assert found.t_events[0] == pytest.approx([0.5])


def test_an_equation_of_the_user_has_switches_and_real_powers() -> None:
    """The ball bounces between two constant forces, with the period 4 sqrt(2)."""
    given: Any = {"method": Taylor, "rtol": 1e-10, "atol": 1e-12}
    found = solve_ivp(
        lambda t, y: [y[1], -np.sign(y[0])], (0.0, 4.0 * math.sqrt(2.0)), [1, 0], **given
    )
    assert found.y[:, -1] == pytest.approx([1.0, 0.0], abs=1e-9)

    def kepler(t: Any, y: Any) -> Any:
        return [*y[2:], *(-y[:2] / (y[0] ** 2 + y[1] ** 2) ** 1.5)]

    found = solve_ivp(kepler, (0.0, 2.0 * math.pi), [0.4, 0.0, 0.0, 2.0], **given)
    assert found.y[:, -1] == pytest.approx([0.4, 0.0, 0.0, 2.0], abs=1e-8)


CASES: list[Torque] = [
    lambda t, w: np.where(w > 0.4, w, -w),
    lambda t, w: np.clip(w, [-0.1, 0.0, 0.1], 0.6),
    lambda t, w: [np.max(w), np.min(w), np.linalg.norm(w)],
    lambda t, w: [np.heaviside(w[0] - 0.5, 0.5), np.hypot(w[0], w[1]), np.arctan2(w[1], w[0])],
    lambda t, w: [math.sin(t) + math.atan2(w[0], w[1]), math.fmod(t, 0.5), math.pow(w[2], 1.3)],
    lambda t, w: [np.interp(w[0], [0, 1], [2, 3]), np.interp(t, [0, 5], [1, 9]), np.fabs(w[1])],
    lambda t, w: np.linalg.solve(np.diag(w) + np.ones((3, 3)), w),
    lambda t, w: np.linalg.inv(np.array([[2.0, 1, 0], [0, 3, 0], [0, 0, 4]])) @ w,
    lambda t, w: np.einsum("ij,j->i", np.eye(3), w) + np.stack([w[0], w[1], w[2]]),
    lambda t, w: [np.log1p(w[0]), np.exp2(w[1]), np.log10(w[2])],
    lambda t, w: [np.expm1(w[0]), np.cbrt(w[1]), np.log2(w[2])],
    lambda t, w: [np.arcsinh(w[0]), np.arccos(w[1] / 2), np.trunc(3.0 * w[2])],
    lambda t, w: [np.ceil(w[0]), np.rint(2.2 * w[1]), w[2] // 0.2],
    lambda t, w: [2.0 ** w[0], w[1] ** w[2], w[0] ** -0.5],
    lambda t, w: [np.logical_or(w[0] > 1, w[1] > 0.1) * t, ~(w[0] > 1) * t, (t < w[1]) * 1.0],
    lambda t, w: [np.interp(w[0], [0, 0.2], [1, 2], right=5.0), (w[0] >= 0.5) ^ (w[1] > 9), t],
    lambda t, w: np.sqrt(np.array([w[0], 2.0, w[1]])),
    lambda t, w: np.interp([w[0], 5.0, -5.0], [0, 1], [2, 3], left=7.0, right=8.0),
    lambda t, w: np.where(~(np.array([w[0], 1.0, 0.0]) > 0.5), 1.0, 2.0),
    lambda t, w: np.maximum(w, 0.5),
    lambda t, w: np.tanh(np.array([np.sum(w) * w[0], np.linalg.norm(w), w @ w])),
    lambda t, w: [np.arctan2(w[0], -w[1]), np.arctan2(-w[1], -w[0]), np.arctan2(-w[2], w[0])],
    lambda t, w: [np.arctan2(0.0, -w[0]), np.arctan2(1.0, -w[1]), np.arctan2(w[2], -1.0)],
    lambda t, w: [np.arccosh(2 + w[0]), np.arctanh(w[1] / 2), np.linalg.det(np.outer(w, w) + t)],
    lambda t, w: [np.deg2rad(w[0]), np.degrees(w[1]), np.fmod(-w[2], 0.07)],
    lambda t, w: [math.radians(w[0]), math.copysign(w[1], -w[2]), np.copysign(0.3, w[0])],
    lambda t, w: np.select([w > 0.5, w > 0.2], [w, t * w], -1.0),
    lambda t, w: np.select(condlist=[w > 0.4], choicelist=[w]) + np.fmod([w[0], 1.0, -2.0], 0.3),
    lambda t, w: np.copysign(w, [-0.0, 2.0, w[0]]) + np.linalg.det(a=np.diag(w)),
    lambda t, w: np.linalg.det(np.array([[w[0], t], [w[1], w[2]]])) * np.rad2deg(w),
    lambda t, w: np.interp([w[0], t, 0 * w[2]], [0, 0, 0.1, 1.75, 1.75, 3], [1, 2, 4, 4, 5, 9]),
    lambda t, w: np.interp(w, [0, 0.25, 0.25, 3], [1, 1, 4, 4]),
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(CASES)))
def test_recorded_function_has_the_values_of_numpy(number: int) -> None:
    torque = CASES[number]
    omega = np.array([0.3, 0.2, 0.9]) + 0.3 * np.random.default_rng(number).random(3)
    found = recorded(torque).at(1.75, omega.tolist(), (1.0, 0.0, 0.0, 0.0))
    assert found == pytest.approx([float(x) for x in torque(1.75, omega)], rel=1e-14)


def test_new_arrays_take_symbols_unless_they_are_of_integers() -> None:
    def torque(t: Any, omega: Any, kind: Any = float) -> Any:
        found, other = np.zeros(3, dtype=kind), np.empty(3)
        found[0] = -omega[0]
        other[:] = np.eye(3) @ np.ones(3)
        return found + other

    assert recorded(torque).at(0.0, (0.5, 0, 0), (1, 0, 0, 0)) == (0.5, 1.0, 1.0)
    refused("array of floats", recorded, lambda t, w: torque(t, w, int))


def test_numpy_is_replaced_in_the_recording_thread_alone() -> None:
    seen: list[Any] = []
    where, sine = np.where, math.sin

    def elsewhere() -> None:
        seen.append((np.zeros(1).dtype, np.maximum.reduce([1.0, 2.0]), math.sin(0.0)))

    def torque(t: Any, omega: Any) -> Any:
        thread = threading.Thread(target=elsewhere)
        thread.start()
        thread.join()
        return np.where(omega > 0.0, 1.0, 2.0)

    recorded(torque)
    with pytest.raises(InputError):
        recorded(lambda t, omega: [1.0 / 0, 0, 0])
    assert seen[0] == (np.dtype(float), 2.0, 0.0)
    assert np.where is where
    assert math.sin is sine


def test_refusal_names_line_and_function() -> None:
    def braking(t: Any, omega: Any) -> Any:
        return [0.0, 0.0, 0.0] if t > 100.0 else omega

    line = braking.__code__.co_firstlineno + 1
    refused(rf"line {line}, in braking.*numpy\.where", recorded, braking)
