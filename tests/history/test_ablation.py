"""The apparatus, the effect of each entry, and the lattice of defects."""

import json
from dataclasses import replace

import pytest

from pyharness import Scene, case_scene
from pyharness.history.ablation import (
    CaseEffects,
    Effect,
    effects_of,
    entries,
    lattice,
    lattice_report,
)
from pyharness.model.listing import Listing, flagged, names_of
from pyharness.truth.reference import Reference
from pyharness.views.render import render
from tests.conftest import Printed

KINDS = {
    "defect", "reading", "conjecture", "misreading", "normalization", "dialect",
    "redundant", "unread", "unreachable", "missing text",
}  # fmt: skip
CERTAINTIES = {"certain", "probable", "conjecture", "undecidable"}


def test_every_entry_is_complete() -> None:
    found = entries()
    assert len({each["id"] for each in found}) == len(found) > 35
    assert {each["kind"] for each in found} == KINDS
    assert {each["id"] for each in found if "flag" in each} == {each["id"] for each in flagged()}
    for each in found:
        assert each["certainty"] in CERTAINTIES, each["id"]
        for key in ("summary", "scan", "adopted", "evidence", "why"):
            assert each[key], (each["id"], key)
        if each["kind"] in ("defect", "reading", "conjecture"):
            assert each["original"], each["id"]
            assert each["corrected"], each["id"]
        # A quotation is a few words.
        assert len(each["scan"]) < 120, each["id"]


def test_effects_show_what_each_entry_says() -> None:
    """Compare an entry that is alone corrected or alone kept, in the case that shows it best."""

    def at(name: str, case: int) -> CaseEffects:
        (first, *_) = (each for each in effects_of(name) if each.case == case)
        return first

    points = at("dt-accumulates", 5)
    assert points.original.omega > 1.0 > 100 * points.corrected_alone.omega
    assert points.kept_alone.omega > 1.0 > 100 * points.corrected.omega
    position = at("x3-reads-acl2", 5)
    assert position.kept_alone.omega == position.corrected.omega
    assert position.kept_alone.velocity > 10 * position.corrected.velocity
    for each in (at("base-not-restored", 4), at("stage-base", 4)):
        assert each.kept_alone.omega > 1e4 * each.corrected.omega


def test_lattice_is_whole_and_sorted() -> None:
    scene = case_scene(2)
    found = lattice(scene, "runge-kutta")
    assert len({each.listing.defects for each in found}) == 64
    # With a torque that varies, the conjecture counts too.
    assert len(lattice(case_scene(7), "four-term")) == 8
    sizes = [float(f"{each.omega:.2e}") for each in found]
    assert sizes == sorted(sizes, reverse=True)
    # Without the stop test's defects the run continues and shows its whole error.
    bases = {"stage-base", "base-not-restored"}
    assert found[0].listing.defects >= bases
    assert found[0].steps == 100
    best = [each for each in found if each.steps == 100][-1]
    assert not best.listing.defects & bases
    # Runs that stop at step 25 have the defects that cause the stop.
    stopped = [each.listing.defects for each in found if each.stop and each.steps == 25]
    needed = {*bases, "lipschitz-tests-velocity", "lipschitz-per-component"}
    assert needed <= frozenset.intersection(*stopped)
    text = render(lattice_report(scene, {"runge-kutta": found}), "table")
    assert max(map(len, text.splitlines())) <= 100


def test_defects_on_the_command_line(printed: Printed) -> None:
    listed = printed("defects")
    pages = {each["id"]: printed(f"defects {each['id']}") for each in entries()}
    assert max(len(line) for page in (listed, *pages.values()) for line in page.splitlines()) <= 100
    for each in entries():
        assert f"\n{each['id']} " in listed
        assert ("Effect, measured now" in pages[each["id"]]) == ("flag" in each)
    record = json.loads(printed("defects --kind reading --format json"))
    assert [each["id"] for each in record["entries"]] == list(names_of("reading"))
    record = json.loads(printed("defects dt-accumulates --format json"))
    assert len(record["effects"]) == 2 * 7
    assert record["effects"][5]["original"]["ended"] == "overflow"


def test_ablate_in_every_form(printed: Printed) -> None:
    command = "compare --case 4 --ablate"
    assert "every subset" in printed(command)
    rows = printed(f"{command} --format csv").splitlines()
    assert len(rows) == 1 + 8 + 4 + 64
    record = json.loads(printed(f"{command} --format json --program two-term"))
    assert [len(each) for each in record["lattice"].values()] == [8]
    assert printed(f"{command} --program runge-kutta --reading do-variable")


def test_overflow_near_the_truth_is_worse_too(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = iter([(0.5, "complete"), (0.1, "overflow"), (0.7, "complete"), (0.6, "stopped")])

    def effect(scene: Scene, listing: Listing, truth: Reference, effort: float) -> Effect:
        size, ended = next(sizes)
        return Effect(listing, size, 0.0, 2, ended, None)

    monkeypatch.setattr("pyharness.history.ablation.effect", effect)
    found = lattice(replace(case_scene(3), steps=2), "four-term")
    assert [each.omega for each in found] == [0.1, 0.7, 0.6, 0.5]
