"""Measured orders: seen if the step is small enough, missed by faults, and else not judged."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, Never

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, case_scene, compare_programs
from pyharness.checks.compare import orders
from pyharness.checks.compare.orders import Order, measured_order, order_of
from pyharness.checks.compare.report import comparison_report
from pyharness.checks.theory.conditioning import ROUNDING
from pyharness.engine.problem.rescaled import scaled
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.trajectory import Array, Trajectory
from pyharness.thesis.programs import PROGRAM_REGISTRY, Program
from pyharness.truth.reference import Reference, reference
from pyharness.views.render import render

Patch = pytest.MonkeyPatch


def _steps(case: int, step_size: float, steps: int) -> Scene:
    return replace(case_scene(case), step_size=step_size, steps=steps)


@cache
def _truth(scene: Scene) -> Reference:
    return reference(scene, scene.times())


def _order(scene: Scene, program: str | Program, listing: Listing | None = None) -> Order:
    judged = PROGRAM_REGISTRY[program] if isinstance(program, str) else program
    return measured_order(scene, judged, listing or Listing.corrected(judged.name), _truth(scene))


WAVE = TorqueLaw(sines=(((1.0, 0.0, 0.0), 1e4),))


@pytest.mark.campaign
@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize(
    "scene",
    [
        _steps(7, 1.0, 3),  # steps that skip periods of the torque agree, but are wrong
        _steps(6, 0.5, 6),  # each program overflows at first
        _steps(4, 5.0, 3),
        Scene("wave", (0.0, 1.0, 1.0), (40.0, 30.0, 20.0), torque=WAVE, steps=4),
        scaled(case_scene(4), 1e-8),  # the solver finds the matrix of such steps singular
    ],
    ids=["skipped periods", "overflow", "far too long", "fast torque", "singular at first"],
)
def test_step_far_too_long_is_halved_until_the_order_shows(program: str, scene: Scene) -> None:
    order = _order(scene, program)
    assert order.state == "as due"
    assert (order.value or 0.0) >= order.due - 0.5


@pytest.mark.campaign
@pytest.mark.parametrize(("scene", "program", "state", "words"), [
    # A textbook method of the same order does not settle either.
    (_steps(2, 0.2, 2000), "two-term", "unsettled", "does not settle"),
    # Each step then has order 1, which the program reports by IER.
    (_steps(5, 1e-6, 100), "four-term", "singular", "IER = 129"),
    (_steps(5, 3e-5, 100), "four-term", "singular", "IER = 129"),
    *(
        # Perturbed rotation about the middle axis: after some flips no step settles.
        (replace(_steps(4, 5.0, 50), omega=(1e-6, 1.0, 1e-6)), program, "sensitive", "rounding")
        for program in PROGRAMS
    ),
    (replace(_steps(4, 10.0, 60), omega=(1e-4, 1.0, 1e-4)), "runge-kutta", "sensitive", ""),
])  # fmt: skip
def test_what_the_scene_can_not_tell_is_no_miss(
    scene: Scene, program: str, state: str, words: str
) -> None:
    order = _order(scene, program)
    assert (order.state, order.value, order.is_judged) == (state, None, False)
    assert words in str(order)


def test_program_that_does_not_settle_where_others_do_misses() -> None:
    """In the original, TIME grows without bound, and with it the torque."""
    order = _order(_steps(6, 0.01, 150), "two-term", Listing("two-term", {"dt-accumulates"}))
    assert (order.state, order.value) == ("misses", None)
    assert "does not settle" in str(order)


def _exact(scene: Scene) -> Array:
    return _truth(scene).omega


def _of_order(order: float) -> Callable[[Scene], Array]:
    return lambda scene: _exact(scene) + 1e-3 * (scene.step_size / 0.01) ** order


def _once(scene: Scene) -> Array:
    """Return a solution whose error falls at the first halving as it should, and then no more."""
    return _exact(scene) + (1e-3 if scene.steps == 4 else 2.5e-4)


@pytest.mark.parametrize(("solution", "state", "value"), [
    (_exact, "rounding", None),
    (_of_order(1.6), "as due", 1.6),  # half an order may be missing
    (_of_order(1.4), "misses", 1.4),
    (_of_order(0.0), "misses", 0.0),
    (_once, "misses", 0.0),  # one halving is no proof
    (lambda _: np.empty((0, 3)), "unsettled", None),
    (lambda it: np.random.default_rng(it.steps).random((it.steps, 3)), "unsettled", None),
], ids=["exact", "1.6", "1.4", "0", "once", "overflow", "erratic"])  # fmt: skip
def test_only_what_shows_the_order_is_as_due(
    solution: Callable[[Scene], Array], state: str, value: float | None
) -> None:
    scene = _steps(3, 0.01, 4)
    truth = _truth(scene)
    order = order_of(scene, solution, 2, truth, most_steps=2**10)
    assert order.state == state
    assert order.value == (None if value is None else pytest.approx(value, abs=1e-6))
    if solution is _once:
        assert order_of(scene, solution, 2, truth, pairs=1).state == "as due"


@pytest.mark.parametrize(("share", "grew"), [(0.7, True), (1.5, False)])
def test_rounding_that_grew_is_no_more_than_eight_a_step(share: float, grew: bool) -> None:
    """A sphere amplifies no error: there are 8 roundings for each step, and 8 at either end."""
    scene = Scene("", (0.3, 1.0, -0.6), (2.0, 2.0, 2.0), steps=1000)
    error = share * 8.0 * ROUNDING * (1000.0 + 2.0)
    found = Order(4, "misses", 0.0, 0.01, 1000, error, 10.0)
    assert orders._is_grown_rounding(scene, found) == grew


def test_larger_errors_than_those_of_a_textbook_are_no_miss(monkeypatch: Patch) -> None:
    """A right program may need more halvings than the limit on steps allows."""

    def coarse(self: Program, finer: Scene, *rest: Any, **named: Any) -> Trajectory:
        run = whole(self, finer, *rest, **named)
        return replace(run, omega=_exact(finer) + 1e5 * finer.step_size**2)

    whole = Program.run
    scene = _steps(5, 0.01, 20)
    monkeypatch.setattr(Program, "run", coarse)
    monkeypatch.setattr(orders, "_HALVINGS", 0)
    for most, state in ((80, "unsettled"), (160, "misses")):
        monkeypatch.setattr(orders, "_MOST_STEPS", most)
        assert _order(scene, "two-term").state == state


def test_a_motion_whose_conditioning_is_unknown_is_not_judged(monkeypatch: Patch) -> None:
    def refuse(*_: object) -> Never:
        raise InputError("too many nodes")

    given = case_scene(5), "runge-kutta", Listing("runge-kutta", {"stage-base"})
    assert _order(*given).state == "misses"
    monkeypatch.setattr(orders, "conditioning", refuse)
    assert _order(*given).state == "sensitive"


@pytest.mark.campaign
def test_compare_tells_what_it_does_not_judge() -> None:
    found = compare_programs(_steps(5, 1e-5, 100), [Listing.corrected("four-term")])
    report = comparison_report(found)
    table = render(report, "table")
    assert found.unexpected == ()
    assert "not judged: four-term corrected: IER = 129" in table
    assert "orders - (expected 2)" in table
    assert report.record()["not_judged"] == list(found.not_judged)


def test_compare_names_rounding() -> None:
    found = compare_programs(case_scene(1), [Listing.corrected("two-term")])
    assert "orders rounding (expected 2)" in render(comparison_report(found), "table")
    assert found.not_judged == ()
