"""Tests of dense output: the solution as a function of time, for every method."""

import itertools
import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.integrate

from pyharness import ChangingMoments, InputError, Scene, TorqueLaw, Trajectory, solve, torques
from pyharness.engine.methods import taylor
from pyharness.engine.plan.registry import FIXED_STEP, SCIPY_METHODS
from pyharness.engine.steps import dense
from pyharness.events import crosses
from pyharness.model.dense_output import DenseOutput, Pieces
from tests.campaigns import dense_campaign
from tests.conftest import Capture, Patch

MOMENTS = (1.0, 2.0, 3.0)
OMEGA = (0.1, 2.0, 0.1)
BRICK = Scene("brick", OMEGA, moments=MOMENTS, step_size=0.01)
LAW = TorqueLaw((0.1, 0.2, 0.0), sines=[((0.1, 0.0, 0.3), 2.0)])
TABLE = torques.table(
    [0.0, 3.0, 7.0, 11.0],
    [[0.0, 0.0, 0.1], [0.2, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.0]],
    "held",
)
SCENES = {
    "free": BRICK,
    "law": replace(BRICK, torque=LAW),
    "damping": replace(BRICK, torque=torques.damping(0.05)),
    "table": replace(BRICK, torque=TABLE),
    "full": Scene(
        "full", OMEGA, inertia=[[2.0, 0.3, 0.1], [0.3, 3.0, -0.2], [0.1, -0.2, 4.0]], torque=LAW
    ),
    "changing": Scene("changing", OMEGA, moments=ChangingMoments([[1.0, 0.05], [2.0], [3.0]])),
    "space": replace(BRICK, torque=replace(LAW, frame="space")),
}


def sol_of(found: Trajectory) -> DenseOutput:
    assert found.sol is not None
    return found.sol


def largest_error(sol: DenseOutput, truth: Trajectory) -> float:
    """Return the largest error at the times of a trajectory: relative, or of a quaternion."""
    state = sol(truth.time)
    error = float(np.abs(state[:3].T - truth.omega).max() / np.abs(truth.omega).max())
    if len(state) > 3 and truth.attitude is not None:
        error = max(error, 2.0 * float(np.abs(state[3:].T - truth.attitude).max()))
    return error


def test_the_polynomials_join() -> None:
    pieces = sol_of(solve(SCENES["law"], [-4.0, 12.0], attitude=True, dense_output=True)).states
    assert isinstance(pieces, Pieces)
    inner = pieces.edges[1:-1]
    assert len(inner) > 10
    # Adjacent steps have rounding errors of their own.
    assert pieces.values[:-1, -1] == pytest.approx(pieces.values[1:, 0], rel=0.0, abs=4e-15)
    before = pieces(np.nextafter(inner, -math.inf))
    # The state changes by some spacings of the time, which are up to 2e-15 s.
    assert before == pytest.approx(pieces(inner), rel=0.0, abs=1e-14)


def test_breakpoints_of_a_table_end_polynomials() -> None:
    pieces = sol_of(solve(SCENES["table"], [5.0, 12.0], dense_output=True)).states
    assert isinstance(pieces, Pieces)
    assert {3.0, 7.0, 11.0} <= set(pieces.edges.tolist())


@pytest.mark.parametrize("name", SCENES)
def test_the_derivative_is_that_of_the_solution(name: str) -> None:
    turning = name != "changing"
    found = solve(SCENES[name], [-4.0, 12.0], tolerance=1e-13, attitude=turning, dense_output=True)
    sol = sol_of(found)
    times = np.array([-3.3, -1.0, 0.5, 2.2, 6.6, 9.0])
    step = 1e-3
    # A central difference of the sixth order.
    weights = {1: 45.0, 2: -9.0, 3: 1.0}
    slope = sum(w * (sol(times + k * step) - sol(times - k * step)) for k, w in weights.items())
    assert sol.derivative(times) == pytest.approx(slope / (60.0 * step), rel=0.0, abs=1e-9)


def test_the_derivative_of_omega_about_body_axes_without_attitude() -> None:
    found = [
        sol_of(solve(SCENES["full"], 3.0, "taylor", 1e-12, attitude=turns, dense_output=True))
        for turns in (False, True)
    ]
    without, turning = (sol.derivative(2.0) for sol in found)
    assert without == pytest.approx(turning[:3], abs=1e-10)


def test_the_derivative_under_an_opaque_torque() -> None:
    torque = torques.opaque(lambda t, omega: [-0.1 * omega[0], 0.0, math.sin(t)])
    scene = Scene("opaque", (1.0, 0.0, 0.0), moments=(2.0, 2.0, 2.0), torque=torque)
    sol = sol_of(solve(scene, 3.0, "dop853", 1e-9, dense_output=True))
    assert sol.derivative(2.0) == pytest.approx(
        [-0.05 * math.exp(-0.1), 0.0, 0.5 * math.sin(2.0)], abs=1e-8
    )


@pytest.mark.parametrize("method", FIXED_STEP)
def test_a_method_with_a_fixed_step_has_a_cubic_polynomial_on_each_step(method: str) -> None:
    scene = SCENES["law"]
    found = solve(scene, [-0.355, 1.0, 2.0], method, dense_output=True)
    sol = sol_of(found)
    steps = solve(scene, [0.01, 0.5, 1.99], method)
    assert sol(steps.time) == pytest.approx(steps.y, rel=0.0, abs=1e-15)
    assert sol(found.time) == pytest.approx(found.y, rel=0.0, abs=2e-14)
    truth = solve(scene, [0.123, 1.234], tolerance=1e-13)
    assert largest_error(sol, truth) <= (1e-8 if method == "rk4" else 1e-4)


def test_times_before_and_after() -> None:
    down = solve(BRICK, [2.0, -3.0], dense_output=True)
    assert (sol_of(down).t_min, sol_of(down).t_max) == (-3.0, 2.0)
    back = solve(SCENES["law"], [-1.0, -3.0], dense_output=True)
    assert (sol_of(back).t_min, sol_of(back).t_max) == (-3.0, 0.0)
    assert sol_of(back)(0.0) == pytest.approx(OMEGA, rel=1e-15)
    assert sol_of(solve(BRICK, 0.0, dense_output=True))(0.0).tolist() == list(OMEGA)


def test_shapes_and_defaults() -> None:
    assert solve(BRICK, 2.0).sol is None
    sol = sol_of(solve(SCENES["law"], 2.0, attitude=True, dense_output=True))
    assert sol(1.0).shape == (7,)
    assert sol([1.0, 0.5, 1.0]).shape == sol.derivative((1.0, 0.5, 1.0)).shape == (7, 3)
    assert sol([]).shape == sol.derivative([]).shape == (7, 0)
    times = np.linspace(0.0, 2.0, 48_001)
    assert np.linalg.norm(sol(times)[3:], axis=0) == pytest.approx(1.0, abs=4e-16)
    assert sol(times)[:, [7, 47_999]].tolist() == sol(times[[7, 47_999]]).tolist()
    # A state does not depend on how many are computed together.
    for k in (7, 48_000):
        assert sol(times)[:, k].tolist() == sol(times[k]).tolist()
    again = pickle.loads(pickle.dumps(sol))
    assert again(1.0).tolist() == sol(1.0).tolist()
    assert again.derivative(1.0).tolist() == sol.derivative(1.0).tolist()


@pytest.mark.parametrize(("end", "count"), [(0.3, 3), (-0.6, 6), (0.7, 7), (1.2, 12)])
def test_the_last_of_equally_spaced_times_may_be_rounded_up(end: float, count: int) -> None:
    sol = sol_of(solve(BRICK, end, dense_output=True))
    times = np.arange(count + 1) * math.copysign(0.1, end)
    assert abs(times[-1]) > abs(end)
    for call in (sol, sol.derivative):
        assert call(times)[:, -1].tolist() == call(end).tolist() == call(times[-1]).tolist()


def test_an_overflow_ends_the_function() -> None:
    sphere = replace(BRICK, moments=(1.0, 1.0, 1.0))
    scene = replace(sphere, torque=torques.recorded(lambda t, w: [w[0] * w[0], 0.0, 0.0]))
    found = solve(scene, [1.0, 5.0, 50.0], dense_output=True)
    assert found.ended == "overflow"
    assert sol_of(found).t_max == found.time[-1] < 50.0
    nothing = solve(scene, [50.0], dense_output=True)
    assert (sol_of(nothing).t_min, sol_of(nothing).t_max) == (0.0, 0.0)


def test_the_smallest_tolerance_of_a_method_is_enough() -> None:
    # Results at the nodes would be computed to a quarter of the tolerance.
    with pytest.raises(InputError, match="tolerance"):
        solve(BRICK, [-5.0, 20.0], "dop853", 1e-9, attitude=True)
    found = solve(BRICK, [-5.0, 20.0], "dop853", 4e-9, attitude=True, dense_output=True)
    truth = solve(BRICK, [-3.3, 7.7, 19.1], attitude=True)
    assert largest_error(sol_of(found), truth) <= 4e-9


def test_too_many_polynomials_are_refused(monkeypatch: Patch) -> None:
    monkeypatch.setattr(dense, "_MOST_PIECES", 5)
    for method in ("gauss-4", "rk4"):
        with pytest.raises(InputError, match="dense output"):
            solve(SCENES["law"], 20.0, method, dense_output=True)
    five = solve(replace(SCENES["law"], step_size=0.5), [-2.5, 2.5], "rk4", dense_output=True)
    assert five.sol is not None
    with pytest.raises(InputError, match="more than 5 steps"):
        solve(replace(SCENES["law"], step_size=0.5), 2.75, "rk4", dense_output=True)


def test_a_short_campaign() -> None:
    assert dense_campaign.main(["4", "test"]) == 0


def test_a_wrong_dense_output_is_reported(monkeypatch: Patch, capsys: Capture) -> None:
    right = Pieces.__call__
    monkeypatch.setattr(Pieces, "__call__", lambda own, times: right(own, times) * (1.0 + 2e-3))
    assert dense_campaign.main(["4", "test"]) == 1
    assert " times the limit" in capsys.readouterr().out


def test_a_fast_small_wave_is_no_roughness_of_the_method() -> None:
    """The wave turns 56 radians between 17 nodes, and its amplitude is a few tolerances."""
    law = TorqueLaw(sines=[((-5.95e-4, 4.26e-4, -6.21e-4), 12.2)])
    scene = Scene("wave", (9e-5, -0.7, -1e-4), moments=(23.0, 37.0, 52.0), torque=law)
    times = np.linspace(-18.45, 0.0, 400)
    truth = solve(scene, times).omega
    for method in ("rk45", "dop853", "auto"):
        found: Any = solve(scene, -18.45, method, 1e-6, dense_output=True)
        assert np.abs(found.sol(times).T - truth).max() <= 0.7e-6, method


@pytest.mark.campaign
def test_rounding_errors_above_the_tolerance_are_not_resolved() -> None:
    """They grow with the error amplification, and no polynomial is as accurate as the tolerance."""
    scene = Scene("wing nut", (0.01, 5.0, 0.0), moments=(1.0, 2.0, 3.0))
    found: Any = solve(scene, 2000.0, "taylor", 1e-14, dense_output=True)
    assert found.ended == "sensitive"
    assert isinstance(found.sol.states, Pieces)
    assert len(found.sol.states.edges) < 20_000
    times = np.linspace(0.0, 2000.0, 501)
    apart = np.abs(found.sol(times).T - solve(scene, times, "closed-form").omega)
    assert apart.max() <= 5.0 * (1e-14 + 4e-14 * found.growth)


@pytest.mark.parametrize("possible", [0.0, 0.5, 0.9])
def test_the_nodes_are_more_accurate_than_the_tolerance(possible: float) -> None:
    """Polynomials through errors of the whole tolerance would have larger errors."""
    scene = Scene("body", (1.0, 2.0, 3.0), moments=(1.0, 2.0, 2.5))
    used = []

    def rows(times: Any, tolerance: float) -> Trajectory:
        used.append(tolerance)
        if tolerance < possible * 1e-6:
            raise InputError("too small")
        return solve(scene, times, "taylor", tolerance)

    found = solve(scene, 2.0, "taylor", 1e-6)
    if possible == 0.9:
        with pytest.raises(InputError, match="too small"):
            dense.state_pieces(scene, found, rows, 1e-6, 1e-15)
        return
    dense.state_pieces(scene, found, rows, 1e-6, 1e-15)
    assert used[-1] == pytest.approx(0.75e-6 if possible else 0.25e-6)


@pytest.mark.parametrize("width", [1e-4, 2e-3, 3e-2])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_short_excursion_shows_in_polynomials_and_events(width: float, side: float) -> None:
    """A torque there and back: omega is 0.5 + exp(-x^2), and the rows know nothing of it."""
    middle = 4.3 * side

    def torque(t: Any, w: Any) -> Any:
        x = (t - middle) / width
        return [0.0 * t, 0.0 * t, -2.0 / width * x * np.exp(-x * x)]

    scene = Scene("ball", (0.0, 0.0, 0.5), moments=(1.0, 1.0, 1.0), torque=torque)
    found: Any = solve(
        scene, [10.0 * side], tolerance=1e-9, dense_output=True, events=crosses(3, 1.0)
    )
    times = middle + width * np.linspace(-3.0, 3.0, 101)
    wanted = 0.5 + np.exp(-(((times - middle) / width) ** 2))
    assert np.abs(found.sol(times)[2] - wanted).max() < 1e-8
    away = width * math.sqrt(math.log(2.0))
    crossed = np.sort(found.t_events[0])
    assert crossed == pytest.approx([middle - away, middle + away], abs=1e-7 * width)


def test_changing_inertia_has_steps_too() -> None:
    moments = ChangingMoments([[2.0, 0.01], [3.0], [4.0]])

    def torque(t: Any, w: Any) -> Any:
        x = (t - 5.0) / 1e-3
        return [0.0 * t, 0.0 * t, -1e3 * x * np.exp(-x * x)]

    scene = Scene("", (0.1, 0.2, 0.5), moments=moments, torque=torque)
    found: Any = solve(scene, [10.0], tolerance=1e-9, dense_output=True)
    assert found.sol(5.0)[2] == pytest.approx(solve(scene, [5.0]).omega[0, 2], abs=1e-8)


@pytest.mark.parametrize("name", ["damping", "table", "changing", "full", "turning", "fast"])
def test_the_steps_of_a_recorded_torque_are_read_and_nothing_is_solved_again(
    name: str, monkeypatch: Patch
) -> None:
    recorded = {
        "full": replace(SCENES["full"], torque=torques.damping([0.1, 0.2, 0.3])),
        "turning": replace(
            SCENES["full"], torque=torques.recorded(lambda t, w, q: [0.3 * q[1], q[2] * q[0], 0.0])
        ),
        # In another unit of time.
        "fast": Scene("fast", (1e200, 2e200, 1e199), MOMENTS, torque=torques.damping(1e199)),
    }
    scene = {**SCENES, **recorded}[name]
    ends = [-1e-200, 4e-200] if name == "fast" else [-2.0, 9.0]
    times = np.random.default_rng(54).uniform(ends[0], ends[1], 50)
    times.sort()
    truth = solve(scene, times, tolerance=1e-14, attitude=True)
    monkeypatch.setattr(
        "pyharness.engine.solve._more_rows", lambda *given: pytest.fail("solved again")
    )
    sol = sol_of(solve(scene, ends, tolerance=1e-10, attitude=True, dense_output=True))
    assert isinstance(sol.states, Pieces)
    assert [sol.t_min, sol.t_max] == ends
    assert largest_error(sol, truth) <= 1e-10
    if name != "fast":  # whose products of omega overflow
        apart = 1e-6 * ends[1]
        inner = np.clip(times, ends[0] + apart, ends[1] - apart)
        slope = (sol(inner + apart) - sol(inner - apart)) / (2.0 * apart)
        assert np.abs(sol.derivative(inner) - slope).max() <= 1e-5 * np.abs(slope).max()
    assert solve(scene, ends, events=lambda t, w: w[1] - 1.0).t_events is not None


def test_steps_beyond_those_that_are_kept_are_replaced(monkeypatch: Patch) -> None:
    scene, times = SCENES["damping"], np.linspace(0.1, 40.0, 30)
    truth = solve(scene, times, tolerance=1e-14)
    kept = solve(scene, 40.0, tolerance=1e-10, dense_output=True)
    monkeypatch.setattr(taylor, "MOST_STEPS", kept.steps - 1)
    other = solve(scene, 40.0, tolerance=1e-10, dense_output=True)
    counts = [len(sol_of(each).states.edges) - 1 for each in (kept, other)]  # type: ignore[attr-defined]
    assert counts[0] == kept.steps
    assert counts[1] != kept.steps
    for each in (kept, other):
        assert largest_error(sol_of(each), truth) <= 1e-10


@pytest.mark.parametrize("method", SCIPY_METHODS)
@pytest.mark.parametrize("name", ["free", "law", "damping"])
def test_scipy_methods_integrate_once_for_dense_output(
    name: str, method: str, monkeypatch: Patch
) -> None:
    monkeypatch.setattr("pyharness.engine.solve.solution_of", None)  # would solve again
    found = solve(SCENES[name], [-1.5, 4.0], method, 1e-6, dense_output=True)
    times = np.linspace(-1.5, 4.0, 301)
    truth = solve(SCENES[name], times, tolerance=1e-12, attitude=found.attitude is not None)
    assert largest_error(sol_of(found), truth) <= 1e-6


def test_scipy_without_dense_output_is_asked_for_rows(monkeypatch: Patch) -> None:
    """SciPy has none if two steps end at one time, as beside a switch."""
    real, calls = scipy.integrate.solve_ivp, itertools.count()

    def without(*given: Any, dense_output: bool, **more: Any) -> Any:
        if dense_output and more["t_eval"] is not None and next(calls) % 2 == 0:
            raise ValueError("`ts` must be strictly increasing or decreasing.")
        return real(*given, dense_output=dense_output, **more)

    monkeypatch.setattr("scipy.integrate.solve_ivp", without)
    for name in ("law", "damping", "table"):
        found = solve(SCENES[name], 4.0, "dop853", 1e-6, dense_output=True)
        truth = solve(SCENES[name], np.linspace(0.0, 4.0, 101), tolerance=1e-12)
        assert largest_error(sol_of(found), truth) <= 1e-6


@pytest.mark.parametrize("name", [each for each in SCENES if each != "free"])
def test_steps_are_those_of_the_integration_and_have_its_rows(
    name: str, monkeypatch: Patch
) -> None:
    monkeypatch.setattr("pyharness.engine.solve.solution_of", None)  # would solve again
    times, turning = np.linspace(0.3, 12.0, 40), name != "changing"
    found = solve(SCENES[name], times, tolerance=1e-5, attitude=turning, dense_output=True)
    rows = sol_of(found)(times)
    assert pytest.approx(found.omega, rel=0.0, abs=2e-13) == rows[:3].T
    if found.attitude is not None:
        assert pytest.approx(found.attitude, rel=0.0, abs=2e-13) == rows[3:].T
