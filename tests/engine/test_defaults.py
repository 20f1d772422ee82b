"""Default arguments: every method solves ordinary scenes with its own default tolerance."""

import inspect
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, compare_programs, prepare, solve, solve_many
from pyharness.checks.compare.batch import Solver
from pyharness.checks.scenes.random_scenes import draw
from pyharness.engine.plan.plan import plan
from pyharness.engine.plan.registry import (
    METHODS,
    PREPARED,
    REGISTRY,
    SCIPY_METHODS,
    requested_tolerance,
)
from pyharness.model.listing import Listing
from tests.conftest import Printed, ResultOf

# Even numbers are possible bodies with a torque of any kind, which turn a few radians a second.
_NUMBERS = (0, 2, 4, 6, 8)
_CASES = [
    (name, number) for name, each in REGISTRY.items() if not each.weak_torque for number in _NUMBERS
]


def _scene(method: str, number: int) -> tuple[Scene, float]:
    """Return a random scene that a method accepts, and its last time (s)."""
    drawn = draw("defaults", number)
    scene = drawn.scene
    if method == "closed-form":
        scene = replace(scene, torque=TorqueLaw())
    return scene, drawn.time


@pytest.mark.parametrize(("method", "number"), [case for case in _CASES if case[0] in METHODS])
def test_method_solves_random_scenes_with_its_default_arguments(method: str, number: int) -> None:
    scene, time = _scene(method, number)
    found = solve(scene, [0.5 * time, time], method)
    assert found.ended == "complete"
    if REGISTRY[method].attitude:
        turned = solve(scene, time, method, attitude=True)
        assert (turned.ended, turned.tolerance) == ("complete", REGISTRY[method].default)
    if REGISTRY[method].is_fixed_step:
        assert found.tolerance is None
        return
    assert found.tolerance == REGISTRY[method].default
    truth = solve(scene, [0.5 * time, time], "taylor", 1e-15).omega
    largest = max(np.abs(truth).max(), np.abs(scene.omega).max())
    assert np.abs(found.omega - truth).max() <= (found.tolerance + 4e-15) * largest


@pytest.mark.parametrize(("method", "number"), [case for case in _CASES if case[0] in PREPARED])
def test_prepared_and_many_take_the_same_default(method: str, number: int) -> None:
    scene, time = _scene(method, number)
    solver, default = prepare(scene, method), REGISTRY[method].default
    omega = solver(np.array(scene.omega), time)
    assert solver.status == "complete"
    np.testing.assert_array_equal(omega, prepare(scene, method, default)(scene.omega, time))
    for given in (None, default):
        many = solve_many(scene, time, method=method, tolerance=given)
        assert many.ended.tolist() == ["complete"]
    np.testing.assert_array_equal(many.omega, solve_many(scene, time, method=method).omega)


@pytest.mark.parametrize("call", [solve, prepare, solve_many, plan, compare_programs, Solver])
def test_no_entry_point_has_a_default_of_its_own(call: Callable[..., object]) -> None:
    assert inspect.signature(call).parameters["tolerance"].default is None


def test_default_is_one_that_its_method_can_meet() -> None:
    for name, method in REGISTRY.items():
        assert max(method.finest, 1e-9) <= method.default <= 1.0
        assert (method.default == 1.0) == method.is_fixed_step
        assert requested_tolerance(name, None) == method.default
        assert requested_tolerance(name, 0.5) == 0.5
    assert REGISTRY["auto"].default == 1e-9


def test_command_line_takes_the_default_of_the_method(printed: Printed) -> None:
    for method, words in (("auto", ", tolerance 1e-09\n"), ("gauss-1", ", tolerance 1e-06\n")):
        assert words in printed(f"run --case 5 --method {method} --times 1")
    assert "tolerance" not in printed("run --case 5 --method rk4 --times 1")
    record = printed("run --case 5 --method lsoda --times 1 --format json")
    assert f'"tolerance": {REGISTRY["lsoda"].default}' in record


def test_comparison_takes_the_defaults_of_its_methods() -> None:
    found = compare_programs(draw("defaults", 0).scene, [Listing.original("two-term")])
    taken = {each.method: each.tolerance for each in found.methods}
    assert taken == {name: REGISTRY[name].default for name in SCIPY_METHODS}
    assert found.tolerance == min(REGISTRY[name].default for name in SCIPY_METHODS)


def test_plan_is_of_the_default(printed: Printed) -> None:
    assert printed("plan --case 5") == printed("plan --case 5 --tolerance 1e-12")


def test_help_names_the_default(result_of: ResultOf) -> None:
    for verb in ("run", "plan", "compare"):
        assert "method's own" in " ".join(result_of(["help", verb]).out.split())


def test_more_times_than_the_memory_can_hold_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pyharness.engine.solve.most_steps", lambda: 3)
    scene = Scene("", (1, 0, 0), moments=(1, 2, 3))
    assert len(solve(scene, [1, 2, 3]).time) == 3
    with pytest.raises(InputError, match="times: more than 3 times"):
        solve(scene, [1, 2, 3, 4])
