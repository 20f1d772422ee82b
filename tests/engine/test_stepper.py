"""Tests of motions that are computed step by step."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from pyharness import InputError, Scene, Stepper, solve
from pyharness.engine.steps import stepper as engine_stepper
from pyharness.engine.steps.stepped import step_lengths
from pyharness.torques import in_space, table
from tests.refused import refused

BRICK = Scene("brick", (0.1, 2.0, 0.3), moments=(1.0, 2.0, 3.0))


def test_a_held_torque_is_a_table_that_is_held() -> None:
    values = [(0.5, 0.0, 0.0), (0.0, -1.0, 0.0), (0.2, 0.3, -0.4)]
    held = Scene("held", BRICK.omega, BRICK.moments, torque=table([0.0, 1.0, 2.0], values, "held"))
    truth = solve(held, [1.0, 2.0, 5.0], tolerance=1e-12)
    stepper, by_table = Stepper(BRICK, 1e-12), Stepper(held, 1e-12)
    for k, (value, end) in enumerate(zip(values, (1.0, 2.0, 5.0), strict=True)):
        stepper.held_torque = value
        for each in (stepper, by_table):
            each.until(end)
            np.testing.assert_allclose(each.omega, truth.omega[k], atol=1e-10)
    assert stepper.held_torque.tolist() == [0.2, 0.3, -0.4]


@pytest.mark.parametrize("kind", ["held", "linear"])
def test_a_step_ends_where_a_table_changes(kind: str) -> None:
    torque = table([1.0, 2.5], [(0.5, 0.0, 0.0), (-0.5, 0.2, 0.0)], kind)
    still = Scene("still", (1e-3, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=torque)
    stepper = Stepper(still)
    ends = [stepper.step() for _ in range(4)]
    assert 2.5 in ends
    stepper.until(4.0)
    assert Stepper(still).step(10.0) == (2.5 if kind == "held" else 1.0) or 1.0 in ends
    back = Stepper(still)
    back.until(4.0)
    back.until(0.0)
    np.testing.assert_allclose(back.omega, still.omega, atol=1e-12)


@pytest.mark.parametrize("end", [4.0, -4.0])
def test_lengths_of_steps_are_the_differences_of_their_ends(end: float) -> None:
    lengths = step_lengths(BRICK, False, end, 1e-9, [])
    ends = [0.0, *lengths]
    assert len(ends) > 3
    assert ends[-1] == end
    assert list(lengths.values()) == np.abs(np.diff(ends)).tolist()
    assert [*step_lengths(BRICK, False, end, 1e-9, [end]), end] == ends[1:]


def test_the_state_within_the_last_step() -> None:
    stepper: Any = Stepper(BRICK, 1e-12, attitude=True)
    begin = 0.0
    for _ in range(5):
        end = stepper.step()
        times = np.linspace(begin, end, 7)
        truth: Any = solve(BRICK, times[1:], tolerance=1e-12, attitude=True)
        found = stepper.at(times)
        assert found.shape == (7, 7)
        np.testing.assert_allclose(found[:3, 1:], truth.omega.T, atol=1e-10)
        np.testing.assert_allclose(found[3:, 1:], truth.attitude.T, atol=1e-10)
        now = np.concatenate([stepper.omega, stepper.attitude])
        np.testing.assert_allclose(stepper.at(end), now, rtol=0.0, atol=1e-15)
        begin = end
    assert stepper.steps == 5


def test_before_the_first_step_the_state_is_that_of_time_0() -> None:
    assert Stepper(BRICK, attitude=True).at(0.0).tolist() == [0.1, 2.0, 0.3, 1.0, 0.0, 0.0, 0.0]
    assert Stepper(BRICK).attitude is None


def test_the_state_and_the_scene_may_be_changed() -> None:
    stepper: Any = Stepper(BRICK, 1e-12, attitude=True)
    stepper.until(1.0)
    before = stepper.at(1.0)
    # An impact turns the spin around, and the body returns.
    stepper.omega = -stepper.omega
    assert stepper.at(1.0).tolist() == before.tolist()
    mirrored = Scene("", tuple(stepper.omega), BRICK.moments, attitude=stepper.attitude)
    truth: Any = solve(mirrored, 0.7, tolerance=1e-12, attitude=True)
    stepper.until(1.7)
    np.testing.assert_allclose(stepper.omega, truth.omega[-1], atol=1e-10)
    np.testing.assert_allclose(stepper.attitude, truth.attitude[-1], atol=1e-10)
    # Another body.
    sphere = Scene("sphere", (9.0, 9.0, 9.0), moments=(1.0, 1.0, 1.0))
    omega = stepper.omega
    stepper.scene = sphere
    stepper.until(5.0)
    np.testing.assert_allclose(stepper.omega, omega, atol=1e-12)
    assert stepper.scene is sphere
    stepper.attitude = (0.0, 0.0, 0.0, 2.0)
    assert stepper.attitude.tolist() == [0.0, 0.0, 0.0, 1.0]


def test_results_cannot_be_changed() -> None:
    stepper = Stepper(BRICK, attitude=True)
    for values in (stepper.omega, stepper.held_torque, stepper.attitude):
        assert values is not None
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 7.0
    with pytest.raises(TypeError):
        stepper.states["wheel"] = 1.0  # type: ignore[index]
    with pytest.raises(AttributeError):
        stepper.torque = (1.0, 0.0, 0.0)  # type: ignore[attr-defined]
    for name in ("time", "steps"):
        with pytest.raises(AttributeError):
            setattr(stepper, name, 1)
    # What was set before the first step is the state of time 0.
    stepper.omega = (3.0, 2.0, 1.0)
    assert stepper.at(0.0)[:3].tolist() == [3.0, 2.0, 1.0]


@pytest.mark.parametrize("size", [1e-30, 1e-10, 1.0, 1e20])
def test_errors_from_rest_are_relative_to_the_omega_that_is_reached(size: float) -> None:
    scene = Scene(
        "rest", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0),
        torque=lambda t, omega: [size * np.cos(t * t) + 0.0 * omega[0], 0.0, 0.0],
    )  # fmt: skip
    stepper = Stepper(scene, 1e-8)
    largest = 0.0
    for _ in range(5):
        stepper.step()
        truth = size * quad(lambda t: math.cos(t * t), 0.0, stepper.time, epsrel=1e-12)[0]
        largest = max(largest, abs(truth))
        assert abs(stepper.omega[0] - truth) <= 1e-8 * stepper.steps * largest


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_errors_of_own_states_are_relative_to_their_sizes(size: float) -> None:
    scene = Scene(
        "wave", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), states={"x": size, "v": 0.0},
        torque=lambda t, omega, s: ([0.0, 0.0, 0.0], {"x": s["v"], "v": -s["x"]}),
    )  # fmt: skip
    stepper = Stepper(scene, 1e-10)
    stepper.until(10.0)
    assert abs(stepper.states["x"] / size - math.cos(10.0)) <= 1e-10 * stepper.steps
    assert stepper.steps <= 20


def test_the_least_omega_is_stepped() -> None:
    for omega in ((0.0, 0.0, 1e-300), (1e-300, 2e-300, 3e-300)):
        stepper = Stepper(Scene("", omega, moments=(1.0, 1.0, 1.0)), 1e-14)
        stepper.until(1.0)
        assert stepper.omega.tolist() == pytest.approx(omega, rel=1e-12, abs=0.0)


def test_a_tilted_needle_is_as_exact_as_along_its_axes() -> None:
    axes = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    matrix = axes @ np.diag([1e-8, 1.0, 1.0 + 3e-9]) @ axes.T
    tilted = Scene("needle", tuple(axes @ [0.3, 0.5, 0.7]), inertia=(matrix + matrix.T) / 2)
    stepper = Stepper(tilted, 1e-13)
    stepper.until(3.0)
    assert stepper.omega == pytest.approx(solve(tilted, 3.0).omega[0], rel=0, abs=1e-14)


def test_a_tiny_step_does_not_shorten_the_next() -> None:
    stepper = Stepper(BRICK)
    usual = stepper.step()
    stepper.step(math.ulp(usual))
    assert stepper.time == math.nextafter(usual, math.inf)
    assert stepper.step() > 1.5 * usual


@pytest.mark.parametrize("start", [1.0, 1.35, 1.4])
def test_a_switch_at_the_end_of_a_step_does_not_stop_the_next(start: float) -> None:
    def torque(t: Any, w: Any) -> list[Any]:
        return [0.1 * w[1], np.clip(w[0], -0.3, 0.3), 0.1 * np.sin(t)]

    stepper = Stepper(Scene("", (start, -3.8, 0.6), moments=(1.5, 1.1, 1.4), torque=torque))
    stepper.until(10.0)
    assert stepper.omega == pytest.approx(solve(stepper.scene, 10.0).omega[-1], rel=1e-8)


@pytest.mark.parametrize("longest", [1e-3, -1e-3, 1e9])
def test_a_step_whose_terms_are_infinite_is_shortened(longest: float) -> None:
    cube = Scene(
        "", (1.0, 0.0, 0.0), (1.0, 1.0, 1.0), torque=lambda t, w: [-1e40 * w[0] ** 3, 0, 0]
    )
    stepper = Stepper(cube)
    time = stepper.step(longest)
    assert 0.0 < abs(time) < 1e-40
    assert stepper.omega[0] == pytest.approx(1.0 / math.sqrt(1.0 + 2e40 * time), abs=1e-9)


def test_a_level_is_crossed_where_the_operand_is_a_rounding_error() -> None:
    def torque(t: Any, w: Any) -> list[Any]:
        return [0.1 * np.clip(np.log1p(w[1] ** 2), -1.0, 0.9), 0.0, 0.0]

    omega = (0.5182826958662092, -1.2169234765601231, -1.089492426125041)
    moments = (1.5451530837733427, 2.3063661260959587, 1.3944668890613767)
    stepper = Stepper(Scene("", omega, moments=moments, torque=torque))
    for _ in range(10):
        if stepper.time < 3.0:
            stepper.step(3.0 - stepper.time)
    assert stepper.time == 3.0
    assert stepper.omega == pytest.approx(solve(stepper.scene, 3.0).omega[-1], rel=1e-8)


def test_a_switch_that_becomes_invisible_is_passed() -> None:
    def torque(t: Any, w: Any) -> list[Any]:
        return [0.1 * np.sign(np.sin(0.8 * np.exp(-689.6 * (t + 0.8234) ** 2))), 0.0 * w[0], 0.0]

    stepper = Stepper(Scene("", (0.0, 0.0, 0.4), moments=(1.7, 1.3, 2.5), torque=torque), 1e-6)
    stepper.until(0.5)
    assert stepper.time == 0.5


def test_a_singular_torque_ends_the_steps() -> None:
    scene = Scene(
        "pole", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0),
        torque=lambda t, omega: [1.0 / (1.0 - t) + 0.0 * omega[0], 0.0, 0.0],
    )  # fmt: skip
    stepper = Stepper(scene)
    refused("t = 1 s", stepper.until, 2.0)
    assert stepper.time < 1.0


def test_a_time_that_no_steps_reach_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine_stepper, "_LOOK", 20)
    monkeypatch.setattr(engine_stepper, "_MOST", 200.0)
    stepper = Stepper(BRICK)
    refused("allowed: times that 1e8 steps reach; 20 steps reached", stepper.until, 1000.0)
    stepper.until(stepper.time + 40.0)
    assert 40 < stepper.steps < 220


def test_a_refused_change_changes_nothing() -> None:
    stepper = Stepper(BRICK)
    for omega in ((1.0, math.inf, 2.0), (1.0, 2.0)):
        with pytest.raises(InputError, match="omega"):
            stepper.omega = omega
    with pytest.raises(InputError):
        stepper.scene = Scene("", (1, 2, 3), (1, 2, 3), torque=in_space((1, 2, 3)))
    assert stepper.scene is BRICK
    stepper.until(1.0)
    np.testing.assert_allclose(stepper.omega, solve(BRICK, 1.0).omega[-1], atol=1e-8)


def test_a_control_loop() -> None:
    # The sampled brake multiplies the momentum by 0.995 in each interval.
    stepper = Stepper(Scene("wheel", (0.0, 0.0, 2.0), moments=(1.0, 2.0, 3.0)))
    for k in range(400):
        stepper.held_torque = -1.5 * stepper.omega
        stepper.until(0.01 * (k + 1))
    assert stepper.omega[2] == pytest.approx(2.0 * 0.995**400, rel=1e-9)
    assert stepper.steps <= 800
