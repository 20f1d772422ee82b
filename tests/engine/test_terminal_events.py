"""Terminal events, directions, ready events, and what a trajectory has of events."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import Scene, load, solve
from pyharness.engine.events import event_fits
from pyharness.events import crosses, extremum, flip, tilt
from pyharness.torques import damping, opaque
from tests.campaigns.event_campaign import BODY
from tests.engine.test_events import events_of, second, times_of, with_attributes
from tests.refused import refused


def scipy_events(scene: Scene, end: float, event: Callable[..., Any]) -> list[float]:
    found = solve_ivp(lambda t, w: -w, (0.0, end), scene.omega, events=event, rtol=1e-10)
    return list(found.t_events[0])


@pytest.mark.parametrize("end", [2.0, -2.0])
@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("root", [0.0, 0.6, 1.0])
def test_direction_and_ends_as_in_scipy(
    end: float, direction: int, sign: float, root: float
) -> None:
    scene = Scene("ball", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=damping(1.0))
    event = with_attributes(lambda t, omega: sign * (t - root * end), False, direction)
    # SciPy also reports a root at the start.
    expected = scipy_events(scene, end, event) if root else []
    assert times_of(scene, end, event) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("terminal", [True, 1, 2, 3])
def test_terminal_event_removes_what_follows(terminal: bool | int) -> None:
    event = with_attributes(lambda t, omega: omega[1], terminal)
    rows = np.linspace(0.0, 30.0, 301)
    found: Any = solve(BODY, rows, events=[event, lambda t, omega: t - 4.0, crosses(1)],
                  dense_output=True)  # fmt: skip
    times, states = events_of(found)
    expected = times_of(BODY, 30.0, second)[: int(terminal)]
    assert times[0].tolist() == pytest.approx(expected)
    assert states[0].shape == (int(terminal), 3)
    assert (times[1].size == 1) == (expected[-1] > 4.0)
    assert times[2].max(initial=0.0) <= expected[-1]
    assert found.time.tolist() == rows[rows <= expected[-1]].tolist()
    assert found.omega.shape == (len(found.time), 3)
    assert (found.status, found.success, found.ended) == (1, True, "event")
    assert "terminal event" in found.message
    assert not found.has_all_rows
    assert found.sol.t_max == times[0][-1]


def test_terminal_event_that_does_not_occur() -> None:
    found = solve(BODY, [0.0, 1.0], events=crosses(1, BODY.omega[0], terminal=True))
    assert (events_of(found)[0][0].size, found.time.tolist()) == (0, [0.0, 1.0])
    found = solve(BODY, [10.0, 30.0], events=with_attributes(lambda t, omega: omega[1], 9))
    assert (found.status, found.ended, len(found.time)) == (0, "complete", 2)


def test_each_side_of_0_has_its_terminal_event() -> None:
    rows = [-20.0, -10.0, -1.0, 0.0, 1.0, 10.0, 20.0]
    found = solve(BODY, rows, events=with_attributes(lambda t, omega: omega[1], True))
    (times,), (states,) = events_of(found)
    before, after = times_of(BODY, -20.0, second)[0], times_of(BODY, 20.0, second)[0]
    assert times.tolist() == pytest.approx([before, after])
    assert states.shape == (2, 3)
    assert found.time.tolist() == [t for t in rows if before <= t <= after]
    descending = solve(BODY, rows[::-1], events=with_attributes(lambda t, omega: omega[1], True))
    assert events_of(descending)[0][0].tolist() == times[::-1].tolist()
    np.testing.assert_array_equal(events_of(descending)[1][0], states[::-1])


@pytest.mark.parametrize(("method", "trials"), [("auto", [200.0, 800.0]), ("lsoda", [10.0, 40.0])])
def test_motion_is_computed_little_beyond_a_terminal_event(
    method: str, trials: list[float]
) -> None:
    damped = Scene("at 1 rad/s", (0.3, 0.2, 1.0), moments=(1.0, 2.0, 2.5), torque=damping(1e-3))
    late = 0.4 * trials[-1]
    found = solve(damped, [1.0, 2.0 * late, 1e9], method, 1e-7,
                  events=with_attributes(lambda t, omega: t - late, True))  # fmt: skip
    spent = [solve(damped, end, method, 1e-7, events=second).evaluations for end in trials]
    assert events_of(found)[0][0].tolist() == pytest.approx([late], abs=0.0, rel=1e-14)
    assert (found.ended, found.time.tolist()) == ("event", [1.0])
    assert found.evaluations == pytest.approx(sum(spent), rel=0.02)


def test_terminal_events_at_the_end_of_a_trial_and_on_both_sides() -> None:
    body = Scene("at 1 rad/s", (0.3, 0.2, 1.0), moments=(1.0, 2.0, 2.5))
    for direction in (-1, 0, 1):
        event = with_attributes(lambda t, omega: abs(t) - 200.0, True, direction)
        for sign in (1.0, -1.0):
            rows = [sign * t for t in (100.0, 200.0, 300.0, 900.0)]
            for times in (rows, [rows[0], *rows[2:]]):
                found = solve(body, times, events=event)
                occurs = direction >= 0
                assert events_of(found)[0][0].tolist() == ([200.0 * sign] if occurs else [])
                kept = [t for t in times if abs(t) <= 200.0] if occurs else times
                assert found.time.tolist() == kept
    event = with_attributes(lambda t, omega: (t + 300.0) * (t - 30.0), True)
    found = solve(body, [-1e7, -40.0, 40.0, 1e7], events=event)
    assert events_of(found)[0][0].tolist() == pytest.approx([-300.0, 30.0])
    assert found.time.tolist() == [-40.0]


def test_a_torque_without_a_value_at_time_0_is_told_as_without_events() -> None:
    event = crosses(2, 0.0, terminal=True)
    inverse = Scene(
        "1/t", (1.0, 0.2, 0.1), moments=(1, 2, 2.5), torque=lambda t, w: (1.0 / t, 0, 0)
    )
    assert solve(inverse, 1e4, events=event).ended == "overflow"
    bare = replace(inverse, torque=opaque(lambda t, w: (1.0 / t, 0, 0)))
    refused("the function raised ZeroDivisionError at t = 0 s", solve, bare, 1e4, events=event)


def test_functions_that_change_too_fast_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many jumps are no reason for a refusal, because only those near 0 are searched."""
    monkeypatch.setattr(event_fits, "_MOST_PIECES", 1000)
    for fast in (lambda t, omega: np.sin(2e5 * t), lambda t, omega: np.sin(1e5 * t**4)):
        refused("event 1: the function changes too fast for 1000", solve, BODY, 2.0, events=fast)
    # Nowhere smooth, and far from 0.
    assert times_of(BODY, 0.1, lambda t, omega: 1.0 + 1e-6 * np.sin(1e9 * t)) == []
    smooth = times_of(BODY, 9.0, lambda t, omega: omega[1] - 0.10005)
    stairs = times_of(BODY, 9.0, lambda t, omega: np.round(omega[1], 4) - 0.10005)
    assert len(smooth) == 1
    assert stairs == pytest.approx(smooth, abs=1e-9)


def test_no_events_without_a_request() -> None:
    found = solve(BODY, 1.0)
    assert found.t_events is None
    assert found.y_events is None
    times, states = events_of(solve(BODY, 0.0, events=second))
    assert (times[0].shape, states[0].shape) == ((0,), (0, 3))
    _, states = events_of(solve(BODY, 0.0, attitude=True, events=second))
    assert states[0].shape == (0, 7)
    assert events_of(solve(BODY, 1.0, events=[])) == ([], [])


def test_very_slow_body() -> None:
    found = np.array(times_of(replace(BODY, omega=(1e-201, 2e-200, 1e-201)), 3e201, second))
    np.testing.assert_allclose(found, 1e200 * np.array(times_of(BODY, 30.0, second)), rtol=1e-11)


def test_attitude_is_an_argument_and_in_the_states() -> None:
    ball = Scene("ball", (0.5, 0.0, 0.0), moments=(1.0, 1.0, 1.0))
    (times,), (states,) = events_of(
        solve(ball, 20.0, attitude=True, events=lambda t, omega, attitude: attitude[0])
    )
    assert times == pytest.approx(2.0 * math.pi * np.array([1.0, 3.0]))
    assert states.shape == (2, 7)
    np.testing.assert_allclose(np.abs(states[:, 4]), 1.0)


@pytest.mark.parametrize("axis", [1, 2, 3])
def test_tilt_is_the_angle_of_the_rotation_matrix(axis: int) -> None:
    toward, angle = (1.0, -2.0, 0.5), 1.2
    event = tilt(axis, toward, angle)
    (times,), (states,) = events_of(solve(BODY, 30.0, attitude=True, events=event))
    assert len(times) > 3
    q0, q = states[:, 3], states[:, 4:]
    unit = np.eye(3)[axis - 1]
    turned = unit + 2.0 * np.cross(q, np.cross(q, unit) + q0[:, None] * unit)
    np.testing.assert_allclose(turned @ toward / np.linalg.norm(toward), math.cos(angle), atol=1e-9)
    assert str(tilt(axis, toward, 0.0)).startswith(f"Event(name='tilt({axis}, ")


def test_extrema_are_those_of_the_rows() -> None:
    grid = np.linspace(0.0, 30.0, 30001)
    rows = solve(BODY, grid).omega[:, 1]
    for direction, sign in ((-1, 1.0), (1, -1.0)):
        inner = sign * rows[1:-1]
        tops = grid[1:-1][(inner > sign * rows[:-2]) & (inner > sign * rows[2:])]
        found = times_of(BODY, 30.0, extremum(2, direction=direction))
        assert found == pytest.approx(tops.tolist(), abs=2e-3)
        assert len(found) >= 2


@pytest.mark.parametrize("end", [0.005, -0.005])
def test_events_are_in_the_order_of_integration(end: float) -> None:
    found: Any = solve(Scene("fast", (1.0, 4e4, 1.0), moments=(1.0, 2.0, 3.0)), end, events=flip(1))
    assert len(found.t_events[0]) > 3
    assert (np.diff(np.abs(found.t_events[0])) > 0.0).all()


def test_overflow_after_the_last_row() -> None:
    runaway = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    found = solve(runaway, [0.5, 0.9, 2.0], events=crosses(1, 4.0))
    assert (found.ended, found.status) == ("overflow", -1)
    assert events_of(found)[0][0].tolist() == pytest.approx([0.75])
    ended = solve(runaway, [0.5, 0.9, 2.0], events=crosses(1, 4.0, terminal=True))
    assert (ended.ended, ended.time.tolist()) == ("event", [0.5])


def test_ending_is_saved(tmp_path: Path) -> None:
    solve(BODY, [1.0, 9.0], events=crosses(2, 0.0, terminal=True)).save(tmp_path / "found.npz")
    assert load(tmp_path / "found.npz").status == 1


_SPUN = Scene("spun", (0.3, 0.2, 1.0), moments=(1.0, 2.0, 2.5), attitude=(1.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("sides", [(0.0, 9.0), (0.0, -9.0), (-9.0, 9.0), (9.0, -9.0)])
@pytest.mark.parametrize("more", [{"attitude": True}, {"sensitivities": ["moments"]}])
@pytest.mark.parametrize("torque", [(0.0, 0.0, 0.0), damping(0.01)])
def test_every_array_ends_at_a_terminal_event(
    torque: Any, more: dict[str, Any], sides: tuple[float, float]
) -> None:
    """Arrays with a row for each time of a trajectory have those up to the event, and no others."""
    scene, rows = replace(_SPUN, torque=torque), np.linspace(*sides, 37)
    event = with_attributes(lambda t, omega: abs(t) - 5.1, True)
    found, plain = solve(scene, rows, events=event, **more), solve(scene, rows, **more)
    kept = np.abs(rows) < 5.1
    compared = []
    for name in dir(plain):
        if name.startswith("_") or callable(whole := getattr(plain, name)):
            continue
        cut = getattr(found, name)
        pairs = [(cut[key], whole[key]) for key in whole] if isinstance(whole, dict) else []
        for part, every in pairs or [(cut, whole)]:
            if isinstance(every, np.ndarray) and 37 in every.shape:
                expected = np.compress(kept, every, axis=every.shape.index(37))
                np.testing.assert_allclose(part, expected, rtol=1e-9, atol=1e-9, err_msg=name)
                compared.append(name)
    assert {"time", "omega", "y", *more} <= {*compared}
