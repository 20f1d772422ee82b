"""The plan and the deed: one decision for everyone, and what it skips is not computed."""

import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, prepare, run_program, solve, subset
from pyharness.methods import plan as room
from pyharness.methods.plan import EITHER, Plan, plan
from pyharness.methods.registry import METHODS, REGISTRY
from pyharness.model.trajectory import Trajectory

FREE = case_scene(3)
PUSHED = case_scene(5)
SPHERE = case_scene(1)
SCENES = [case_scene(number) for number in range(1, 8)]


def _counted(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Count the calls of every method that gives rows."""
    calls = dict.fromkeys(METHODS, 0)
    for name, method in METHODS.items():

        def solver(*rest: Any, name: str = name, known: Any = method.solve) -> Trajectory:
            calls[name] += 1
            found: Trajectory = known(*rest)
            return found

        if name != "auto":
            monkeypatch.setitem(METHODS, name, _with(method, solver))
    return calls


def _with(method: Any, solver: Callable[..., Trajectory]) -> Any:
    from dataclasses import replace

    return replace(method, solve=solver)


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_rows_are_solved_by_the_method_of_the_plan_and_by_no_other(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = _counted(monkeypatch)
    solve(scene, [1.0, 2.0], tolerance=1e-9)
    assert {name for name, count in calls.items() if count} == {plan(scene, rows=True).method}


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_everyone_asks_the_plan_and_does_what_it_says(scene: Scene) -> None:
    """A plan that says otherwise is followed."""

    def other(scene: Scene, method: str = "auto", *rest: Any, **named: Any) -> Plan:
        return plan(scene, "taylor" if method == "auto" else method, *rest, **named)

    wanted = solve(scene, [1.0], "taylor", 1e-6)
    for place in ("solve", "prepared"):
        with patch(f"pyharness.methods.{place}.plan", other):
            if place == "solve":
                found = solve(scene, [1.0], tolerance=1e-6)
                assert (found.steps, found.evaluations) == (wanted.steps, wanted.evaluations)
                assert found.steps > 0
            else:
                solver = prepare(scene, tolerance=1e-6)
                solver(np.array(scene.omega), 1.0)
                assert (solver.plan.method, solver.steps > 0) == ("taylor", True)


def test_a_closed_form_takes_no_step_and_no_product_that_is_zero() -> None:
    assert {"integration", "torque", "C w1 w2"} <= plan(case_scene(2)).skipped
    solver = prepare(case_scene(2))
    solver(np.array(case_scene(2).omega), 1.0)
    assert solver.steps == 0
    assert solve(SPHERE, [1.0]).evaluations == 0


@pytest.mark.parametrize("name", ["sines", "cosines"])
def test_waves_that_are_skipped_reach_no_kernel(name: str) -> None:
    silent: dict[str, Any] = {name: (((0.0, 0.0, 0.0), 50.0),)}
    scene = Scene("", PUSHED.omega, moments=PUSHED.moments, torque=TorqueLaw((1.0, 0, 0), **silent))
    assert name in plan(scene).skipped
    given: list[Sequence[Any]] = []

    def kernel(*rest: Any, **named: Any) -> Any:
        given.append(rest)
        return known(*rest, **named)

    from pyharness.model.extension import extension

    known = extension().taylor_rows
    with patch("pyharness.methods.taylor.extension") as stand_in:
        stand_in.return_value.taylor_rows = kernel
        solve(scene, [1.0])
    sines, cosines = given[0][3:5]
    assert sines.shape[1] == cosines.shape[1] == 0


def test_velocity_that_is_skipped_is_not_there() -> None:
    assert "velocity" in plan(PUSHED).skipped
    assert solve(PUSHED, [1.0]).velocity is None
    assert run_program(PUSHED, subset("two-term"), velocity=False).velocity is None
    assert "velocity" not in plan(PUSHED, velocity=True).skipped


def test_scipy_and_the_reference_are_not_even_imported() -> None:
    assert {"SciPy", "reference"} <= plan(PUSHED).skipped
    assert "SciPy" not in plan(PUSHED, "dop853").skipped
    code = (
        "import sys; from pyharness import case_scene, prepare, solve; scene = case_scene(5); "
        "solve(scene, [1.0]); prepare(scene)(scene.omega, 1.0); "
        "print([name for name in ('scipy', 'mpmath', 'pyharness.truth.reference') "
        "if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_decisions_are_not_worked_out_where_no_one_reads_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def never(chosen: Plan) -> None:
        raise AssertionError

    monkeypatch.setattr(room, "_decisions", never)
    solver = prepare(PUSHED)
    with pytest.raises(AssertionError):
        _ = solver.plan.decisions


def test_properties_of_the_registry_are_those_of_its_methods() -> None:
    for name, method in REGISTRY.items():
        assert method.name == name
        assert method.is_fixed_step == (method.evaluations > 0) == (method.finest == 1.0)
    assert [name for name in REGISTRY if not REGISTRY[name].gives_rows] == ["quick"]
    with pytest.raises(Exception, match="gives the end alone"):
        REGISTRY["quick"].solve(FREE, [1.0], 1e-6)
    assert plan(PUSHED, tolerance=1e-6).method == EITHER


def test_what_the_kernel_chose_comes_back() -> None:
    solver = prepare(PUSHED, tolerance=1e-3)
    start = np.array(PUSHED.omega)
    assert solver.method == solver.plan.method == EITHER
    solver(start, 1.0)
    assert (solver.method, solver.steps > 0) == ("quick", True)
    quick = prepare(PUSHED, "quick", 1e-3)
    quick(start, 1.0)
    assert (quick.method, quick.steps) == ("quick", solver.steps)
    # For six digits the series takes fewer operations; one product alone, and quick refuses.
    solver = prepare(PUSHED, tolerance=1e-6)
    solver(start, 1.0)
    assert (solver.plan.method, solver.method) == (EITHER, "taylor")
    lone = Scene("", PUSHED.omega, coefficients=(0.0, 0.0, 1.0), torque=PUSHED.torque)
    solver = prepare(lone, tolerance=1e-3)
    solver(start, 1.0)
    assert (solver.plan.method, solver.method) == (EITHER, "taylor")
    solver = prepare(FREE, tolerance=1e-6)
    solver(np.array(FREE.omega), 1.0)
    assert (solver.method, solver.steps) == ("closed-form", 0)
    # A disturbance of the middle axis whose square is no number.
    faint = Scene("", (1e-200, 1.0, 0.0), moments=(6.0, 5.0, 2.0))
    solver = prepare(faint, tolerance=1e-6)
    solver(np.array(faint.omega), 1.0)
    assert (solver.plan.method, solver.method) == ("closed-form", "taylor")
