"""Assumptions are marked where a number depends on them, and nowhere else."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pyharness import Scene, case_scene, run_program
from pyharness.model.assumptions import (
    ASSUMED,
    MARK,
    assumed,
    assumption_records,
    assumptions,
    legend,
    mark,
    open_starts,
)
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene_file import case_numbers
from pyharness.model.scene_report import heading

Printed = Callable[[str], str]
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


@pytest.mark.sampled
@pytest.mark.parametrize("command", [
    "compare --case 3 --program runge-kutta", "compare --case 3 --method taylor",
    "compare --case 3 --program two-term --ablate", "run --case 3 --program runge-kutta",
    "run --case 3 --method taylor", "plan --case 3", "limits --case 3", "prove --case 3",
    "family --case 3 --terms 1 --weighting galerkin", "rotations --case 3",
    "words --case 3 --program runge-kutta --lengths",
])  # fmt: skip
def test_json_lists_what_the_marks_stand_for(command: str, printed: Printed) -> None:
    shown = " ".join(printed(command).split())
    record = json.loads(printed(f"{command} --format json"))
    assert list(record)[-1] == "assumptions"
    found = record["assumptions"]
    assert [each["id"] for each in found][:3] == ["omega0", "steps", "units"]
    assert all(each["cases"] == [3] for each in found)
    assert f"{ASSUMED}: {'; '.join(each['what'] for each in found)}" in shown


def test_json_of_an_entry_names_the_assumptions_of_all_cases(printed: Printed) -> None:
    found = json.loads(printed("defects stage-base --format json"))["assumptions"]
    starts = [(each["what"], each["cases"]) for each in found if each["id"] == "omega0"]
    assert starts == [
        ("omega(0), ours", [1]), ("omega(0), as in Case 2", [3, 4]),
        ("omega(0), as in Case 5", [6, 7]),
    ]  # fmt: skip
    assert json.loads(printed("defects dialect-cdc --format json"))["assumptions"] == []


def test_json_without_an_assumption_says_so(printed: Printed) -> None:
    found = json.loads(printed("plan --scene docs/satellite.toml --format json"))
    assert found["assumptions"] == []


@pytest.mark.claims
def test_json_of_claims_names_what_a_claim_may_depend_on(printed: Printed) -> None:
    for claim, ids in (
        ("v3-twice-the-time", ["units", "unit-times"]),
        ("v2-case-6-diverged", ["omega0", "omega0", "omega0", "steps", "units", "c1-for-c"]),
    ):
        found = json.loads(printed(f"claims --explain {claim} --format json"))["assumptions"]
        assert [each["id"] for each in found] == ids


def test_the_legend_of_several_cases_names_those_of_each_assumption() -> None:
    runs = [(case_scene(case), [Listing.original("runge-kutta")]) for case in (2, 3, 4)]
    (line,) = legend(runs)
    assert line.startswith(f"{ASSUMED}: omega(0), as in Case 2 (Cases 3, 4); 100 steps")
    assert line.endswith("all units; I after the DO loop of runge-kutta, its last value")
    assert [each["cases"] for each in assumption_records(runs)][:2] == [[3, 4], [2, 3, 4]]
    assert legend([(Scene("top", (0.0, 1.0, 10.0), moments=(41.0, 39.0, 20.0)), [])]) == []


def test_the_sign_is_printed_by_every_terminal() -> None:
    assert f"{MARK} assumed" == ASSUMED
    assert ASSUMED.isascii()
