"""The apparatus, the effect of each entry, and the lattice of defects."""

import csv
import json

import numpy as np

from pyharness import case_scene, run_program
from pyharness.history import ablation
from pyharness.model.listing import flagged, names_of
from pyharness.views.render import render
from tests.conftest import Printed

KINDS = {
    "defect", "reading", "conjecture", "misreading", "normalization", "dialect",
    "redundant", "unread", "unreachable", "missing text",
}  # fmt: skip
CERTAINTIES = {"certain", "probable", "conjecture", "undecidable"}


def test_every_entry_is_complete() -> None:
    found = ablation.entries()
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

    def at(name: str, case: int) -> ablation.CaseEffects:
        (first, *_) = (each for each in ablation.effects_of(name) if each.case == case)
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
    found = ablation.lattice(scene, "runge-kutta")
    assert len({each.listing.defects for each in found}) == 64
    # With a torque that varies, the conjecture counts too.
    assert len(ablation.lattice(case_scene(7), "four-term")) == 8
    # All are compared at the steps that the shortest run has, so that none gains by an early end.
    shortest = min(each.steps for each in found)
    assert shortest == 13
    for each in found:
        run = run_program(scene, each.listing)
        errors = np.abs(run.omega[:shortest] - ablation.case_truth(2).omega[:shortest])
        assert each.common[0] == errors.max() <= each.omega
    sizes = [float(f"{each.common[0]:.2e}") for each in found]
    assert sizes == sorted(sizes, reverse=True)
    bases = {"stage-base", "base-not-restored"}
    assert all(each.listing.defects >= bases for each in found[:16])
    assert not any(each.listing.defects & bases for each in found[-16:])
    # Runs that stop at step 25 have the defects that cause the stop.
    stopped = [each.listing.defects for each in found if each.stop and each.steps == 25]
    needed = {*bases, "lipschitz-tests-velocity", "lipschitz-per-component"}
    assert needed <= frozenset.intersection(*stopped)
    text = render(ablation.lattice_report(scene, {"runge-kutta": found}), "table")
    assert max(map(len, text.splitlines())) <= 100


def test_defects_on_the_command_line(printed: Printed) -> None:
    listed, brief = printed("defects --all"), printed("defects")
    assert [line.split()[0] for line in brief.splitlines() if line[:1].islower()] == [
        "name", *names_of("defect")
    ]  # fmt: skip
    assert f"\n{len(ablation.entries()) - len(names_of('defect'))} more entries: " in brief
    pages = {each["id"]: printed(f"defects {each['id']}") for each in ablation.entries()}
    assert max(len(line) for page in (listed, *pages.values()) for line in page.splitlines()) <= 100
    for each in ablation.entries():
        assert f"\n{each['id']} " in listed
        assert ("Effect, measured now" in pages[each["id"]]) == ("flag" in each)
    rows = [line.split()[0] for line in pages["stage-base"].splitlines() if line[:1].isdigit()]
    assert rows == ["1*", "2", "3*", "4*", "5", "6*", "7*"]
    record = json.loads(printed("defects --kind reading --format json"))
    assert [each["id"] for each in record["entries"]] == list(names_of("reading"))
    record = json.loads(printed("defects dt-accumulates --format json"))
    assert len(record["effects"]) == 2 * 7
    assert record["effects"][5]["original"]["ended"] == "overflow"


def test_ablate_in_every_form(printed: Printed) -> None:
    command = "compare --case 4 --ablate"
    assert "every subset" in printed(command)
    assert len(printed(f"{command} --format csv").splitlines()) == 1 + 8 + 4 + 64
    record = json.loads(printed(f"{command} --format json --program two-term"))
    assert [len(each) for each in record["lattice"].values()] == [8]
    assert printed(f"{command} --program runge-kutta --reading do-variable")


def test_run_with_an_early_end_is_compared_up_to_there(printed: Printed) -> None:
    rows = list(csv.DictReader(printed("compare --case 6 --ablate --format csv").splitlines()))
    rows = [row for row in rows if row["program"] == "two-term"]
    assert {row["steps"] for row in rows if row["ended"] == "overflow"} == {"56"}
    complete = [row for row in rows if row["ended"] == "complete"]
    assert complete
    for row in complete:
        assert float(row["common_error_w"]) < float(row["error_w"]) / 5.0
    text = printed("compare --case 6 --program two-term --ablate")
    assert "up to step 56, which all runs reached" in " ".join(text.split())
