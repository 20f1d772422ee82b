"""Runge-Kutta for few digits: it keeps its tolerance, also on scenes that it was not tuned on."""

from dataclasses import replace
from functools import cache
from itertools import islice

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, prepare, solve
from pyharness.engine.system.kernel_input import normalized
from pyharness.model.extension import extension
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference
from tests.checks.scenes.timed_kinds import NASTY, timed_scenes


@cache
def _truth(case: int, time: float) -> Array:
    return np.asarray(reference(case_scene(case), [time]).omega[0])


def _ratios(
    scene: Scene, t_end: float, tolerance: float, truth: Array
) -> dict[str, tuple[float, str]]:
    """Return error over tolerance, and status, by method; `truth` ends with the row of `t_end`."""
    scale = max(np.abs(truth).max(), max(map(abs, scene.omega))) or 1.0
    found = {}
    for method in ("quick", "auto"):
        solver = prepare(scene, method, tolerance)
        error = np.abs(solver(np.array(scene.omega), t_end) - truth[-1]).max()
        found[method] = float(error / (scale * tolerance)), solver.status
    return found


@pytest.mark.parametrize("kind", NASTY)
def test_tolerance_holds_on_nasty_scenes(kind: str) -> None:
    """Compare with the series at 1e-14, which is an independent method."""
    scenes = timed_scenes(kind, [1982, list(NASTY).index(kind)])
    complete = runs = 0
    for number, (scene, t_end) in enumerate(islice(scenes, 40)):
        times = np.linspace(0.0, t_end, 33)[1:]
        rows, n_rows, *_ = extension().taylor_rows(*normalized(scene), scene.omega, times, 1e-14)
        if n_rows < len(times):
            continue
        for tolerance in (1e-2, 1e-3, 1e-4, 1e-6):
            ratios = _ratios(scene, t_end, tolerance, rows.T)
            runs += 1
            complete += ratios["quick"][1] == "complete"
            for method, (ratio, status) in ratios.items():
                what = f"{kind} {number}, {method} to {tolerance:g}: {ratio:.3g}"
                assert ratio <= 1.0 or status in ("refused", "gave up"), what
    assert complete >= 0.9 * runs > 100


@pytest.mark.parametrize(("kind", "number", "tolerance"), [
    ("nearly symmetric", 46, 3e-2), ("near the separatrix", 146, 1e-2),
    ("violent torque", 149, 3e-2), ("no body", 78, 1e-2),
    ("long", 27, 1e-3), ("long", 37, 1e-3),
    ("resonant", 13, 1e-2), ("resonant", 27, 1e-6), ("resonant", 28, 1e-3),
    ("resonant", 143, 1e-2), ("resonant", 39, 1e-2),
    ("fast waves", 8, 1e-4), ("fast waves", 37, 1e-6), ("fast waves", 95, 1e-2),
])  # fmt: skip
def test_gaps_that_are_small_by_chance_are_not_believed(
    kind: str, number: int, tolerance: float
) -> None:
    """Draws, of 15 000, that fail first if one gap (of results with h and 2 h) is trusted."""
    scene, t_end = next(islice(timed_scenes(kind, [7, list(NASTY).index(kind)]), number, None))
    truth = solve(scene, np.linspace(0.0, t_end, 33)[1:].tolist(), "taylor", 1e-13).omega
    ratio, status = _ratios(scene, t_end, tolerance, truth)["quick"]
    assert status == "complete"
    assert ratio <= 0.2


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
@pytest.mark.parametrize("case", [3, 4, 5, 6])
def test_result_is_extrapolated(case: int, tolerance: float) -> None:
    """Without its leading term the error is far smaller than with as many plain steps (eq. 31)."""
    scene = case_scene(case)
    solver = prepare(scene, "quick", tolerance)
    found = solver(np.array(scene.omega), 3.0).copy()
    plainly = prepare(replace(scene, step_size=3.0 / solver.steps), "rk4")
    steps = plainly(np.array(scene.omega), 3.0)
    assert plainly.steps == solver.steps
    truth = _truth(case, 3.0)
    assert np.abs(found - truth).max() < 0.5 * np.abs(steps - truth).max()


def test_more_steps_than_were_planned_by_far_are_no_way_out() -> None:
    """Perturbations grow here until rounding dominates, which the status soon reports."""
    law = TorqueLaw(sines=(((3.0, 1.0, -2.0), 4.0),), cosines=(((0.0, 2.0, 1.0), 1.3),))
    scene = Scene("", (0.3, 1.0, 0.2), moments=(3.0, 2.0, 1.2), torque=law)
    solver = prepare(scene, "quick", 1e-6)
    assert np.isnan(solver(np.array(scene.omega), 50.0)).all()
    assert solver.status == "gave up"
    assert solver.steps < 50_000


def test_steps_that_tell_nothing_are_not_trusted() -> None:
    """Long steps damp this motion to nothing, and steps of four times the length diverge."""
    torque = TorqueLaw(
        cosines=(((-50000.0, 2000.0, 50000.0), 93.9),), sines=(((0.0, 0.0, -300.0), 148.0),)
    )
    scene = Scene("", (-0.2, 0.0, -0.3), moments=(7.8, 9.3, 1.6), torque=torque)
    truth = solve(scene, [0.4, 0.8], "taylor", 1e-13).omega
    for ratio, _ in _ratios(scene, 0.8, 1e-2, truth).values():
        assert not ratio > 1.0


def test_fast_weak_waves_are_averaged_and_their_integral_is_exact() -> None:
    """Case 7 to 1e-3: a few steps suffice for 300 radians of torque."""
    scene = case_scene(7)
    solver, finer = (prepare(scene, "quick", each) for each in (1e-3, 1e-7))
    found = solver(np.array(scene.omega), 3.0)
    truth = reference(scene, [3.0]).omega[0]
    assert solver.steps < 20
    assert np.abs(found - truth).max() < 1e-3 * np.abs(truth).max()
    # For more digits the waves are resolved.
    finer(np.array(scene.omega), 3.0)
    assert finer.steps > 150


def test_run_away_is_an_overflow_and_nothing_hangs() -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    solver = prepare(scene, "quick", 1e-3)
    assert np.isnan(solver(np.array(scene.omega), 2.0)).all()
    assert solver.status == "overflow"


def test_more_waves_than_there_is_room_for_are_left_to_the_series() -> None:
    waves = tuple(((0.5, -0.2, 0.1 * k), 1.0 + k) for k in range(9))
    for law in (TorqueLaw(sines=waves), TorqueLaw(sines=waves[:5], cosines=waves[5:])):
        scene = Scene("", (0.3, 1.0, -0.5), moments=(3.0, 2.0, 1.5), torque=law)
        start = np.array(scene.omega)
        quick = prepare(scene, "quick", 1e-3)
        assert np.isnan(quick(start, 1.0)).all()
        assert quick.status == "refused"
        truth = reference(scene, [1.0]).omega[0]
        found = prepare(scene, tolerance=1e-3)(start, 1.0)
        assert np.abs(found - truth).max() <= 1e-3 * np.abs(truth).max()
    quick = prepare(replace(scene, torque=TorqueLaw(sines=waves[:8])), "quick", 1e-3)
    quick(start, 1.0)
    assert quick.status == "complete"


@pytest.mark.parametrize(
    ("case", "tolerance", "method"),
    [(5, 1e-3, "taylor"), (7, 1e-3, "quick"), (7, 1e-6, "quick"), (7, 1e-8, "taylor"),
     (6, 1e-3, "taylor")],
)  # fmt: skip
def test_auto_chooses_by_the_forecast(case: int, tolerance: float, method: str) -> None:
    scene = case_scene(case)
    solver = prepare(scene, tolerance=tolerance)
    found = solver(scene.omega, 3.0)
    assert solver.method == method
    assert found.tobytes() == prepare(scene, method, tolerance)(scene.omega, 3.0).tobytes()


def test_the_start_of_a_wave_is_in_the_forecast() -> None:
    """A wave that is averaged costs Runge-Kutta as much as some steps before the first."""
    start = (0.1, -0.1, 0.4)
    for frequency, method in ((6.0, "taylor"), (60.0, "quick")):
        torque = TorqueLaw(sines=[((1e-4, 2e-4, -1e-4), frequency)])
        solver = prepare(Scene("", start, moments=(40.0, 30.0, 20.0), torque=torque), "auto", 1e-3)
        solver(start, 1.0)
        assert solver.method == method
