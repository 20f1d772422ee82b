"""The apparatus, the effect of each entry, and the lattice of defects."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from pyharness import InputError, Scene, case_scene
from pyharness.cli.main import main
from pyharness.history.ablation import Effect, effects_of, entries, entry, lattice
from pyharness.history.apparatus_report import lattice_report
from pyharness.model.listing import Listing, flagged, names_of, original
from pyharness.truth.reference import Reference
from pyharness.views.render import render

Capture = pytest.CaptureFixture[str]
KINDS = {"defect", "reading", "misreading", "dialect", "dead code", "missing text"}
CERTAINTIES = {"certain", "probable", "conjecture", "undecidable"}


def test_every_entry_is_complete() -> None:
    found = entries()
    assert len({each["id"] for each in found}) == len(found) > 35
    assert {each["kind"] for each in found} == KINDS
    for each in found:
        assert each["certainty"] in CERTAINTIES, each["id"]
        for key in ("summary", "scan", "adopted", "evidence", "why"):
            assert each[key], (each["id"], key)
        if each["kind"] in ("defect", "reading"):
            assert each["original"], each["id"]
            assert each["corrected"], each["id"]
        # A quotation is a few words.
        assert len(each["scan"]) < 120, each["id"]


def test_effects_show_what_each_entry_says() -> None:
    """Alone corrected and alone kept, in the case that shows it best."""

    def at(name: str, program: str, case: int) -> dict[str, float]:
        found = next(e for e in effects_of(name) if (e.program, e.case) == (program, case))
        return {
            "original": found.original.omega,
            "corrected_alone": found.corrected_alone.omega,
            "kept_alone": found.kept_alone.omega,
            "corrected": found.corrected.omega,
            "v_kept": found.kept_alone.velocity,
            "v_mended": found.corrected.velocity,
        }

    dt = at("dt-accumulates", "two-term", 5)
    assert dt["original"] > 1.0 > 100 * dt["corrected_alone"]
    assert dt["kept_alone"] > 1.0 > 100 * dt["corrected"]
    x3 = at("x3-reads-acl2", "two-term", 5)
    assert x3["kept_alone"] == x3["corrected"]
    assert x3["v_kept"] > 10 * x3["v_mended"]
    base = at("base-not-restored", "runge-kutta", 4)
    stage = at("stage-base", "runge-kutta", 4)
    for each in (base, stage):
        assert each["kept_alone"] > 1e4 * each["corrected"]
    held = at("torque-held", "runge-kutta", 7)
    assert held["kept_alone"] > 100 * held["corrected"]


def test_lattice_is_whole_and_sorted() -> None:
    scene = case_scene(2)
    found = lattice(scene, "runge-kutta")
    assert len({each.listing.defects for each in found}) == 64
    sizes = [float(f"{each.omega:.2e}") for each in found]
    assert sizes == sorted(sizes, reverse=True)
    # Without the stop test's defects the run goes on and shows its whole error.
    assert found[0].listing.defects >= {"stage-base", "base-not-restored"}
    assert found[0].steps == 100
    best = [each for each in found if each.steps == 100][-1]
    assert not best.listing.defects & {"stage-base", "base-not-restored"}
    # Among the runs that original stop at step 25, all have the three defects that make it.
    stopped = [each for each in found if each.stop and each.steps == 25]
    assert stopped
    for each in stopped:
        assert each.listing.defects >= {"stage-base", "base-not-restored"}
        assert each.listing.defects >= {"lipschitz-tests-velocity", "lipschitz-per-component"}
    text = render(lattice_report(scene, {"runge-kutta": found}), "table")
    assert max(map(len, text.splitlines())) <= 100


def test_overflow_is_worse_than_any_error() -> None:
    found = lattice(case_scene(6), "two-term")
    assert found[0].ended == "overflow"
    assert all("dt-accumulates" in each.listing.defects for each in found[:4])


def test_unknown_names() -> None:
    with pytest.raises(InputError, match="did you mean 'stage-base'"):
        entry("stagebase")
    with pytest.raises(InputError, match="did you mean 'misreading'"):
        entries("misreadings")


def test_defects_on_the_command_line(capsys: Capture) -> None:
    assert main(["defects"]) == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 100
    for each in entries():
        assert f"\n{each['id']} " in out
    for each in entries():
        assert main(["defects", each["id"]]) == 0
        out = capsys.readouterr().out
        assert max(map(len, out.splitlines())) <= 100
        assert ("effect, measured now" in out) == ("flag" in each)
    assert main(["defects", "--kind", "reading", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [each["id"] for each in record["entries"]] == list(names_of("reading"))
    assert main(["defects", "dt-accumulates", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert len(record["effects"]) == 2 * 7
    assert record["effects"][5]["original"]["ended"] == "overflow"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["defects", "stagebase"], "did you mean 'stage-base'"),
        (["defects", "--kind", "defct"], "did you mean 'defect'"),
        (["defects", "stage-base", "--kind", "defect"], "--kind has no meaning with a name"),
        (["defects", "stage-base", "surplus"], "unknown option 'surplus'"),
        (["compare", "--case", "3", "--ablate", "--fix", "stage-base"], "--fix has no meaning"),
        (["compare", "--case", "3", "--ablate", "--reading", "x"], "unknown reading 'x'"),
        (["limits"], "--case N"),
        (["limits", "--case", "3", "--halvings", "0"], "allowed: 1 to 12"),
        (["limits", "--case", "3", "--program", "x"], "unknown program 'x'"),
    ],
)
def test_mistakes(arguments: list[str], words: str, capsys: Capture) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert words in captured.err


def test_ablate_in_every_form(capsys: Capture) -> None:
    arguments = ["compare", "--case", "4", "--ablate"]
    assert main(arguments) == 0
    assert "every subset" in capsys.readouterr().out
    assert main([*arguments, "--format", "csv"]) == 0
    rows = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert len(rows) == 8 + 4 + 64
    assert main([*arguments, "--format", "json", "--program", "two-term"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [len(each) for each in record["lattice"].values()] == [8]
    assert main([*arguments, "--program", "runge-kutta", "--reading", "do-variable"]) == 0


def test_limits_on_the_command_line(capsys: Capture) -> None:
    assert main(["limits", "--case", "5"]) == 0
    out = capsys.readouterr().out
    assert "2 y(t/2) - y(0)" in out
    assert max(map(len, out.splitlines())) <= 100
    assert main(["limits", "--case", "5", "--program", "two-term", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out)
    distances = [each["from_limit"] for each in record["limits"][0]["halvings"]]
    assert np.all(np.diff(distances) < 0)
    assert main(["limits", "--case", "5", "--format", "csv"]) == 0
    assert capsys.readouterr().out.count("\n") == 1 + 3 * 7


def test_flagged_entries_are_those_of_the_listing() -> None:
    assert {each["id"] for each in flagged()} == {e["id"] for e in entries() if "flag" in e}


def test_overflow_near_the_truth_is_worse_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the rows before it are near the truth."""
    scene = replace(case_scene(3), steps=2)
    sizes = iter([(0.5, "complete"), (0.1, "overflow"), (0.7, "complete"), (0.6, "stopped")])

    def effect(scene: Scene, listing: Listing, truth: Reference, **_: object) -> Effect:
        size, ended = next(sizes)
        return Effect(listing, size, 0.0, 2, ended, None)

    monkeypatch.setattr("pyharness.history.ablation.effect", effect)
    monkeypatch.setattr("pyharness.history.ablation.names_of", lambda kind, program: ("a", "b"))
    monkeypatch.setattr("pyharness.history.ablation.Listing", lambda *_: original("two-term"))
    found = lattice(scene, "two-term")
    assert [each.omega for each in found] == [0.1, 0.7, 0.6, 0.5]
