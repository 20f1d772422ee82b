"""Few digits where perturbations grow: `quick`, and `auto` which may take it, against the series.

At an unstable steady rotation under torque nothing happens until rounding has grown, and steps of
all three lengths of `quick` agree. The scenes are drawn at random.
"""

import math
from collections import Counter
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from pyharness import Scene, Solver, TorqueLaw, prepare
from tests.checks.scenes.timed_kinds import KINDS, NASTY, timed_scenes

ROUNDING = 2.0**-53
_UNSURE = 0.3  # rounding times growth, in tolerances, above which the series reports sensitive


def _called(scene: Scene, method: str, tolerance: float, time: float) -> tuple[Solver, np.ndarray]:
    solver = prepare(scene, method, tolerance)
    return solver, solver(np.array(scene.omega), time)


def _shaken(scene: Scene) -> Scene:
    """Return a scene with a fast and very weak wave, under which `auto` considers `quick`."""
    rate = max(map(abs, scene.omega))
    wave = tuple(1e-12 * each * rate**2 for each in scene.moments or ()), 200.0 * rate
    return replace(scene, torque=TorqueLaw(scene.law.constant, sines=[wave]))


@pytest.mark.campaign
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("method", ["auto", "quick"])
def test_complete_is_not_said_where_the_series_says_sensitive(
    method: str, tolerance: float
) -> None:
    scenes = timed_scenes("unstable", [25, round(-math.log10(tolerance))])
    seen: Counter[str] = Counter()
    for number, (calm, time) in enumerate(islice(scenes, 150)):
        scene = _shaken(calm) if method == "auto" else calm
        series, _ = _called(scene, "taylor", tolerance, time)
        solver, found = _called(scene, method, tolerance, time)
        seen[f"{solver.method} {solver.status}"] += 1
        if solver.status not in ("complete", "sensitive"):
            assert (method, solver.error) == ("quick", None)
            continue
        assert solver.error is not None
        assert solver.error > 0.0
        if solver.status == "complete":
            assert series.status == "complete", number
            fine, truth = _called(scene, "taylor", 1e-13, time)
            error = float(np.abs(found - truth).max()) / max(map(abs, scene.omega))
            doubt = 4.0 * ROUNDING * (fine.growth or 1.0)
            assert error <= tolerance + doubt, number
            assert solver.error >= 0.1 * error - doubt, number
            assert solver.error <= tolerance
    # Neither method reports all scenes as sensitive, and `auto` is not always the series. For more
    # digits it nearly always is.
    if method == "quick" or tolerance == 1e-3:
        assert seen["quick complete"] > 20
    assert sum(seen[f"{name} sensitive"] for name in ("quick", "taylor")) > 20


@pytest.mark.parametrize("tolerance", [1e-9, 1e-12])
def test_rounding_of_many_steps_is_seen(tolerance: float) -> None:
    """Request more digits from `quick` than it is made for."""
    for number, (scene, time) in enumerate(islice(timed_scenes("unstable", 252), 60)):
        solver, found = _called(scene, "quick", tolerance, time)
        series, truth = _called(scene, "taylor", tolerance, time)
        if solver.status != "complete":
            continue
        error = float(np.abs(found - truth).max()) / max(map(abs, scene.omega))
        assert series.status == "complete", number
        assert error <= tolerance + (series.error or 0.0), number
        assert 0.0 < (solver.error or 0.0) <= tolerance
        assert (solver.error or 0.0) >= 0.1 * error - (series.error or 0.0)


def test_scene_of_the_first_report() -> None:
    scene = Scene(
        "",
        (1.0, 1.0421910286712616e-3, 3.4773343218689193e-4),
        (2.140264208707284, 2.71816889956428, 1.0330425417197189),
        torque=TorqueLaw((-6.106976504914288e-7, 3.85017990453278e-4, 6.022870842382e-4)),
    )
    time = -77.74356007745676
    for method, tolerance in (("quick", 1e-3), ("auto", 1e-3), ("quick", 1e-12)):
        solver, found = _called(scene, method, tolerance, time)
        series, truth = _called(scene, "taylor", tolerance, time)
        assert (solver.status, series.status) == ("sensitive", "sensitive")
        assert (solver.error or 0.0) + (series.error or 0.0) >= float(np.abs(found - truth).max())
        assert (solver.growth or 0.0) == pytest.approx(series.growth, rel=1e-9)


def test_bound_of_the_amplification_is_one() -> None:
    """In calm and rough motions the reported error includes rounding times the series' growth."""
    generator = np.random.default_rng(253)
    seen = 0
    for make in (KINDS["plain"], *NASTY.values()):
        for _ in range(40):
            scene, time = make(generator)
            solver, _ = _called(scene, "quick", 1e-3, time)
            if solver.status != "complete" or solver.growth is not None:
                continue
            series, _ = _called(scene, "taylor", 1e-6, time)
            if series.growth is None:
                continue
            seen += 1
            assert (solver.error or 0.0) >= 0.9 * ROUNDING * series.growth
            assert ROUNDING * series.growth <= _UNSURE * 1e-3
    assert seen > 200


def test_nothing_errs_where_no_time_passes() -> None:
    scene, _ = next(timed_scenes("unstable", 254))
    solver, found = _called(scene, "quick", 1e-6, 0.0)
    assert (solver.status, solver.error) == ("complete", 0.0)
    assert found.tolist() == list(scene.omega)
