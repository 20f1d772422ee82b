"""Orders: seen where the step is small enough, missed where it is, and else not judged."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pyharness.build import build
from pyharness.compare import compare
from pyharness.comparison_tables import comparison_table
from pyharness.listing import PROGRAMS, corrected, original
from pyharness.methods import PROGRAM_REGISTRY
from pyharness.orders import Order, measured_order, order_of
from pyharness.records import comparison_record
from pyharness.reference import reference
from pyharness.scene import Scene
from pyharness.scene_file import case_scene
from pyharness.trajectory import Array


def _steps(case: int, step_size: float, steps: int) -> Scene:
    return replace(case_scene(case), step_size=step_size, steps=steps)


def _order(scene: Scene, program: str, punched: bool = False) -> Order:
    listing = original(program) if punched else corrected(program)
    return measured_order(
        scene, PROGRAM_REGISTRY[program], listing, reference(scene, scene.times())
    )


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


def test_what_can_t_be_told_is_not_judged() -> None:
    order = _order(_steps(4, 100.0, 3), "two-term")
    assert (order.state, order.value) == ("not judged", None)
    assert "does not settle" in order.note


def test_singular_matrix_is_named_and_no_miss() -> None:
    """Each step is then one of order 1; the program says so by IER."""
    for step_size in (1e-5, 3e-5):
        order = _order(_steps(5, step_size, 100), "four-term")
        assert (order.state, order.value) == ("not judged", None)
        assert "IER = 129" in order.note


@pytest.mark.parametrize("program", ["two-term", "four-term"])
def test_that_it_does_not_settle_in_small_steps_is_a_miss(program: str) -> None:
    """As punched, TIME runs away and the torque of Case 7 with it."""
    order = _order(case_scene(7), program, punched=True)
    assert (order.state, order.value) == ("misses", None)
    assert "does not settle" in order.note


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
        (_overflowing, "misses", None),
        (_erratic, "misses", None),
    ],
)
def test_every_way_to_be_wrong_is_a_miss(
    solution: Callable[[Scene], Array], state: str, value: float | None
) -> None:
    scene = _steps(3, 0.01, 4)
    order = order_of(scene, solution, 2, reference(scene, scene.times()))
    assert order.state == state
    assert order.value == (None if value is None else pytest.approx(value, abs=1e-6))


def test_compare_tells_what_it_does_not_judge() -> None:
    found = compare(_steps(5, 1e-5, 100), [corrected("four-term")])
    assert found.unexpected == ()
    assert len(found.not_judged) == 1
    assert "not judged: four-term corrected: IER = 129" in comparison_table(found)
    assert comparison_record(found, build())["not_judged"] == list(found.not_judged)
