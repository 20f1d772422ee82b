"""Orders: seen where the step is small enough, missed where it is, and else not judged."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Never

import numpy as np
import pytest

from pyharness.compare import orders
from pyharness.compare.comparison import compare_programs
from pyharness.compare.orders import Order, measured_order, order_of
from pyharness.compare.report import comparison_report
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing, corrected
from pyharness.model.scene import Scene, TorqueLaw
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.original.programs import PROGRAM_REGISTRY, Program
from pyharness.theory.conditioning import ROUNDING
from pyharness.truth.reference import reference
from pyharness.verify.plants.planted_twins import plant_in_twin
from pyharness.views.render import render


def _steps(case: int, step_size: float, steps: int) -> Scene:
    return replace(case_scene(case), step_size=step_size, steps=steps)


def _order(scene: Scene, program: str) -> Order:
    truth = reference(scene, scene.times())
    return measured_order(scene, PROGRAM_REGISTRY[program], corrected(program), truth)


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize(
    ("case", "step_size", "steps"),
    [
        (7, 1.0, 5),  # steps that skip periods of the torque agree with each other, and are wrong
        (6, 0.5, 10),  # each overflows at first
        (4, 5.0, 3),
    ],
)
def test_step_far_too_long_is_halved_until_the_order_shows(
    program: str, case: int, step_size: float, steps: int
) -> None:
    order = _order(_steps(case, step_size, steps), program)
    assert order.state == "as due"
    assert order.value == pytest.approx(order.due, abs=0.5)


@pytest.mark.parametrize("program", PROGRAMS)
def test_fast_torque_that_the_steps_skip_is_no_miss(program: str) -> None:
    torque = TorqueLaw(sines=(((1.0, 0.0, 0.0), 1e4),))
    scene = Scene("wave", (0.0, 1.0, 1.0), (40.0, 30.0, 20.0), torque=torque, steps=10)
    assert _order(scene, program).state == "as due"


@pytest.mark.parametrize(("case", "step_size", "steps"), [(4, 100.0, 3), (2, 0.2, 10000)])
def test_motion_too_long_for_any_step_is_not_judged(
    case: int, step_size: float, steps: int
) -> None:
    """A textbook method of the same order comes no further."""
    order = _order(_steps(case, step_size, steps), "two-term")
    assert (order.state, order.value, order.is_judged) == ("unsettled", None, False)
    assert "does not settle" in str(order)


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize(
    ("wobble", "step_size", "steps"),
    [(1e-10, 60.0, 3), (1e-6, 1.0, 200), (1e-6, 5.0, 50), (1e-3, 10.0, 200)],
)
def test_rounding_that_the_motion_multiplies_is_no_miss(
    program: str, wobble: float, step_size: float, steps: int
) -> None:
    """Spin about the middle axis, disturbed: after some flips no step settles."""
    scene = replace(_steps(4, step_size, steps), omega=(wobble, 1.0, wobble))
    order = _order(scene, program)
    assert (order.state, order.value, order.is_judged) == ("sensitive", None, False)


@pytest.mark.parametrize("step_size", [1e-6, 1e-5, 3e-5])
def test_singular_matrix_is_named_and_no_miss(step_size: float) -> None:
    """Each step is then one of order 1; the program says so by IER."""
    order = _order(_steps(5, step_size, 100), "four-term")
    assert (order.state, order.value, order.is_judged) == ("singular", None, False)
    assert "IER = 129" in str(order)


@pytest.mark.parametrize("step_size", [1e6, 1e7])
def test_steps_so_long_that_the_matrix_is_singular_are_passed_over(step_size: float) -> None:
    """The motion of Case 4, and the time that it takes, in other units."""
    known = case_scene(4)
    factor = step_size / known.step_size
    first, second, third = known.omega
    slow = (first / factor, second / factor, third / factor)
    scene = replace(known, omega=slow, step_size=step_size)
    order = _order(scene, "four-term")
    assert order.state == "as due"


@pytest.mark.parametrize(
    ("program", "file", "right", "wrong"),
    [
        ("two-term", "two_term.py", "2.0 * dt / 3.0]", "dt / 3.0]"),
        ("four-term", "four_term.py", "dt * 0.6,", "dt * 0.4,"),
        ("four-term", "linear_solver.py", "if n + biggest == n:", "if n + biggest > n:"),
    ],
)
def test_matrix_that_a_fault_makes_singular_is_a_miss(
    program: str, file: str, right: str, wrong: str, tmp_path: Path
) -> None:
    planted = plant_in_twin(program, file, right, wrong, tmp_path)
    scene = case_scene(5)
    truth = reference(scene, scene.times())
    order = measured_order(scene, planted, corrected(program), truth)
    assert order.state == "misses"
    assert order.value == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("steps", [150, 300])
def test_program_that_does_not_settle_where_others_do_misses(steps: int) -> None:
    """In the original, TIME runs away and the torque with it."""
    scene = _steps(6, 0.01, steps)
    listing = Listing("two-term", frozenset({"dt-accumulates"}))
    truth = reference(scene, scene.times())
    order = measured_order(scene, PROGRAM_REGISTRY["two-term"], listing, truth)
    assert (order.state, order.value) == ("misses", None)
    assert "does not settle" in str(order)


def _exact(scene: Scene) -> Array:
    return reference(scene, scene.times()).omega


def _shifted(scene: Scene, by: float) -> Array:
    return _exact(scene) + by


def _first_order(scene: Scene) -> Array:
    return _exact(scene) * (1.0 + scene.step_size)


def _overflowing(scene: Scene) -> Array:
    return np.empty((0, 3))


def _erratic(scene: Scene) -> Array:
    return np.random.default_rng(scene.steps).random((scene.steps, 3))


@pytest.mark.parametrize(
    ("solution", "state", "value"),
    [
        (_exact, "rounding", None),
        (_first_order, "misses", 1.0),
        (partial(_shifted, by=1e-3), "misses", 0.0),
        (_overflowing, "unsettled", None),
        (_erratic, "unsettled", None),
    ],
)
def test_only_what_shows_the_order_is_as_due(
    solution: Callable[[Scene], Array], state: str, value: float | None
) -> None:
    scene = _steps(3, 0.01, 4)
    order = order_of(scene, solution, 2, reference(scene, scene.times()), most_steps=2**10)
    assert order.state == state
    assert order.value == (None if value is None else pytest.approx(value, abs=1e-6))


@pytest.mark.parametrize(("order", "state"), [(1.6, "as due"), (1.4, "misses")])
def test_half_an_order_may_be_missing(order: float, state: str) -> None:
    scene = _steps(3, 0.01, 4)

    def solution(finer: Scene) -> Array:
        return _shifted(finer, 1e-3 * (finer.step_size / scene.step_size) ** order)

    found = order_of(scene, solution, 2, reference(scene, scene.times()))
    assert found.state == state
    assert found.value == pytest.approx(order, abs=1e-6)


@pytest.mark.parametrize(("share", "grew"), [(0.7, True), (1.5, False)])
def test_rounding_that_grew_is_no_more_than_eight_a_step(share: float, grew: bool) -> None:
    """Of a sphere nothing grows: there are 8 roundings of a step, and 8 of either end."""
    scene = Scene("", (0.3, 1.0, -0.6), (2.0, 2.0, 2.0), steps=1000)
    error = share * 8.0 * ROUNDING * (1000.0 + 2.0)
    found = Order(4, "misses", 0.0, 0.01, 1000, error, 10.0)
    assert orders._is_grown_rounding(scene, found) == grew


def test_one_halving_is_no_proof() -> None:
    """An error that falls once as it should, and then no more."""
    scene = _steps(3, 0.01, 4)

    def once(finer: Scene) -> Array:
        return _exact(finer) + (1e-3 if finer.steps == 4 else 2.5e-4)

    truth = reference(scene, scene.times())
    assert order_of(scene, once, 2, truth, pairs=1).state == "as due"
    assert order_of(scene, once, 2, truth).state == "misses"


def test_larger_errors_than_those_of_a_textbook_are_no_miss(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A right program may need some more halvings than there is room for."""
    known = PROGRAM_REGISTRY["two-term"]

    def coarse(self: Program, finer: Scene, *rest: Any, **named: Any) -> Trajectory:
        run = whole(self, finer, *rest, **named)
        return replace(run, omega=_exact(finer) + 1e5 * finer.step_size**2)

    whole = Program.run
    scene = _steps(5, 0.01, 20)
    truth = reference(scene, scene.times())
    monkeypatch.setattr(Program, "run", coarse)
    monkeypatch.setattr(orders, "_HALVINGS", 0)
    monkeypatch.setattr(orders, "_MOST_STEPS", 80)
    assert measured_order(scene, known, corrected("two-term"), truth).state == "unsettled"
    monkeypatch.setattr(orders, "_MOST_STEPS", 160)
    assert measured_order(scene, known, corrected("two-term"), truth).state == "misses"


def test_a_motion_whose_conditioning_is_unknown_is_not_judged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> Never:
        raise InputError("too many nodes")

    scene = case_scene(5)
    listing = Listing("runge-kutta", frozenset({"stage-base"}))
    truth = reference(scene, scene.times())
    program = PROGRAM_REGISTRY["runge-kutta"]
    assert measured_order(scene, program, listing, truth).state == "misses"
    monkeypatch.setattr(orders, "conditioning", refuse)
    assert measured_order(scene, program, listing, truth).state == "sensitive"


def test_compare_tells_what_it_does_not_judge() -> None:
    found = compare_programs(_steps(5, 1e-5, 100), [corrected("four-term")])
    assert found.unexpected == ()
    assert len(found.not_judged) == 1
    report = comparison_report(found)
    table = render(report, "table")
    assert "not judged: four-term corrected: IER = 129" in table
    assert "orders corrected - (due: 2)" in table
    assert report.record()["not_judged"] == list(found.not_judged)


def test_compare_names_rounding() -> None:
    found = compare_programs(case_scene(1), [corrected("two-term")])
    assert "orders corrected rounding (due: 2)" in render(comparison_report(found), "table")
    assert found.not_judged == ()
