"""Switches that are touched, coincide or slide, and short pulses between two of them."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, solve
from tests.conftest import Patch
from tests.engine.entry_points import ball, check_ends, ends_of

Torque = Callable[[Any, Any], Any]
BRICK = (1.0, 2.0, 2.5)


@pytest.mark.parametrize("start", [0.25, 0.0])
def test_sliding_is_told_with_its_time(start: float) -> None:
    scene = ball(lambda t, omega: [-0.1 * np.sign(omega[0]), 0.0, 0.0], (start, 0.0, 0.0))
    found: Any = solve(scene, [1.0, 2.0, 3.0])
    assert found.ended == "sliding"
    assert not found.success
    assert f"t = {10 * start:g} s" in found.reason
    assert found.omega[:, 0] == pytest.approx([0.15, 0.05][: len(found.omega)], abs=1e-15)
    assert len(found.omega) == (2 if start else 0)


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
    monkeypatch.setattr("pyharness.engine.steps.dense.state_pieces", None)
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
