"""Torques with limits and switches, against exact solutions and the many-digit reference."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, Stepper, opaque, solve, solve_many
from pyharness.model.state_torque import recorded
from pyharness.truth.reference import reference
from tests.engine.entry_points import ball, check_ends, ends_of

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


def test_a_switch_whose_operand_is_infinite_ends_the_motion() -> None:
    found = solve(ball(lambda t, omega: [np.floor(1.0 / t), 0.0, 0.0]), [2.0])
    assert found.ended in ("singular", "overflow")
    assert len(found.omega) == 0


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
        assert np.abs(found.omega - wanted.omega).max() <= 1e-8 * np.abs(wanted.omega).max()


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
        assert solve(scene, 10.0, method).omega == pytest.approx(bare.omega, abs=1e-6)
    smooth = Scene(
        "", omega, (3.0, 2.0, 1.0),
        torque=lambda t, w: (
            0.05 * np.cos(t) * np.array([1, 0, 0]) - 0.1 * (w**2 + 1e-8) ** 0.65 * np.tanh(w / 1e-4)
        ),
    )  # fmt: skip
    assert solve(smooth, 10.0).omega == pytest.approx(bare.omega, abs=1e-5)


# Torque, omega at the start, and passages of the reason; sliding, or a touch.
