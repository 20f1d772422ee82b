"""Dense output and events between the ends of steps: high degrees, switches, torques that jump."""

import math
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, Trajectory, opaque, solve
from pyharness.model.dense_output import DenseOutput, Pieces
from pyharness.torques import damping
from tests.campaigns import continuous_campaign, driver

MOMENTS = (1.0, 2.0, 3.0)


def sol_of(found: Trajectory) -> DenseOutput:
    assert found.sol is not None
    return found.sol


def count_parts(found: Trajectory) -> int:
    pieces = sol_of(found).states
    assert isinstance(pieces, Pieces)
    return len(pieces.edges) - 1


def power(degree: int) -> Scene:
    """Return a scene with an own state t^degree, and omega3 0.1 + t^degree."""

    def torque(t: Any, w: Any, states: Any) -> Any:
        rate = degree * t ** (degree - 1)
        return [0.0 * t, 0.0 * t, 3.0 * rate], {"x": rate}

    return Scene("power", (0.0, 0.0, 0.1), moments=MOMENTS, torque=torque, states={"x": 0.0})


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize("degree", [16, 17, 20, 22, 25, 28, 30])
@pytest.mark.parametrize("turning", [False, True])
def test_a_step_of_any_degree_is_read_between_its_ends(
    degree: int, tolerance: float, turning: bool
) -> None:
    """Polynomials through 17 nodes leave out degrees above 16."""
    ends = (-0.8, 1.0)
    found = solve(power(degree), ends, tolerance=tolerance, attitude=turning, dense_output=True)
    plain = solve(power(degree), ends, tolerance=tolerance, attitude=turning)
    assert found.y.tolist() == plain.y.tolist()
    assert found.steps == plain.steps
    times = np.linspace(*ends, 301)
    sol, allowed = sol_of(found), min(tolerance, found.error or 0.0) + 4e-15
    state, exact = sol(times), times**degree
    apart = np.abs([state[2] - 0.1 - exact, state[-1] - exact])
    assert apart[:, times >= 0.0].max() <= allowed
    assert apart.max() <= 2.0 * allowed  # a state is smaller before time 0
    if turning:
        angle = 0.5 * (0.1 * times + times ** (degree + 1) / (degree + 1))
        wanted = [np.cos(angle), 0.0 * angle, 0.0 * angle, np.sin(angle)]
        assert np.abs(state[3:7] - wanted).max() <= allowed
    slope = degree * times ** (degree - 1)
    assert np.abs(sol.derivative(times)[[2, -1]] - slope).max() <= 1e-12


def test_only_steps_that_need_it_are_divided() -> None:
    divided = solve(power(25), 1.0, tolerance=1e-12, dense_output=True)
    assert divided.steps < count_parts(divided) <= 8 * divided.steps
    scene = Scene("", (0.1, 2.0, 0.1), moments=MOMENTS, torque=damping(0.05))
    for tolerance in (1e-5, 1e-9, 1e-13):
        plain = solve(scene, 12.0, tolerance=tolerance, attitude=True, dense_output=True)
        assert count_parts(plain) == plain.steps


@pytest.mark.parametrize("degree", [17, 25, 30])
@pytest.mark.parametrize("name", ["omega", "state", "product"])
def test_events_of_high_degrees_are_at_their_times(degree: int, name: str) -> None:
    """Levels of t^n, and of (t^n + 0.1) t^n."""
    levels = [0.05, 0.1, 0.3, 0.5, 0.9]
    functions = {
        "omega": lambda level: lambda t, w, states: w[2] - 0.1 - level,
        "state": lambda level: lambda t, w, states: states["x"] - level,
        "product": lambda level: lambda t, w, states: w[2] * states["x"] - level * (level + 0.1),
    }
    events = [functions[name](level) for level in levels]
    found: Any = solve(power(degree), 1.0, tolerance=1e-12, events=events)
    assert [len(each) for each in found.t_events] == [1] * len(levels)
    wanted = np.array(levels) ** (1.0 / degree)
    assert np.concatenate(found.t_events) == pytest.approx(wanted, rel=0.0, abs=1e-13)


# Functions of time, and their integrals from 0: a break of a table, a switch, and neither.
DIVIDED: dict[str, Any] = {
    "table": (
        lambda t: 25.0 * t**24 + np.interp(t, [0.1, 0.15, 0.25], [0.0, 0.2, 0.0]),
        lambda t: t**25 + tent(t),
    ),
    "switch": (
        lambda t: np.where(t > 0.2, 25.0 / 0.8 * ((t - 0.2) / 0.8) ** 24, 0.0),
        lambda t: np.maximum((t - 0.2) / 0.8, 0.0) ** 25,
    ),
    "product": (
        lambda t: t**25 * np.cos(t) + 25.0 * t**24 * np.sin(t),
        lambda t: t**25 * np.sin(t),
    ),
}


def tent(t: Any) -> Any:
    """Return the integral of a function that rises from 0.1 to 0.2 at 0.15, and falls to 0.25."""
    up, down = np.clip(t, 0.1, 0.15) - 0.1, np.clip(t, 0.15, 0.25) - 0.15
    return 2.0 * up * up + 0.2 * down - down * down


@pytest.mark.parametrize("name", DIVIDED)
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("body", ["moments", "inertia"])
def test_divided_steps_end_at_switches_and_breaks(name: str, side: float, body: str) -> None:
    rate, integral = DIVIDED[name]

    def torque(t: Any, w: Any) -> Any:
        return [0.0, 0.0, side * rate(side * t)]

    shape: Any = {
        "moments": (1.5, 2.0, 1.0),
        "inertia": [[2.0, 0.4, 0.0], [0.4, 2.0, 0.0], [0.0, 0.0, 1.0]],
    }
    scene = Scene("", (0.0, 0.0, 0.1), torque=torque, **{body: shape[body]})
    found = solve(scene, side, tolerance=1e-13, dense_output=True)
    times = np.linspace(0.0, 1.0, 201)
    wanted = 0.1 + integral(times)
    assert np.abs(sol_of(found)(side * times)[2] - wanted).max() <= 1e-13 * wanted.max() + 1e-15


@pytest.mark.parametrize("method", ["rk45", "radau", "dop853", "lsoda"])
@pytest.mark.parametrize("kind", ["time", "state", "clip"])
def test_dense_output_under_an_opaque_torque_that_jumps(method: str, kind: str) -> None:
    """Omega1 rises by 1 rad/s2 from 0.3 s on, gradually or not; or half as fast from 0.5 rad/s."""
    torques_and_omegas: dict[str, Any] = {
        "time": (lambda t, w: [1.0 if t > 0.3 else 0.0, 0.0, 0.0], lambda t: max(0.0, t - 0.3)),
        "state": (
            lambda t, w: [1.0 if w[0] < 0.5 else 0.5, 0.0, 0.0],
            lambda t: min(t, 0.25 + t / 2),
        ),
        "clip": (
            lambda t, w: [min(1.0, max(0.0, 10.0 * (t - 0.3))), 0.0, 0.0],
            lambda t: max(0.0, t - 0.35) if t > 0.4 else 5.0 * max(0.0, t - 0.3) ** 2,
        ),
    }
    function, exact = torques_and_omegas[kind]
    scene = Scene("s", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=opaque(function))
    tolerance = 1e-8 if kind == "time" else 1e-6
    found = solve(scene, 2.0, method, tolerance, dense_output=True)
    times = np.linspace(0.0, 2.0, 201)
    wanted = np.array([exact(t) for t in times.tolist()])
    assert np.abs(sol_of(found)(times)[0] - wanted).max() <= tolerance * wanted.max()


@pytest.mark.parametrize(
    ("method", "end"),
    [("dop853", 4.0), ("dop853", -1.5), ("rk45", 4.0), ("radau", 1.5), ("lsoda", -4.0)],
)
def test_an_opaque_torque_is_solved_once_for_rows_events_and_dense_output(
    method: str, end: float
) -> None:
    calls = 0

    def brake(time: float, omega: Any) -> Any:
        nonlocal calls
        calls += 1
        push = math.sin(3.0 * time)
        return [min(0.5, max(-0.5, push - 0.8 * w)) for w in omega.tolist()]

    scene = Scene("brake", (1.0, 0.2, -0.7), moments=(1.0, 2.0, 2.5), torque=opaque(brake))
    found: Any = solve(scene, end, method, 1e-4, dense_output=True, events=lambda t, w: w[2])
    assert calls <= found.evaluations + 2
    times = np.linspace(0.0, end, 101)[1:]
    truth = solve(scene, times, "lsoda", 1e-6)
    assert np.abs(sol_of(found)(times).T - truth.omega).max() <= 1e-4 * np.abs(truth.omega).max()
    assert len(found.t_events[0]) == np.sum(np.diff(np.sign(truth.omega[:, 2])) != 0.0)


@pytest.mark.parametrize("first", [0, 4, 8])
def test_a_short_campaign(first: int) -> None:
    module = continuous_campaign.MODULE
    tally = driver.campaign(module, continuous_campaign.try_scene, 4, "short", first)
    assert tally.faults == []
    assert tally.counts["left out"] <= 1
    assert tally.counts["roots"] > 4
