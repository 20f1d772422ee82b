"""Torques with limits and switches, against exact solutions and the many-digit reference."""

import math
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pyharness import (
    InputError,
    Scene,
    Stepper,
    Taylor,
    opaque,
    prepare,
    principal,
    solve,
    solve_many,
)
from pyharness.model.state_torque import recorded
from pyharness.truth.reference import reference
from tests.conftest import Patch
from tests.engine.entry_points import ball, check_ends, ends_of
from tests.refused import refused

Torque = Callable[[Any, Any], Any]
BRICK = (1.0, 2.0, 2.5)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-8, 1e-12])
def test_saturated_damping_has_its_closed_form(tolerance: float) -> None:
    """Omega decreases by 0.1 each second to 0.1/0.5 = 0.2, and then as exp(-t/2)."""
    found = solve(
        ball(lambda t, omega: np.clip(-0.5 * omega, -0.1, 0.1)), [0.5, 1.0, 1.5, 4.0],
        tolerance=tolerance,
    )  # fmt: skip
    wanted = [0.25, 0.2, 0.2 * math.exp(-0.25), 0.2 * math.exp(-1.5)]
    assert found.ended == "complete"
    assert found.omega[:, 0] == pytest.approx(wanted, abs=0.3 * tolerance + 1e-15)


# Torque, omega at the start and at a time (s).
EXACT: dict[str, tuple[Torque, Any, float, Any]] = {
    "steps of time": (
        lambda t, w: [np.floor(t), (t > 2.5) * 2.0, t % 1.5], (0.3, 0, 0), 4.0, [6.3, 3.0, 2.75],
    ),
    "one of the state's pieces": (
        lambda t, w: [0.0, 0.0, -np.interp(w[2], [-0.1, 0.0, 0.7, 1.7], [0.0, 1e9, 0.0, 0.0])],
        (0.0, 0.0, 3.0), 1.0, [0.0, 0.0, 3.0],
    ),
    "branch begins on a level": (
        lambda t, w: [np.where(w[0] > 0.3, np.where(t > -1.0, 1.0, -1.0), 1.0), 0.0, 0.0],
        (0.3, 0.0, 0.0), 2.0, [2.3, 0.0, 0.0],
    ),
    "branch begins without a value": (  # the sine integral of 2
        lambda t, w: [np.where(t > 0, np.sin(t) / t, 1.0), 0.0, 0.0], (0.3, 0.0, 0.0), 2.0,
        [0.3 + 1.6054129768026948, 0.0, 0.0],
    ),
    "state rests on a level": (
        lambda t, w: [0, 0, np.where(w[2] > 1, 5.0, 0.0)], (0.0, 0.0, 1.0), 10.0, [0.0, 0.0, 1.0],
    ),
    # The product is 0 from t = 1.3 to 3.3 s, where the first factor jumps from -1 to 1.
    **{
        f"moved to its level by another, {end:g} s": (
            lambda t, w: [
                np.where(np.sign(t - 2.3) * np.floor(abs(t - 2.3)) < 0.0, -1.0, 1.0), 0, 0
            ],
            (0.0, 0.0, 0.0), end, [wanted, 0.0, 0.0],
        )
        for end, wanted in ((1.0, -1.0), (2.0, -0.6), (3.0, 0.4), (5.0, 2.4))
    },
    "pushes of a square wave": (
        lambda t, w: [np.where(np.floor(t) % 2 < 1, 1, 0), 0, 0], (0.0, 0.0, 0.0), 20.0, [10, 0, 0],
    ),
    "maximum of a remainder": (
        lambda t, w: [np.where(np.maximum(t % 2 - 1, 0) > 0, 1, 0), 0, 0], (0.0, 0.0, 0.0), 20.0,
        [10, 0, 0],
    ),
    "floor of a remainder": (lambda t, w: [(t % 7) // 1, 0, 0], (0, 0, 0), 20.0, [57, 0, 0]),
    "stairs": (lambda t, w: [np.floor(3 * (t % 1)), 0, 0], (0, 0, 0), 20.0, [20, 0, 0]),
    "remainder of another": (lambda t, w: [(t % 10) % 5, 0, 0], (0, 0, 0), 20.0, [50, 0, 0]),
    "never left": (lambda t, w: [np.where(t % 4 < 4, 1, 0), 0, 0], (0, 0, 0), 20.0, [20, 0, 0]),
    "towards earlier times": (lambda t, w: [(t // 2) % 2, 0, 0], (0, 0, 0), -20.0, [-10, 0, 0]),
    "far from 0": (lambda t, w: [(t + 1.7e9) // 1 - 1.7e9, 0, 0], (0, 0, 0), 3.0, [3, 0, 0]),
}  # fmt: skip


@pytest.mark.parametrize("name", EXACT)
def test_switches_have_exact_results_by_every_entry_point(name: str) -> None:
    torque, omega, end, wanted = EXACT[name]
    scene = ball(torque, omega)
    check_ends(ends_of(scene, end, of_steps=1e-12), wanted, rel=1e-13, abs=1e-15)
    if name != "branch begins without a value":
        assert reference(scene, [end]).omega[0] == pytest.approx(wanted, rel=1e-13, abs=1e-15)


@pytest.mark.parametrize("start", [0.25, 0.0])
def test_sliding_is_told_with_its_time(start: float) -> None:
    scene = ball(lambda t, omega: [-0.1 * np.sign(omega[0]), 0.0, 0.0], (start, 0.0, 0.0))
    found: Any = solve(scene, [1.0, 2.0, 3.0])
    assert found.ended == "sliding"
    assert not found.success
    assert f"t = {10 * start:g} s" in found.reason
    assert found.omega[:, 0] == pytest.approx([0.15, 0.05][: len(found.omega)], abs=1e-15)
    assert len(found.omega) == (2 if start else 0)


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


def test_a_touch_that_an_error_may_turn_into_a_crossing_is_sensitive() -> None:
    def touched(height: float) -> str:
        torque: Torque = lambda t, omega: [np.where(np.cos(t) > height, 1.0, 0.0), 0.0, 0.0]  # noqa: E731
        return solve(ball(torque), [2.0, 8.0], tolerance=1e-10).ended

    assert touched(-1.0) == touched(-1.0 - 1e-12) == "sensitive"
    assert touched(-1.1) == touched(-0.9) == "complete"

    def computed(t: Any, omega: Any) -> Any:
        return [np.where(np.cos(t) > -1.0 - 1e-12, 0.1, np.exp(0.1 * t)), 0.0, 0.0]

    assert solve(ball(computed), [2.0, 8.0], tolerance=1e-10).ended == "sensitive"


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_a_touch_on_either_side_of_a_level_ends_no_step_twice(tolerance: float) -> None:
    def steps(t: Any, omega: Any) -> Any:
        return [np.where(np.sin(t) > 0.3, 0.1 * np.floor(3.0 / np.sin(t)), 0.0), 0.0, 0.0]

    found = solve(ball(steps), [3.0], tolerance=tolerance)
    assert found.ended == "sensitive"
    assert found.steps < 100


@pytest.mark.parametrize("start", [-1.0, -0.7, -2.0])
def test_a_stepper_passes_a_touch_within_rounding_of_its_level(start: float) -> None:
    scene = ball(lambda t, w: [np.floor(np.cos(w[1])), 1.0, 0.0], (0.0, start, 0.0))
    # The floor is -1 where the cosine is negative.
    wanted = -max(0.0, -start - math.pi / 2) - max(0.0, 3.0 + start - math.pi / 2)
    found = ends_of(scene, 3.0, 1e-9)["stepper"]
    assert found == pytest.approx([wanted, 3.0 + start, 0.0], abs=1e-7)


def test_a_switch_whose_operand_is_infinite_ends_the_motion() -> None:
    found = solve(ball(lambda t, omega: [np.floor(1.0 / t), 0.0, 0.0]), [2.0])
    assert found.ended in ("singular", "overflow")
    assert len(found.omega) == 0


def test_roots_of_fast_and_of_slow_operands_are_exact() -> None:
    """A relay is off while a cosine is below a level: the impulse is known."""
    source = np.random.default_rng(3)
    for _ in range(60):
        depth, speed = 10.0 ** source.uniform(-5.0, -0.1), source.uniform(0.5, 40.0)
        tolerance = 10.0 ** source.uniform(-12.0, -4.0)

        def relay(t: Any, omega: Any, speed: float = speed, depth: float = depth) -> Any:
            return [np.where(np.cos(speed * t) > depth - 1.0, 1.0, 0.0), 0.0, 0.0]

        half = math.acos(1.0 - depth) / speed
        middles = np.arange(1, 2 * speed, 2) * math.pi / speed
        off = np.clip(middles + half, 0.0, 5.0) - np.clip(middles - half, 0.0, 5.0)
        found = solve(ball(relay), [5.0], tolerance=tolerance)
        error = abs(found.omega[0, 0] / (5.3 - off.sum()) - 1.0)
        assert error <= 0.1 * tolerance + 1e-14 or found.ended == "sensitive"


def test_amplification_includes_the_change_of_the_time_of_a_switch() -> None:
    """Where the rates jump, a perturbation jumps too: here by the factor 1 - 0.8/1."""

    def end(x: float) -> Any:
        torque: Torque = lambda t, omega: [-1.0 + 0.8 * (omega[0] < 0.5), 0.1, 0.0]  # noqa: E731
        return solve(ball(torque, (1.0 + x, 0.0, 0.0)), [1.0])

    slope = (end(1e-3).omega[0, 0] - end(-1e-3).omega[0, 0]) / 2e-3
    assert slope == pytest.approx(0.2, rel=1e-9)

    def away(t: Any, omega: Any) -> Any:
        return [
            -1.0 + np.where(omega[0] < 0.5, 0.9, 0.0) - 5.0 * np.where(omega[0] < 0.45, 1, 0),
            0,
            0,
        ]

    assert solve(ball(away, (1.0, 0.0, 0.0)), [1.1]).growth == pytest.approx(5.1, rel=1e-3)


def _torque(kind: str, source: np.random.Generator) -> Torque:
    k, limit, wide = source.uniform(0.05, 1.0), source.uniform(0.02, 0.3), source.uniform(0.05, 0.4)
    c, speed, at = source.normal(size=3) * 0.2, source.uniform(0.5, 3.0), source.uniform(1.0, 5.0)
    places, values = np.sort(source.uniform(-1.0, 1.0, 5)), source.normal(size=5) * 0.2
    return {
        "clip": lambda t, w: np.clip(-k * w, -limit, limit) + c * np.sin(speed * t),
        "dead zone": lambda t, w: (
            np.where(np.abs(w) < wide, 0.0, -k * (w - wide * np.sign(w))) + c * np.sin(speed * t)
        ),
        "where": lambda t, w: [
            np.where(w[0] > 0, limit, -0.5 * limit) + c[0], c[1] * np.cos(speed * t),
            np.where((w[1] < w[2]) & (w[0] > -0.2), c[2], 0.1),
        ],
        "time": lambda t, w: [
            limit * np.where(t > at, 1.0, -1.0), c[1] * np.heaviside(t - at / 2, 0.5), -k * w[2]
        ],
        "interp": lambda t, w: [
            np.interp(w[0], places, values), c[1] * np.cos(speed * t), np.interp(t, places, values)
        ],
        "abs": lambda t, w: -k * np.abs(w) * w + c * np.cos(speed * t),
        "extremes": lambda t, w: [np.maximum(w[0], w[1]) * c[0], np.minimum(w[2], c[1]), c[2]],
        "relay": lambda t, w: [
            c[0] + 0.3 * limit * np.where(w[0] + 0.5 * w[1] > 0.3 * np.sin(speed * t), 1.0, -1.0),
            c[1] * np.cos(t), c[2] * np.sin(2.0 * t),
        ],
        "branches": lambda t, w: [
            np.where((w[0] <= c[0]) | ~(np.sin(speed * t) > c[1]), c[2] / (3.0 + w[1]), -k * w[0]),
            np.where((t > at) & (w[2] >= c[1]), np.where(w[0] < c[2], np.log(t), 0.1), c[0] * w[2]),
            np.where(np.clip(w[1], -wide, wide) * speed > wide, np.exp(-w[2]), np.cos(t)) * limit,
        ],
        "functions": lambda t, w: [
            0.1 * np.log(40.0 + w[0] * w[1]), 0.1 * np.arctan(3.0 * w[1]),
            -0.1 * np.arcsin(0.9 * np.sin(w[2])) - 0.05 * (w @ w) ** 0.75,
        ],
    }[kind]  # fmt: skip


KINDS = (
    "clip", "dead zone", "where", "time", "interp", "abs", "extremes", "relay", "branches",
    "functions",
)  # fmt: skip


def _check(kind: str, seed: str) -> None:
    source = np.random.default_rng([*seed.encode(), *kind.encode()])
    omega = source.normal(size=3) * source.uniform(0.2, 1.5)
    tolerance = 10.0 ** source.uniform(-12.0, -3.0)
    scene = Scene(kind, tuple(omega), moments=BRICK, torque=_torque(kind, source))
    times = np.linspace(0.0, source.uniform(1.0, 5.0), 4)
    found: Any = solve(scene, times, tolerance=tolerance)
    if found.ended == "sliding":
        return
    exact = np.array(reference(scene, times.tolist()).omega, dtype=float)
    error = np.abs(found.omega - exact).max() / np.abs(exact).max()
    assert error <= tolerance + 4e-15 * found.growth
    assert error <= 4.0 * found.error + 4e-15 * found.growth


@pytest.mark.parametrize("kind", KINDS)
def test_error_is_within_the_tolerance(kind: str) -> None:
    _check(kind, "first")


@pytest.mark.parametrize("kind", KINDS)
def test_methods_of_scipy_begin_anew_at_switches(kind: str) -> None:
    source = np.random.default_rng([5, *kind.encode()])
    scene = Scene(kind, (0.3, -0.2, 0.9), moments=BRICK, torque=_torque(kind, source))
    wanted = solve(scene, [6.0], tolerance=1e-13)
    assert wanted.ended == "complete"
    for method in ("dop853", "rk45"):
        found = solve(scene, [6.0], method, 1e-8)
        scale = np.abs(wanted.omega).max()
        assert np.abs(found.omega - wanted.omega).max() <= 1e-8 * scale


def test_methods_of_scipy_tell_of_sliding() -> None:
    scene = ball(lambda t, omega: [-0.1 * np.sign(omega[0]), 0.0, 0.0])
    with pytest.raises(InputError, match="back and forth"):
        solve(scene, [10.0], "dop853")


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_errors_of_random_scenes_are_within_the_tolerance(kind: str) -> None:
    for k in range(5):
        _check(kind, f"random {k}")


def _bounded(t: Any, omega: Any) -> Any:
    x, y, z = np.clip(-0.5 * omega, -0.1, 0.1)
    return [x, y + 0.05 * (t > 3.0), z]


BOUNDED = Scene("bounded", (0.3, 0.2, 0.9), moments=BRICK, torque=_bounded)


def test_prepared_solver_batch_steps_and_rows_agree() -> None:
    found = ends_of(BOUNDED, 7.0, of_steps=1e-12)
    wanted = found["solve"]
    assert found["prepare"].tolist() == found["solve_many"].tolist() == wanted.tolist()
    assert found["stepper"] == pytest.approx(wanted, abs=1e-10)
    for method in ("dop853", "lsoda"):
        assert solve(BOUNDED, [7.0], method, 1e-9).omega[0] == pytest.approx(wanted, abs=1e-9)
    both = solve(BOUNDED, [-2.0, 0.0, 7.0])
    assert both.omega[2] == pytest.approx(wanted, abs=1e-12)
    assert solve(replace(BOUNDED, omega=tuple(both.omega[0])), [2.0]).ended == "complete"


def test_dense_output_and_events_read_the_steps() -> None:
    found: Any = solve(
        BOUNDED, [7.0], dense_output=True, events=lambda t, omega: np.linalg.norm(omega) - 0.9
    )
    ((time,),) = found.t_events
    assert np.linalg.norm(found.sol(time)[:3]) == pytest.approx(0.9, abs=1e-11)
    for each in np.linspace(0.1, 6.9, 9):
        assert found.sol(each)[:3] == pytest.approx(solve(BOUNDED, [each]).omega[0], abs=1e-11)


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


@pytest.mark.parametrize(("torque", "message"), [
    (lambda t, w: -w * np.interp(w, [-np.inf, 1, np.inf], [1, 3, 4]), "not finite"),
    (lambda t, w: -w * np.interp(t, [0, 2, 1], [1, 3, 4]), "not in ascending order"),
    (lambda t, w: w * np.interp(1, [0, 2, 1], [1, 3, 4], w[0]), "not in ascending order"),
    (lambda t, w: -w * np.interp(t, [0, 1], [1, 3, 4]), "not of the same length"),
])  # fmt: skip
def test_what_numpy_would_compute_otherwise_is_refused(torque: Torque, message: str) -> None:
    refused(message, recorded, torque)


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
    with pytest.raises(InputError, match=rf"line {line}, in braking.*numpy\.where"):
        recorded(braking)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stepper_passes_the_switches_of_a_square_wave(sign: float) -> None:
    stepper = Stepper(ball(lambda t, w: [np.sign(np.sin(sign * 3.0 * t)), 0.0, 0.0]), 1e-10)
    stepper.until(sign * 20.0)
    pushes, rest = divmod(20.0, math.pi / 3.0)
    wanted = 0.3 + sign * (rest if pushes % 2 == 0 else math.pi / 3.0 - rest)
    assert stepper.omega[0] == pytest.approx(wanted, abs=1e-12)
    assert stepper.steps <= 3 * (pushes + 1)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-12])
def test_the_sign_of_a_power_changes_with_its_base(tolerance: float) -> None:
    def torque(t: Any, w: Any) -> Any:
        return [0.2 - 0.1 * np.abs(w[0] ** 3), -0.2 - 0.1 * np.abs(w[1] ** 3), 0.0]

    scene = Scene("", (0.5, -0.4, 0.3), moments=(1.0, 1.5, 2.0), torque=torque)
    wanted = solve(scene, 5.0, "dop853", 1e-10).omega[0]
    assert solve(scene, 5.0, tolerance=tolerance, effort=0.01).ended == "complete"
    check_ends(ends_of(scene, 5.0, tolerance), wanted, abs=1e-8)
    still = recorded(lambda t, w: np.where(-(w[0] ** 4) * w[1] ** 3 > 0.0, 1.0, 2.0) * np.ones(3))
    signs = [still.at(0.0, (x, -1.0, 0.0), (1.0, 0.0, 0.0, 0.0))[0] for x in (-0.5, 0.0, 0.5)]
    assert signs == [1, 2, 1]


BRANCHES: dict[str, Torque] = {
    "1/t": lambda t, w: [np.where(t > 5, 1 / t, 0.0), 0.0, 0.0],
    "log and pole": lambda t, w: [
        np.where(t > 1, np.where(t > 4, 1 / (t - 2), np.log(t)), 0.0), 0.0, 0.0,
    ],
    "root": lambda t, w: [np.where(w[0] > 1.5, np.sqrt(w[0] - 1.2), 0.3), 0.0, 0.0],
    "arc": lambda t, w: [np.where(abs(w[1]) < 0.5, np.arcsin(2 * w[1]), 0.1), 0.0, 0.0],
    "direction": lambda t, w: np.where(
        np.linalg.norm(w) > 1e-9, -0.1 * w / np.linalg.norm(w), 0.0
    ),
    "condition": lambda t, w: [
        np.where(t > 2, np.where(1 / (t - 1.5) > 0.5, 0.2, -0.2), 0.1), 0.0, 0.0,
    ],
    "not after": lambda t, w: [np.where(t <= 0, 0.0, np.cos(t)), 0.0, 0.0],
    "and": lambda t, w: [np.where((np.sin(2.86 * t) > -0.679) & (w[2] > 0.1), np.cos(t), 0), 0, 0],
    "not": lambda t, w: [np.where(~(np.sin(3 * t) > 0), 0, np.cos(t)), 0.0, 0.0],
    "all, some, all": lambda t, w: [np.where(np.sin(2 * t) > 0, np.cos(3 * t) * w[1], w[2]), 0, 0],
    "jump": lambda t, w: [np.where(w[0] <= 1.5, np.cos(w[1]) * 0.2, 1 - 0.3 * np.sin(t)), 0, 0],
    "at rest on a level": lambda t, w: [np.where(np.clip(t, 0, 1) > 1, 1.0, 0.1), 0.0, 0.0],
    "at rest on levels": lambda t, w: [
        np.floor(np.clip(t, 0, 1.0)) * 0.5 + np.floor(np.clip(-t, -2, 0.0)), 0.0, 0.0,
    ],
    "exp": lambda t, w: [np.where(t < 3, 0.1, np.exp(-1000 * (t - 3))), 0.0, 0.0],
}  # fmt: skip


@pytest.mark.parametrize("name", BRANCHES)
def test_a_branch_may_be_singular_where_it_is_not_chosen(name: str) -> None:
    scene = Scene(name, (1.0, 0.2, 0.3), moments=BRICK, torque=BRANCHES[name])
    wanted = solve(scene, [3.0, 6.0], "reference").omega
    found: Any = solve(scene, [3.0, 6.0], tolerance=1e-11)
    assert found.ended == "complete"
    moved = replace(scene, omega=(1.0 + 1e-6, 0.2, 0.3))
    change = np.abs(solve(moved, [3.0, 6.0], tolerance=1e-11).omega - found.omega).max() / 1e-6
    assert found.growth >= 0.99 * change
    assert solve(scene, [3.0, 6.0], "dop853", 1e-9).omega == pytest.approx(wanted, abs=1e-8)
    check_ends(ends_of(scene, 6.0, 1e-11), wanted[-1], abs=1e-9)
    batch = solve_many(scene, [3.0, 6.0], omega=[scene.omega] * 2, tolerance=1e-11)
    for omega in (found.omega, batch.omega):
        assert np.abs(omega - wanted).max() <= 1e-11 * np.abs(wanted).max()


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_an_angle_jumps_from_pi_to_minus_pi(method: str, level: int) -> None:
    """The body rotates about one axis, past the half turn, under a torque -k times the angle."""
    k = 0.05

    def torque(t: Any, w: Any, q: Any) -> Any:
        yaw = np.arctan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] ** 2 + q[3] ** 2))
        return [0.0, 0.0, -k * yaw]

    scene = Scene(
        "", (0.0, 0.0, 1.0), (1.0, 1.0, 1.0), torque=torque, attitude=(1.0, 0.0, 0.0, 0.0)
    )
    root = math.sqrt(k)
    half_turn = math.asin(math.pi * root) / root
    found = solve(scene, [-8.0, 3.0, 8.0], method, 1e-10)
    after, speed = root * (8.0 - half_turn), math.cos(root * half_turn)
    end = speed * math.cos(after) + math.pi * root * math.sin(after)
    assert found.omega[:, 2] == pytest.approx([end, math.cos(3.0 * root), end], abs=1e-9)


def test_a_direction_is_guarded_at_rest() -> None:
    scene = Scene("", (0.0, 0.0, 0.0), moments=BRICK, torque=BRANCHES["direction"])
    check_ends(ends_of(scene, 2.0), [0.0, 0.0, 0.0], abs=0.0)
    assert not solve(scene, [2.0], "dop853").omega.any()


@pytest.mark.parametrize("gap", [1e-9, 1e-11, 3e-9])
@pytest.mark.parametrize("tolerance", [1e-9, 1e-12])
def test_a_pulse_between_two_switches_is_not_lost(gap: float, tolerance: float) -> None:
    def torque(t: Any, w: Any) -> Any:
        pulse = np.where(t > 1.0, 1.0, 0.0) - np.where(t > 1.0 + gap, 1.0, 0.0)
        return [10.0 * pulse, w[1] + 0.1 * pulse, 0.0]

    found: Any = solve(ball(torque, (0.1, 0.0, 0.0)), 8.0, tolerance=tolerance)
    wide = (1.0 + gap) - 1.0
    wanted = [0.1 + 10.0 * wide, -0.1 * math.exp(7.0) * math.expm1(-wide), 0.0]
    assert np.abs(found.omega[0] - wanted).max() <= 0.1 * (tolerance + 4e-15 * found.growth)


@pytest.mark.usefixtures("level")
@pytest.mark.parametrize("height", [1.0 - 1e-9, 1.0, 1.0 + 1e-9])
def test_a_touch_keeps_the_error_amplification(height: float) -> None:
    def torque(t: Any, w: Any) -> Any:
        return [0.0, w[1] + 1e-5 * np.where(np.cos(t - 2.0) > height, 1.0, 0.0), 0.0]

    found = solve(ball(torque, (1.0, 0.0, 0.0)), 8.0, tolerance=1e-9)
    assert found.growth == pytest.approx(math.exp(8.0), rel=1e-3)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("gap", [1e-14, 1e-11, 1e-9])
@pytest.mark.parametrize("push", [1e-1, 1e-3, 1e-5, 3e-7])
def test_what_a_touch_may_change_grows(tolerance: float, gap: float, push: float) -> None:
    """The torque acts for a moment, in which the series may not see that the level is crossed."""
    level = 1.0 - gap
    half = 2.0 * math.asin(math.sqrt(0.5 * (1.0 - level)))

    def torque(t: Any, w: Any) -> Any:
        return [0.0, w[1] + push * np.where(np.cos(t - 2.0) > level, 1.0, 0.0), 0.0]

    found: Any = solve(ball(torque, (1.0, 0.0, 0.0)), 8.0, tolerance=tolerance)
    wanted = 2.0 * push * math.exp(6.0) * math.sinh(half)
    error = abs(found.omega[0, 1] - wanted)
    assert found.ended == "sensitive" or error <= tolerance + 4e-15 * found.growth
    assert error <= found.error + 1e-15 * found.growth


def test_a_pulse_between_two_levels_of_an_operand_is_not_lost() -> None:
    """After the first level, all terms of the operand are small in the step to the second."""
    source = np.random.default_rng(5)
    for _ in range(200):
        gap, push = 10.0 ** source.uniform(-12.0, -6.0), 10.0 ** source.uniform(-2.0, 3.0)
        tolerance, low = 10.0 ** source.uniform(-12.0, -3.0), source.uniform(0.3, 3.0)
        rate = source.uniform(0.3, 1.5)
        high = low + gap

        def torque(
            t: Any,
            w: Any,
            push: float = push,
            low: float = low,
            high: float = high,
            c: float = rate,
        ) -> Any:
            pulse = np.where(w[0] > low, 1.0, 0.0) - np.where(w[0] > high, 1.0, 0.0)
            return [c, push * pulse, 0.0]

        end = 3.5 / rate + 3.0
        found: Any = solve(ball(torque, (0.1, 0.0, 0.0)), end, tolerance=tolerance)
        error = abs(found.omega[0, 1] - push * (high - low) / rate) / found.omega[0, 0]
        assert found.ended in ("complete", "sensitive")
        assert error <= tolerance + 4e-15 * found.growth


@pytest.mark.parametrize(
    ("gap", "push", "tolerance", "phase", "end"),
    [(3.89e-12, 78.2, 3.31e-6, 0.947, 1.77), (8.67e-10, 68.3, 5.8e-4, 0.99238876, 1.62)],
)
def test_a_floor_may_touch_its_next_level(
    gap: float, push: float, tolerance: float, phase: float, end: float
) -> None:
    """The floor of an odd number selects another branch, by another floor."""

    def torque(t: Any, w: Any) -> Any:
        is_even = np.floor(4.0 + w[0] + gap) % 2 < 1
        return [np.cos(t + phase), push * np.where(is_even, 0.0, 1.0), 0.0]

    found: Any = solve(ball(torque, (math.sin(phase), 0.1, 0.0)), end, tolerance=tolerance)
    wanted = 0.1 + 2.0 * push * math.acos(1.0 - gap)
    assert found.ended == "sensitive"
    assert abs(found.omega[0, 1] - wanted) <= found.error


def kicked(unit: float, limit: float | None) -> Scene:
    """Return a brick in another unit of time, with a brake that has a limit, or without one."""

    def torque(t: Any, w: Any) -> Any:
        kick = np.where((t * unit) % 0.5 > 0.25, 1.0, -1.0) + np.log(3.0 + w[1] / unit)
        last = math.log(unit) - np.log(w[2])
        pushes = unit * unit * np.array([kick, np.arctan(w[2] / unit), last])
        most = 0.0 if limit is None else limit * unit * unit
        return pushes if limit is None else pushes + np.clip(-0.5 * unit * w, -most, most)

    return Scene("", (0.3 * unit, 0.2 * unit, 0.9 * unit), moments=BRICK, torque=torque)


@pytest.mark.parametrize(
    ("unit", "tolerance"), [(1e-2, 1e-9), (1e-2, 1e-6), (1e90, 1e-6), (1e-120, 1e-8)]
)
def test_switches_that_coincide_at_an_end_are_one(unit: float, tolerance: float) -> None:
    assert solve(kicked(unit, None), 5.0 / unit, tolerance=tolerance).ended == "complete"


@pytest.mark.parametrize("unit", [1e-120, 1e-2, 1e90])
def test_a_motion_in_another_unit_of_time_has_the_same_switches(unit: float) -> None:
    found, plain = (solve(kicked(x, 0.1), [5.0 / x]).omega[0] / x for x in (unit, 1.0))
    assert found == pytest.approx(plain, rel=1e-11)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-12, 1e-13])
def test_switches_that_coincide_by_construction_are_one(tolerance: float) -> None:
    """1 / M is clipped where M is 0.5, and the branch begins there too."""

    def torque(t: Any, w: Any) -> Any:
        m = np.maximum(0.3 * np.sin(1.26 * t), -0.414 * w[0] * w[2])
        stairs = 0.1 * np.floor((w[0] - w[1] * 0.0567) * 3.0)
        push = 0.4 * np.where(m > 0.5, 0.1 * np.clip(1.0 / m, -1.0, 2.0), stairs)
        other = 0.3 * np.sin(1.88 * t) - 0.2 * w[1]
        return [push + 0.827 - 0.2 * w[0], other, 0.114 * w[0] * w[2]]

    scene = Scene("", (0.3, -0.2, 0.9), moments=BRICK, torque=torque)
    found, truth = (solve(scene, [3.0, 5.0], tolerance=x) for x in (tolerance, 1e-11))
    assert found.ended in ("complete", "sensitive")
    assert np.abs(found.omega - truth.omega).max() < 3.0 * (tolerance + 1e-11)


@pytest.mark.parametrize(
    "omega", [(0.2, 0.1, 0.3), pytest.param((0.2, 0.0, 0.0), marks=pytest.mark.campaign)]
)
def test_broken_powers_pass_zero(omega: Any) -> None:
    def law(t: Any, w: Any) -> Any:
        return 0.05 * np.cos(t) * np.array([1, 0, 0]) - 0.1 * np.abs(w) ** 1.3 * np.sign(w)

    scene = Scene("", omega, (3.0, 2.0, 1.0), torque=law)
    found = solve(scene, [1.0, 10.0])
    assert found.ended == "complete"
    bare = solve(replace(scene, torque=opaque(law)), 10.0)
    assert found.omega[-1:] == pytest.approx(bare.omega, abs=1e-6)
    for method in ("dop853", "lsoda"):
        other = solve(scene, 10.0, method)
        assert other.omega == pytest.approx(bare.omega, abs=1e-6)
    smooth = Scene(
        "", omega, (3.0, 2.0, 1.0),
        torque=lambda t, w: (
            0.05 * np.cos(t) * np.array([1, 0, 0]) - 0.1 * (w**2 + 1e-8) ** 0.65 * np.tanh(w / 1e-4)
        ),
    )  # fmt: skip
    assert solve(smooth, 10.0).omega == pytest.approx(bare.omega, abs=1e-5)


# Torque, omega at the start, and passages of the reason; sliding, or a touch.
REASONS: dict[str, tuple[Torque, Any, tuple[str, str]]] = {
    "sum": (
        lambda t, w: [-0.1 * np.sign(w[0] - 0.2), abs(w[1] + 2.0) - 2.0 - w[1], 0.0],
        (0.3, 0.0, 0.0), ("a switch (where", "the sign of w1 - 0.2"),
    ),
    "of two": (
        lambda t, w: [0.1 * abs(w[1] + 2.0) - 0.2, 0.0, -0.1 * np.sign(w[2] + w[1] + 1)],
        (0.3, 0.0, 0.0), ("a switch (where", "the sign of w2 + w3 + 1"),
    ),
    "floor": (
        lambda t, w: [-0.1 * (2.0 * np.floor(w[0] + 0.5) - 1.0), 0, 0], (0.7, 0.0, 0.0),
        ("a switch (where", "the floor of w1 + 0.5"),
    ),
    "touch": (
        lambda t, w: [1.0 - t, np.where(w[0] > 0.5 - 1e-13, 1.0, 0.0), 0.0], (0.0, 0.0, 0.3),
        ("a switch (where, sign, a comparison) is touched at t = 1 s",
         "the sign of w1 - 0.5"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REASONS)
def test_sliding_and_touches_tell_time_and_function(name: str) -> None:
    torque, omega, (first, last) = REASONS[name]
    touched = name == "touch"
    found = solve(ball(torque, omega), [0.5, 2.0] if touched else 20.0)
    assert found.ended == ("sensitive" if touched else "sliding")
    assert str(found.reason).startswith(first)
    assert str(found.reason).endswith(f"it is {last}")
    assert found.message.endswith(f"it is {last}" + ("." if touched else "; no row."))


def test_reasons_are_in_the_axes_and_with_the_states_of_the_scene() -> None:
    def law(t: Any, w: Any) -> Any:
        return [-0.1 * np.where(2.0 * w[0] + w[1] * w[2] > 0.1, 1.0, -1.0), 0.0, 0.0]

    reason = str(solve(Scene("", (0.3, 0.1, 0.2), (3.0, 2.0, 1.0), torque=law), 20.0).reason)
    assert "from t = 6.44725 s on" in reason
    assert reason.endswith("; it is the sign of 2*w1 + w2*w3 - 0.1")
    # In the axes of the scene, with the names of its states, also beside another switch.
    matrix = [[3.0, 0.2, 0.0], [0.2, 2.0, 0.0], [0.0, 0.0, 1.0]]

    def relay(t: Any, w: Any, s: Any) -> Any:
        return [0, 0, 0], {"x": -np.where(s["x"] - 0.5 * np.sin(w[1]) > 0.2, 1.0, -1.0) + abs(w[0])}

    own = Scene("", (0.01, 0.1, 0.2), inertia=matrix, torque=relay, states={"x": 1.0})
    assert str(solve(own, 20.0).reason).endswith("the sign of x - 0.5*sin(w2) - 0.2")
    # A result that is sensitive for another reason has none.
    top = Scene(
        "", (1e-4, 2.0, 1e-4), (3.0, 2.0, 1.0), torque=lambda t, w: 1e-9 * np.clip(w, -1, 1)
    )
    far = solve(top, 60.0, tolerance=1e-12)
    assert (far.ended, far.reason) == ("sensitive", None)


@pytest.mark.parametrize(("first", "second", "cosine", "end", "at"), [
    (5.0, 1e-9, True, 4.0, "1.5708"), (1e-9, 5.0, True, 4.0, "3.14159"),
    (5.0, 0.0, True, 4.0, "1.5708"), (5.0, 5.0, True, 4.0, "1.5708"),
    (0.1, 5.0, False, 6.0, "4.71239"),
])  # fmt: skip
def test_of_two_touches_the_one_that_changes_most_is_told(
    first: float, second: float, cosine: bool, end: float, at: str
) -> None:
    def touched(t: Any, w: Any) -> Any:
        later = -np.cos(t) if cosine else -np.sin(t)
        level = 1.0 + 1e-13
        return [np.where(np.sin(t) > level, first, 0), 0, np.where(later > level, second, 0)]

    found = solve(ball(touched), end, tolerance=1e-10)
    assert found.ended == "sensitive"
    assert f"touched at t = {at} s" in str(found.reason)


def test_results_that_depend_on_a_crossing_switch_are_no_sliding() -> None:
    scene = Scene(
        "coupled", (0.0, -1e-3, 0.0), inertia=((3.0, -1.0, 0.0), (-1.0, 3.0, 0.0), (0.0, 0.0, 4.0)),
        torque=lambda t, w: [np.abs(np.where(w[1] > 0.0, 1.0, 0.0)), -0.05 + 0.3 * t, 0.0],
    )  # fmt: skip
    check_ends(ends_of(scene, 3.0), solve(scene, 3.0).omega[-1], abs=1e-8)


def test_dense_output_ends_with_the_last_row_before_sliding(monkeypatch: Patch) -> None:
    # Nothing is solved again.
    monkeypatch.setattr("pyharness.engine.dense.state_pieces", None)
    scene = ball(lambda t, w: [-2.0 * np.sign(w[0]), 0.0, 1.0], (1.0, 0.0, 0.0))
    found: Any = solve(scene, [0.2, 0.4, 2.0], dense_output=True, events=lambda t, w: w[2] - 0.3)
    assert (found.ended, found.sol.t_max) == ("sliding", 0.4)
    assert found.sol(0.3) == pytest.approx([0.4, 0.0, 0.3], abs=1e-12)
    assert found.t_events[0] == pytest.approx([0.3])
    begin: Any = solve(scene, [0.0, 2.0], dense_output=True)
    assert (begin.time.tolist(), begin.sol.t_max) == ([0.0], 0.0)


def test_dense_output_has_the_last_row_before_an_overflow() -> None:
    times = np.arange(700.0, 713.0, 3.0)
    found: Any = solve(
        ball(lambda t, w: [w[0], 0.0, 0.0], (1.0, 0.5, 0.0)), times, dense_output=True
    )
    assert found.ended == "overflow"
    assert found.sol.t_max == found.time[-1] == 709.0
    assert found.sol(found.time)[0] == pytest.approx(np.exp(found.time), rel=1e-12)
