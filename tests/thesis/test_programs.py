"""Fortran agrees with the twin bit for bit, and corrected programs agree with the solution."""

import inspect
import itertools
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, Trajectory, case_scene
from pyharness.checks.compare.agreement import differences, distance
from pyharness.checks.compare.orders import measured_order
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset, switchable, switches
from pyharness.thesis import compiled, runge_kutta
from pyharness.thesis.cells import all_cells, all_listings, cell_name
from pyharness.thesis.programs import IMPLEMENTATIONS, PROGRAM_REGISTRY, run_program
from pyharness.truth.reference import reference


def is_chosen(listing: Listing) -> bool:
    """Return whether the tests of this file run a listing.

    They run the original and the corrected program, each with all its defects but one, with a
    single defect, and with a single reading. All listings are run by `verify --only cells`, and
    here if PYHARNESS_ALL_LISTINGS is set, as in the commands by which `make cross-check` repeats a
    failed comparison.
    """
    if os.environ.get("PYHARNESS_ALL_LISTINGS"):
        return True
    every = set(switches(listing.program))
    active = every & listing.active
    return min(len(active), len(every - active)) + len(listing.readings) <= 1


def both(scene: Scene, listing: Listing, **options: Any) -> Iterator[Trajectory]:
    program = PROGRAM_REGISTRY[listing.program]
    return (program.run(scene, listing, language, **options) for language in IMPLEMENTATIONS)


@pytest.mark.campaign
@pytest.mark.bitwise
def test_every_cell_agrees_to_the_last_bit_or_is_in_the_table() -> None:
    known = facts("divergences")["divergence"]
    listed = {entry["cell"] for entry in known if entry["kind"] == "cross-language"}
    cells = {cell_name(*each): each for each in all_cells()}
    assert listed <= cells.keys()
    for name, (listing, case) in cells.items():
        if is_chosen(listing) or name in listed:
            compiled, twin = both(case_scene(case), listing)
            differs = bool(differences(compiled, twin) or distance(compiled, twin))
            assert differs == (name in listed), name


def test_choice_of_listings_has_every_defect_and_every_reading() -> None:
    for program in PROGRAMS:
        chosen = {each.active for each in filter(is_chosen, all_listings(program))}
        before, after = Listing.original(program), Listing.corrected(program)
        for name in switches(program):
            assert {after.active | {name}, before.active - {name}} <= chosen
        for name in names_of("reading", program):
            assert {each.active | {name} for each in (before, after)} <= chosen


BODY = (3.0, 2.0, 1.0)
WAVE, OTHER = ((1.0, 2.0, 3.0), 17.3), ((7.0, -8.0, 9.0), 11.0)
FAST, CONSTANT = ((-4.0, 5.0, 6.0), 1e4), ((7.0, -8.0, 9.0), 0.0)
ALL_TORQUES = TorqueLaw((1.0, 0.0, -1.0), (0.0, 3.0, 0.5), (WAVE, FAST), (CONSTANT,))
MORE_COSINES = TorqueLaw(sines=(WAVE,), cosines=(OTHER, ((-4.0, 5.0, 6.0), 3.0)))
STEADY = TorqueLaw((0.1, 0.2, -0.3))
ENDLESS = TorqueLaw(sines=(((1.0, 1.0, 1.0), 1e306),))
NASTY = {
    "coefficients": Scene("", (1.0, -2.0, 3.0), coefficients=(0.3, -1.7, 0.9), torque=STEADY),
    "explodes": Scene("", (1.0, 1.0, 1.0), coefficients=(50.0, 60.0, 70.0)),
    "huge": Scene("", (1e150, 1e160, 1.0), BODY),
    "tiny": Scene("", (1e-300, 1e-310, 5e-324), BODY),
    "at rest": Scene("", (0.0, 0.0, 0.0), BODY),
    "minus zero": Scene("", (-0.0, -0.0, 1.0), BODY),
    "waves": Scene("", (0.1, 0.2, 0.3), (41.0, 39.0, 20.0), torque=ALL_TORQUES),
    "more cosines than sines": Scene("", (0.1, 0.2, 0.3), (41.0, 39.0, 20.0), torque=MORE_COSINES),
    "singular matrix": Scene("", (0.0, 1.0, 10.0), (40.0, 30.0, 20.0), step_size=1e-8),
    "infinite angle": Scene("", (0, 1, 1), (4, 3, 2), torque=ENDLESS, step_size=1.0, steps=150),
    "long steps": Scene("", (0.0, 1.0, 10.0), (4.0, 3.0, 2.0), step_size=10.0),
}


@pytest.mark.campaign
@pytest.mark.bitwise
@pytest.mark.parametrize("name", NASTY)
@pytest.mark.parametrize("program", PROGRAMS)
def test_nasty_scenes_agree_to_the_last_bit(program: str, name: str) -> None:
    """Overflow, underflow, IER = 129, signed zeros, infinite angles: the same in both languages."""
    for listing in filter(is_chosen, all_listings(program)):
        for may_stop in (True, False):
            assert differences(*both(NASTY[name], listing, may_stop=may_stop)) == [], listing


def test_overflow_ends_with_the_rows_until_then() -> None:
    for program in PROGRAMS:
        run = compiled.run(NASTY["explodes"], Listing.corrected(program), may_stop=False)
        assert run.ended == "overflow"
        assert 0 < run.steps == len(run.omega) < 100
        assert np.isfinite(run.omega).all()
    run = compiled.run(NASTY["huge"], Listing.corrected("two-term"))
    assert (run.ended, run.omega.shape) == ("overflow", (0, 3))


def test_every_defect_alone_changes_something() -> None:
    """A flag that changes nothing in any case would not be connected."""
    for program in PROGRAMS:
        for name in switchable(program):
            # `lipschitz-mismatched-pairs` only changes the quotient, which a low limit shows.
            with_it = subset(program, "corrected", keep=[name])
            assert any(
                differences(
                    compiled.run(case_scene(case), with_it, limit),
                    compiled.run(case_scene(case), Listing.corrected(program), limit),
                )
                for case, limit in itertools.product((5, 7), (500.0, 60.0, 1.0))
            ), (program, name)


@pytest.mark.parametrize("reading", names_of("reading"))
def test_readings_not_adopted_lose_an_order(reading: str) -> None:
    """Either reading is a guess, but a working program can't have the one that is not adopted."""
    program = next(PROGRAM_REGISTRY[p] for p in PROGRAMS if reading in names_of("reading", p))
    scene = case_scene(5)
    truth = reference(scene, scene.times())
    order = measured_order(scene, program, Listing(program.name, [reading]), truth)
    assert order.state == "misses", order


def test_recorded_time_is_what_tape5_got() -> None:
    scene = case_scene(3)
    before = compiled.run(scene, Listing.original("four-term"))
    n = np.arange(1, 101)
    np.testing.assert_allclose(before.recorded_time, 0.01 * n * (n + 1) / 2, rtol=1e-13)
    np.testing.assert_array_equal(before.time, n * 0.01)
    after = compiled.run(scene, Listing.corrected("four-term"))
    np.testing.assert_array_equal(after.recorded_time, np.cumsum(np.full(100, 0.01)))
    # The stop test has the constant of the deck everywhere.
    wanted = facts("cases")["deck"]["lipschitz"]
    program = PROGRAM_REGISTRY["runge-kutta"]
    for function in (run_program, program.run, compiled.run, runge_kutta.run):
        assert inspect.signature(function).parameters["lipschitz"].default == wanted


@pytest.mark.parametrize("velocity", [True, False])
def test_lipschitz_constant_and_no_stop(velocity: bool) -> None:
    """Section V.2: terminated after only 25 steps, by the velocity, whether requested or not."""
    scene = case_scene(2)
    listing = Listing.original("runge-kutta")
    run: Any = compiled.run(scene, listing, velocity=velocity)
    assert run.ended == "stopped"
    assert (run.stop.step, run.stop.variable) == (25, "V2")
    assert run.stop.quotient > 500.0
    assert run.steps == len(run.time) == 25
    assert compiled.run(scene, listing, lipschitz=1e9).stop is None
    assert compiled.run(scene, listing, lipschitz=1.0).steps < 25
    run = compiled.run(scene, listing, may_stop=False)
    assert (run.ended, run.steps, run.stop) == ("complete", 100, None)
    together = subset("runge-kutta", "corrected", keep=["lipschitz-tests-velocity"])
    for listing, variable in ((together, "UV"), (Listing.corrected("runge-kutta"), "U")):
        stop: Any = compiled.run(case_scene(5), listing, lipschitz=1e-3).stop
        assert stop.variable == variable


@pytest.mark.parametrize(("program", "count"), [*zip(PROGRAMS, (300, 500, 400), strict=True)])
def test_evaluations_count_right_hand_sides(program: str, count: int) -> None:
    assert compiled.run(case_scene(3), Listing.corrected(program)).evaluations == count


@pytest.mark.campaign
@pytest.mark.bitwise
def test_velocity_that_no_one_asked_for_changes_no_bit_of_the_rest() -> None:
    """Run every cell again without the translational block, which the plan may skip."""
    for listing, case in all_cells():
        scene = case_scene(case)
        whole, part = (compiled.run(scene, listing, velocity=wanted) for wanted in (True, False))
        assert part.velocity is None
        assert (part.steps, part.ended, part.stop) == (whole.steps, whole.ended, whole.stop)
        np.testing.assert_array_equal(part.omega, whole.omega)
        np.testing.assert_array_equal(part.recorded_time, whole.recorded_time)
        np.testing.assert_array_equal(part.ier, whole.ier)


def test_calls_release_the_gil_and_give_the_same_bits_from_many_threads() -> None:
    scene = case_scene(7)
    listing = Listing.original("four-term")
    wanted = compiled.run(scene, listing)
    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda _: compiled.run(scene, listing), range(64)))
    assert all(differences(run, wanted) == [] for run in runs)


AXES: list[tuple[float, float, float]] = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("program", PROGRAMS)
def test_overflow_of_one_component_ends_it(program: str, axis: tuple[float, float, float]) -> None:
    """The other two components are constant and finite, until they are combined with a NaN."""
    omega = [1e160 * (1.0 - each) for each in axis]
    scene = Scene("", omega, coefficients=axis, step_size=1.0, steps=3)
    for listing in (Listing.original(program), Listing.corrected(program)):
        fortran, twin = both(scene, listing, may_stop=False)
        assert differences(fortran, twin) == []
        for run in (fortran, compiled.run(scene, listing, may_stop=False, velocity=False)):
            assert (run.ended, run.steps) == ("overflow", 0)


@pytest.mark.parametrize("program", ["two-term", "four-term"])
def test_ier_is_printed_where_the_matrix_is_singular(program: str) -> None:
    scene = replace(case_scene(5), step_size=1e-17, steps=3)
    fortran, twin = both(scene, Listing.corrected(program))
    assert differences(fortran, twin) == []
    np.testing.assert_array_equal(fortran.ier, [129] * 3)


@pytest.mark.parametrize("axis", AXES, ids=range(3))
def test_sum_of_stages_may_overflow_where_no_stage_does(axis: tuple[float, float, float]) -> None:
    law = TorqueLaw([1e308 * each for each in axis])
    scene = Scene("", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), torque=law, step_size=0.5, steps=1)
    run = compiled.run(scene, Listing.corrected("runge-kutta"), may_stop=False, velocity=False)
    assert (run.ended, run.steps) == ("overflow", 0)


@pytest.mark.parametrize("program", PROGRAMS)
def test_torque_that_table_1_gives_initially_acts_over_the_first_step(program: str) -> None:
    """By a conjecture, omega increases by N h / I, or not at all without a torque that varies."""
    plain = Listing.original(program)
    assumed = replace(plain, conjectures=plain.conjectures | {"initial-torque"})
    scene = case_scene(7)
    with_it, without = (run_program(scene, each).omega for each in (assumed, plain))
    change = [100.0 / 40.0 * 0.01, 200.0 / 30.0 * 0.01, 150.0 / 20.0 * 0.01]
    np.testing.assert_allclose(with_it[0] - without[0], change, rtol=0.1)
    for other in (case_scene(5), replace(scene, torque=TorqueLaw((1.0, 2.0, 3.0)))):
        runs = [list(both(other, each)) for each in (assumed, plain)]
        assert [differences(*each) for each in runs] == [[], []]
        np.testing.assert_array_equal(runs[0][0].omega, runs[1][0].omega)
