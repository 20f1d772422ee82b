"""Assumptions are marked where a number depends on them, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from pyharness import Scene, case_scene, run_program
from pyharness.model.assumptions import MARK, assumed, assumptions, mark, open_starts
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene_file import case_numbers
from pyharness.model.scene_report import heading

ON_CARDS = {each["id"]: each for each in assumptions() if each["on"] == "listing"}


def test_every_assumption_has_a_source_and_a_known_place() -> None:
    entries = {each["id"] for each in facts("apparatus")["entry"]}
    for each in assumptions():
        assert each["what"]
        assert each["source"]
        assert each["on"] in ("omega", "steps", "units", "listing", "claim")
        assert each.get("entry", "units-have-none") in entries or each["on"] != "listing"


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("case", case_numbers())
def test_a_run_depends_on_what_is_told_of_it(program: str, case: int) -> None:
    """Each assumption about a card is turned: the numbers change exactly where it is marked."""
    scene, listing = case_scene(case), Listing.original(program)
    before = run_program(scene, listing, may_stop=False)
    told = {each["id"] for each in assumed(scene, [listing]) if each["on"] == "listing"}
    changing = set()
    for name, each in ON_CARDS.items():
        entry = next(e for e in facts("apparatus")["entry"] if e["id"] == each["entry"])
        if program not in entry["programs"]:
            continue
        assert listing.has(name) == each["active"]
        after = run_program(scene, Listing(program, listing.active ^ {name}), may_stop=False)
        if not np.array_equal(before.omega, after.omega, equal_nan=True):
            changing.add(name)
    assert told == changing
    assert mark(scene, listing) == (MARK if told else "")
    assert mark(scene, Listing.corrected(program)) == ""


def test_starts_that_are_assumed_are_those_of_the_cases_named() -> None:
    assert list(open_starts()) == [1, 3, 4, 6, 7]
    for case, whose in open_starts().items():
        if whose != "ours":
            assert (
                case_scene(case).omega == case_scene(int(whose.removeprefix("as in Case "))).omega
            )


def test_values_that_the_thesis_or_the_user_gives_have_no_mark() -> None:
    scene = case_scene(3)
    _, numbers, legend = heading(scene, [Listing.original("runge-kutta")])
    assert "omega(0) = (0, 1, 10)* rad/s; 100* steps of 0.01 s" in numbers
    assert legend.startswith("* assumed: omega(0), as in Case 2; 100 steps")
    assert "DO loop" in legend
    assert "omega(0) = (0, 1, 10) rad/s; 100* steps" in heading(case_scene(2))[1]
    _, numbers, legend = heading(replace(scene, omega=(0.0, 1.0, 9.0), steps=90))
    assert MARK not in numbers
    assert legend == "* assumed: all units"
    assert MARK not in "".join(heading(Scene("top", (0.0, 1.0, 10.0), moments=(41.0, 39.0, 20.0))))
