"""Planted faults: every check of the suite can fail, and some check catches every plant."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from pyharness.checks.plants.planted_twins import plant_in_twin
from pyharness.compare.agreement import differences
from pyharness.compare.orders import measured_order
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene_file import case_scene
from pyharness.original import compiled
from pyharness.truth.reference import Reference, reference

# Enough steps for the measured orders to settle.
_SCENE = replace(case_scene(5), steps=25)

# Program, file, passage, faulty passage, and whether the comparison with the truth shows the fault
# too. It can't if the fault is of the size of rounding, is in the velocity, or leaves a method of
# the same order.
TWIN_PLANTS = {
    # The control: the same machinery without a fault raises no alarm.
    **{
        f"none in {program}": (program, "equations.py", "m[2] + c", "m[2] + c", False)
        for program in PROGRAMS
    },
    "a sign in omega": (
        "two-term", "equations.py", "m[2] + c * u[0]", "m[2] - c * u[0]", True,
    ),
    "a sign in the Runge-Kutta": (
        "runge-kutta", "runge_kutta.py", "r2 + b * u[2]", "r2 - b * u[2]", True,
    ),
    "a swapped axis": (
        "four-term", "equations.py", "m[1] + b * u[0] * u[2]", "m[1] + b * u[1] * u[2]", True,
    ),
    "half a step": ("runge-kutta", "runge_kutta.py", "(dt / 6.0)", "(dt / 12.0)", True),
    "half an interval": (
        "four-term", "collocation.py", "interval(state, points, h,",
        "interval(state, points, h / 2,", True,
    ),
    "a collocation point": ("two-term", "two_term.py", "2.0 * dt / 3.0", "2.1 * dt / 3.0", False),
    "one unit in the last place of a point": (
        "four-term", "four_term.py", "dt * 0.6", "dt * 0.6000000000000001", False,
    ),
    "one unit in the last place of a weight": (
        "runge-kutta", "runge_kutta.py", "(dt / 6.0)", "(dt / 6.000000000000001)", False,
    ),
    "a sign in the velocity": (
        "two-term", "equations.py", "acceleration[0] + v[1]", "acceleration[0] - v[1]",
        False,
    ),
    "another order of summation": (
        "runge-kutta", "runge_kutta.py", "k1 + 2.0 * (k2 + k3) + k4", "k1 + (2.0 * (k2 + k3) + k4)",
        False,
    ),
    "the last of equal pivots": (
        "four-term", "linear_solver.py", "if scaled > biggest", "if scaled >= biggest", False,
    ),
}  # fmt: skip


@pytest.mark.bitwise
@pytest.mark.parametrize("name", TWIN_PLANTS)
def test_fault_in_a_twin_is_caught(name: str, tmp_path: Path) -> None:
    """The bits show every fault; the truth shows those that are larger than rounding."""
    program, file, old, new, shows_in_truth = TWIN_PLANTS[name]
    planted = plant_in_twin(program, file, old, new, tmp_path)
    listing = Listing.corrected(program)
    found = differences(compiled.run(_SCENE, listing), planted.run(_SCENE, listing))
    assert bool(found) == (old != new), "bits"
    order = measured_order(_SCENE, planted, listing, _truth())
    assert order.state == ("misses" if shows_in_truth else "as due"), "truth"


@cache
def _truth() -> Reference:
    return reference(_SCENE, _SCENE.times())
