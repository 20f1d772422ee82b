"""Planted faults: every fault in a twin is caught, and a fault of size 0 changes no bit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pyharness import case_scene, prepare, run_program, solve
from pyharness.checks.check import Selection
from pyharness.checks.compare.agreement import differences
from pyharness.checks.compare.orders import measured_order
from pyharness.checks.kinds import verify
from pyharness.checks.plants.faults import TWIN_FAULTS, twin
from pyharness.checks.plants.plants import PLANTS, Plant
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis import compiled
from pyharness.truth.reference import Reference, reference

# Enough steps for the measured orders to settle.
_SCENE = replace(case_scene(5), steps=25)


def _seen_by(*comparisons: str) -> list[tuple[str, str]]:
    """Return the faults that one of the comparisons detects, each with each of its programs."""
    return [
        (name, program)
        for name, fault in TWIN_FAULTS.items()
        if {*fault.shows.split()} & {*comparisons}
        for program in fault.programs.split()
    ]


@pytest.mark.bitwise
@pytest.mark.parametrize(("name", "program", "is_planted"), [
    *((*each, True) for each in _seen_by("bits", "truth")),
    # The control: the same machinery without a fault raises no alarm.
    ("sign", "two-term", False), ("axis", "four-term", False), ("step", "runge-kutta", False),
])  # fmt: skip
def test_fault_in_a_twin_is_caught(name: str, program: str, is_planted: bool) -> None:
    """The bits show every fault; the truth shows those that are larger than rounding."""
    fault, listing = TWIN_FAULTS[name], Listing.corrected(program)
    with twin(program, name)(fault.size if is_planted else 0.0) as planted:
        found = differences(compiled.run(_SCENE, listing), planted.run(_SCENE, listing))
        order = measured_order(_SCENE, planted, listing, _truth())
    assert bool(found) == is_planted, "bits"
    shows_in_truth = is_planted and "truth" in fault.shows
    assert order.state == ("misses" if shows_in_truth else "as due"), "truth"


@cache
def _truth() -> Reference:
    return reference(_SCENE, _SCENE.times())


@pytest.mark.sampled
@pytest.mark.parametrize(("name", "program"), _seen_by("schemes", "stops"))
def test_fault_in_both_languages_is_seen(name: str, program: str) -> None:
    """The fault is far too small to show in a measured order."""
    fault = TWIN_FAULTS[name]
    kind = "stops" if fault.shows == "stops" else f"schemes/{program}"
    with twin(program, name)(fault.size):
        checks = verify(Selection(only=[f"{kind}/case-{case}" for case in (1, 3, 5, 6, 7)]))
        assert not all(check.passed for check in checks)


@pytest.mark.parametrize(("name", "program"), _seen_by("orders"))
def test_matrix_that_a_fault_makes_singular_is_a_miss(name: str, program: str) -> None:
    scene = replace(case_scene(5), step_size=0.01, steps=60)
    truth = reference(scene, scene.times())
    with twin(program, name)(1.0) as planted:
        order = measured_order(scene, planted, Listing.corrected(program), truth)
    assert order.state == "misses"
    assert order.value == pytest.approx(1.0, abs=0.1)


@cache
def _unplanted() -> bytes:
    return _bits()


def _bits() -> bytes:
    """Return the results of the programs, of a few methods and of a prepared solver."""
    runs = [
        run_program(_SCENE, Listing.corrected(program), language)
        for program in PROGRAMS
        for language in ("fortran", "python")
    ]
    runs += [solve(case_scene(4), [0.1, 0.2], name) for name in ("closed-form", "taylor", "dop853")]
    found = [getattr(run, name) for run in runs for name in ("time", "recorded_time", "omega")]
    found += [run.velocity for run in runs if run.velocity is not None]
    found += [
        prepare(_SCENE, name, 1e-6)(np.array(_SCENE.omega), 0.1) for name in ("quick", "auto")
    ]
    return b"".join(each.tobytes() for each in found) + repr([r.evaluations for r in runs]).encode()


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_plant_of_size_0_changes_nothing(plant: Plant) -> None:
    right = _unplanted()
    with plant.planted(0.0):
        assert _bits() == right
