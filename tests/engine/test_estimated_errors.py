"""Estimated errors of closed forms, the series and `quick`, and the ending `sensitive`."""

import math
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from random import Random
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pyharness.engine.methods.sensitivity as room
from pyharness import Scene, TorqueLaw, case_scene, prepare, run_program, solve, solve_many, subset
from pyharness.engine.methods import taylor
from pyharness.engine.methods.sensitivity import is_sensitive, motion_growth
from pyharness.engine.prepared import solver as solver_module
from pyharness.engine.problem.rescaled import unscaled
from pyharness.model.codes import Statuses
from pyharness.model.trajectory import ROUNDING, Trajectory, digits_left
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import reference
from tests.checks.scenes import free_motions
from tests.engine.test_sensitivity import AT_REST, BESIDE, PUSHED, RUNAWAY, SPHERE


@pytest.mark.parametrize("time", [1.0, 30.0, 300.0, -1000.0])
@pytest.mark.parametrize("scene", [case_scene(3), BESIDE, SPHERE])
def test_error_of_a_closed_form_is_what_it_may_be(scene: Scene, time: float) -> None:
    """The closed form in double-double has errors of a few roundings, whatever the growth."""
    found: Any = solve(scene, [time], "closed-form", 1e-9)
    if scene is SPHERE:
        truth = reference(scene, [time]).omega[-1]
    else:
        truth = np.array(torque_free(scene, time), dtype=float)
    scale = max(np.abs(truth).max(), max(map(abs, scene.omega)))
    assert np.abs(found.omega[-1] - truth).max() / scale <= found.error
    assert found.error / ROUNDING == pytest.approx(17.0)
    if scene is not SPHERE:
        rounded = Scene("", scene.omega, inertia=np.diag(scene.moments or ()).tolist())
        other: Any = solve(rounded, [time], "closed-form", 1e-9)
        assert other.error / ROUNDING == pytest.approx((found.growth or 0.0) + 16.0)


def closed(seed: str, kind: str) -> tuple[Scene, float, Any, float]:
    """Return a random scene, its time, its closed form, and the true relative error of that."""
    moments, omega, _, time = free_motions.draw(Random(seed), kind)
    scene = Scene("", omega, moments)
    found: Any = solve(scene, [time], "closed-form", 1e-13)
    truth = np.array(torque_free(scene, time))
    error = float(max(abs(truth - [Decimal(x) for x in found.omega[0].tolist()])))
    return scene, time, found, error / max(np.abs(found.omega).max(), np.abs(scene.omega).max())


@pytest.mark.parametrize("kind", ["generic", "near separatrix", "needle", "middle axis"])
def test_error_of_a_closed_form_is_a_bound_near_its_errors(kind: str) -> None:
    ratios = []
    for number in range(150):
        _, _, found, error = closed(f"bound {kind} {number}", kind)
        assert error <= found.error
        if found.growth < 2.0**44:
            assert found.ended == "complete"
            ratios += [error / found.error] if error else []
    assert np.quantile(ratios, 0.2) > 0.01


@pytest.mark.parametrize("number", [2393, 2719, 4503])
def test_error_of_a_closed_form_grows_where_its_double_double_is_not_enough(number: int) -> None:
    scene, time, found, error = closed(f"saturated {number}", "near separatrix")
    assert 300.0 * ROUNDING < error <= found.error
    assert found.ended == "sensitive"
    many: Any = solve_many([scene], time, tolerance=1e-13, estimates=True)
    assert many.ended[0] == "sensitive"
    assert error <= many.error[0]


def test_ending_is_sensitive_where_rounding_exceeds_the_tolerance() -> None:
    # The initial omega of a body with an inertia matrix is rounded.
    scene = Scene("", BESIDE.omega, inertia=np.diag(BESIDE.moments or ()).tolist())
    growth: Any = motion_growth(BESIDE, 60.0)
    limit = ROUNDING * growth / 0.3
    start = np.array(BESIDE.omega)
    for share, word in ((0.99, "sensitive"), (1.01, "complete")):
        for method in ("auto", "closed-form"):
            found = solve(scene, [1.0, 60.0], method, share * limit)
            assert solve(BESIDE, [1.0, 60.0], method, share * limit).ended == "complete"
            solver = prepare(scene, method, share * limit)
            assert solver(start, 60.0).tolist() == found.omega[-1].tolist()
            assert (found.ended, solver.status, found.has_all_rows) == (word, word, True)
            assert (solver.growth, solver.error) == (found.growth, found.error)
            assert solver.digits == found.digits == digits_left(found.error)
            assert found.growth == growth


def test_gauss_collocation_knows_the_growth_of_the_motion() -> None:
    growth: Any = motion_growth(BESIDE, 12.0)
    assert growth > 9e3
    tolerance = 0.9 * ROUNDING * growth / 0.3
    for share, word in ((1.0, "sensitive"), (1.2, "complete")):
        found: Any = solve(BESIDE, [12.0], "gauss-8", share * tolerance)
        assert (found.ended, found.growth) == (word, growth)
        assert ROUNDING * growth <= found.error <= share * tolerance + ROUNDING * growth
        # With the scene's own steps it has no estimate of its own.
        solver = prepare(BESIDE, "gauss-8", share * tolerance)
        solver(BESIDE.omega, 12.0)
        assert (solver.status, solver.error, solver.growth) == (word, None, growth)
    # The growth is from the start and to the time of the call.
    solver(case_scene(3).omega, -3.0)
    assert solver.growth == motion_growth(replace(BESIDE, omega=case_scene(3).omega), -3.0)
    at_rest = solve(AT_REST, [1.0], "gauss-2", 1e-6)
    assert (at_rest.error, at_rest.growth) == (ROUNDING, 1.0)


@pytest.mark.parametrize("method", ["rk4", "dop853"])
def test_methods_that_estimate_nothing_say_so(method: str) -> None:
    found = solve(PUSHED, [1.0], method, 1.0 if method == "rk4" else 1e-6)
    assert (found.error, found.growth, found.digits) == (None, None, None)
    run = run_program(PUSHED, subset("two-term"))
    assert (run.error, run.growth, run.digits) == (None, None, None)


def test_solver_knows_nothing_before_a_call_and_without_a_result() -> None:
    solver = prepare(RUNAWAY, "taylor", 1e-9)
    assert (solver.status, solver.error, solver.growth, solver.digits) == ("complete", *[None] * 3)
    assert np.isnan(solver(RUNAWAY.omega, 2.0)).all()
    assert (solver.status, solver.error, solver.growth, solver.digits) == ("overflow", *[None] * 3)
    free = prepare(BESIDE)
    assert np.isnan(free(BESIDE.omega, 1e300)).all()
    assert (free.status, free.error, free.growth) == ("gave up", None, None)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
def test_quick_tells_its_own_error(tolerance: float) -> None:
    solver: Any = prepare(PUSHED, "quick", tolerance)
    found = solver(PUSHED.omega, 3.0)
    truth = reference(PUSHED, [1.0, 2.0, 3.0]).omega
    error = np.abs(found - truth[-1]).max() / np.abs(truth).max()
    assert error <= solver.error <= 0.35 * tolerance
    assert solver.growth is None
    assert solver(PUSHED.omega, 0.0).tolist() == list(PUSHED.omega)
    assert solver.error == 0.0
    assert solver.digits == pytest.approx(15.95, abs=0.01)


def _grown(status: int, error: float, growth: float) -> Callable[..., Any]:
    """Return a series that ends with a status, and reports an error and a growth."""

    def rows(*given: Any, effort: Any, **_: Any) -> Any:
        effort[2:4] = error, growth
        return np.ones((3, len(given[6]))), len(given[6]), status, 7, 0

    return rows


def test_what_the_series_finds_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(status: int, *estimates: float) -> Trajectory:
        kernel = SimpleNamespace(taylor_rows=_grown(status, *estimates))
        monkeypatch.setattr(taylor, "extension", lambda: kernel)
        return solve(PUSHED, [1.0, 2.0], "taylor", 1e-9)

    sensitive = found(Statuses.SENSITIVE, 1e-6, 3e9)
    assert (sensitive.ended, sensitive.error, sensitive.growth) == ("sensitive", 1e-6, 3e9)
    assert sensitive.digits == pytest.approx(6.0)
    assert len(sensitive.omega) == 2
    complete = found(Statuses.COMPLETE, 1e-10, -1.0)
    assert (complete.ended, complete.error, complete.growth) == ("complete", 1e-10, None)
    overflow = found(Statuses.OVERFLOW, 1e-10, 2.0)
    assert (overflow.ended, overflow.error, overflow.growth) == ("overflow", None, None)
    assert not overflow.has_all_rows

    def packed(*given: Any) -> Any:
        return np.ones(3), Statuses.SENSITIVE, 7, np.array([1e-6, 3e9, 7.0])

    kernel = SimpleNamespace(solve_packed=packed)
    monkeypatch.setattr(solver_module, "extension", lambda: kernel)
    solver = prepare(PUSHED, "taylor")
    assert solver(PUSHED.omega, 2.0).tolist() == [1.0] * 3
    assert (solver.status, solver.error, solver.growth) == ("sensitive", 1e-6, 3e9)
    # Without a closed form, Gauss collocation gets the growth from the series, to three digits.
    kernel = SimpleNamespace(taylor_rows=_grown(Statuses.COMPLETE, 1e-4, 3e9))
    monkeypatch.setattr(room, "extension", lambda: kernel)
    assert motion_growth(PUSHED, 2.0) == 3e9
    assert solve(PUSHED, [0.1], "gauss-4", 1e-6).ended == "sensitive"


def test_both_sides_of_zero_have_the_larger_error_and_growth() -> None:
    beside = Scene("", BESIDE.omega, inertia=np.diag(BESIDE.moments or ()).tolist())
    after, before = (solve(beside, [t], tolerance=1e-12) for t in (40.0, -1.0))
    for times in ([-1.0, 40.0], [40.0, 0.0, -1.0]):
        both = solve(beside, times, tolerance=1e-12)
        assert (both.ended, both.error, both.growth) == ("sensitive", after.error, after.growth)
    assert before.ended == "complete"
    both, before = (solve(beside, [-40.0, *more], tolerance=1e-12) for more in ([1.0], []))
    assert (both.ended, both.error, both.growth) == ("sensitive", before.error, before.growth)
    lost = solve(RUNAWAY, [-0.5, 2.0], "taylor", 1e-9)
    assert (lost.ended, lost.error, lost.growth) == ("overflow", None, None)


def test_digits_are_those_that_the_error_leaves() -> None:
    found = [digits_left(error) for error in (1.0, 7.0, 0.01, 1e-9, 0.0, None)]
    assert found == [0.0, 0.0, pytest.approx(2.0), pytest.approx(9.0), 53 * math.log10(2.0), None]


def test_is_sensitive_by_a_share_of_the_tolerance() -> None:
    assert not is_sensitive(None, 1e-15)
    assert not is_sensitive(0.29e-9 / ROUNDING, 1e-9)
    assert is_sensitive(0.31e-9 / ROUNDING, 1e-9)


def test_what_overflows_in_the_units_of_the_scene_has_no_error() -> None:
    time = np.array([1.0])
    found = Trajectory(time, time, np.full((1, 3), 1e300), None, 1, 1, error=1e-9, growth=2.0)
    slower, lost = (unscaled(found, [1.0], factor) for factor in (2.0, 1e-100))
    assert (slower.ended, slower.error, slower.growth) == ("complete", 1e-9, 2.0)
    assert (lost.ended, lost.error, lost.growth) == ("overflow", None, None)


def fast_scene(kind: str, rng: np.random.Generator) -> Scene:
    """Return a scene under fast waves: the last terms of a series alternate, and show little."""
    moments = tuple(np.sort(rng.uniform(1.0, 2.0, 3)).tolist())
    omega = tuple((rng.normal(size=3) * 10.0 ** rng.uniform(-0.5, 1.0)).tolist())
    a, b = (10.0 ** rng.uniform(-0.5, 1.6, 2)).tolist()
    size, other, last = rng.normal(size=(3, 3)).tolist()
    if kind == "law":
        law = TorqueLaw(sines=[(tuple(size), a), (tuple(other), b)])
        return Scene("", omega, moments, torque=law)

    def torque(t: Any, w: Any) -> Any:
        wave = np.exp(np.sin(a * t))
        return [0.1 * size[0] * wave, -0.2 * np.tanh(w[0]), 0.1 * last[0] * np.cos(b * t)]

    return Scene("", omega, moments, torque=torque, attitude=(1.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("kind", ["law", "recorded"])
def test_errors_under_fast_waves_are_stated(kind: str) -> None:
    rng = np.random.default_rng(20261201)
    below = 0
    for _ in range(60 if kind == "law" else 25):
        scene, time = fast_scene(kind, rng), float(10.0 ** rng.uniform(0.3, 1.8))
        found = solve(scene, time, tolerance=float(10.0 ** rng.uniform(-10.0, -6.0)))
        truth = solve(scene, time, tolerance=1e-14)
        assert found.error is not None
        assert truth.error is not None
        scale = max(np.abs(found.omega).max(), np.abs(scene.omega).max())
        error = np.abs(found.omega - truth.omega).max() / scale
        if found.attitude is not None and truth.attitude is not None:
            error = max(error, 2.0 * np.linalg.norm(found.attitude - truth.attitude))
        stated = found.error + truth.error
        assert error <= 1.5 * stated
        below += error > stated
    assert below <= 1
