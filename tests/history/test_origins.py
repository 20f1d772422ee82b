"""The disagreements of decks and thesis: quoted cards, entries and formulas exist."""

import copy
import csv
import json
import re
from typing import Any

import numpy as np
import pytest

from docs.text.page import text_page
from pyharness import run_program
from pyharness.cli.main import main
from pyharness.history import origins
from pyharness.history.origins import (
    CERTAINTIES,
    disagreements,
    mistakes,
    shared_statements,
    statement_count,
    unexplained_defects,
)
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene_file import case_scene
from pyharness.original.cards import deck


def test_nothing_is_wrong() -> None:
    assert mistakes() == []


def _with(monkeypatch: pytest.MonkeyPatch, change: Any) -> list[str]:
    content = copy.deepcopy(facts("disagreements"))
    change(content)
    monkeypatch.setattr(
        origins, "facts", lambda name: content if name == "disagreements" else facts(name)
    )
    return mistakes()


def test_a_quotation_that_is_not_on_the_card_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def change(content: Any) -> None:
        content["disagreement"][0]["cards"]["two-term"]["1660"] = "DT=DT+.02"

    assert _with(monkeypatch, change) == ["growing-dt: two-term:1660 is not 'DT=DT+.02'"]


def test_a_defect_that_is_left_out_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def change(content: Any) -> None:
        content["disagreement"][0]["entries"].remove("time-axis")
        content["unexplained"]["stage-base"] = "no reason"

    told = _with(monkeypatch, change)
    end = "must be in a disagreement or without an explanation, and not in both"
    assert told == [f"stage-base: {end}", f"time-axis: {end}"]


def test_a_step_that_is_left_out_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def change(content: Any) -> None:
        content["as_required"]["steps"].remove("END")
        content["as_required"]["steps"].append("DT grows")

    told = _with(monkeypatch, change)
    assert told == ["DT grows: must be in a disagreement or as required, and not in both"]


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("steps", ["DT shrinks"], "no step 'DT shrinks'"),
        ("equations", ["99"], "no formula '99'"),
        ("entries", ["dt-accumulates", "time-axis", "no-entry"], "no entry 'no-entry'"),
        ("entries", ["dt-accumulates", "time-axis", "stage-base"], "stage-base names none"),
        ("origin", "chance", "no origin 'chance'"),
        ("certainty", "sure", "no certainty 'sure'"),
        ("id", "end-of-the-interval", "is 2 times in the table"),
    ],
)
def test_a_name_that_does_not_exist_is_found(
    key: str, value: Any, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def change(content: Any) -> None:
        content["disagreement"][0][key] = value

    assert any(message in each for each in _with(monkeypatch, change))


def test_every_defect_is_explained_or_named() -> None:
    explained = {name for each in disagreements() for name in each.entries}
    defects = {e["id"] for e in facts("apparatus")["entry"] if e["kind"] == "defect"}
    assert defects == (explained & defects) | set(unexplained_defects())
    assert set(unexplained_defects()) == {"impossible-body", "case-7-torque"}
    assert {each.certainty for each in disagreements()} <= set(CERTAINTIES)


def test_decks_share_statements() -> None:
    found = shared_statements()
    assert found[PROGRAMS[0], PROGRAMS[1]] > 2 * max(
        found[PROGRAMS[0], PROGRAMS[2]], found[PROGRAMS[1], PROGRAMS[2]]
    )
    for (one, other), count in found.items():
        assert count < min(statement_count(one), statement_count(other))
    # Seven statements are the same because we call the torques N in both decks.
    in_scan = shared_statements(scanned_names=True)
    assert [found[pair] - in_scan[pair] for pair in found] == [7, 1, 0]
    rows = re.findall(r"^\| ([\w-]+) and ([\w-]+) \| (\d+) \| (\d+) \|", text_page(), re.M)
    assert rows == [(*pair, str(n), str(n - in_scan[pair])) for pair, n in found.items()]


def test_known_facts_of_the_stages_are_on_the_cards() -> None:
    """J=I-1 gives stages 3 and 4 the values that cards 940 and 1110 set."""
    cards = deck("runge-kutta").cards
    assert cards[780].statement.endswith("J=I-1")
    for number, stage in ((940, 3), (1110, 4)):
        assert cards[number].statement.replace(" ", "") == f"J={stage - 1}"


@pytest.mark.parametrize("program", PROGRAMS)
def test_faults_have_no_effect_on_omega_in_case_1(program: str) -> None:
    """Therefore the tests of the thesis in Case 1 do not show them."""
    scene = case_scene(1)
    original = run_program(scene, Listing.original(program))
    truth = np.array(scene.omega) + 2.5 * original.time[:, None]
    assert len(original.time) > 90
    np.testing.assert_allclose(original.omega, truth, rtol=0, atol=1e-12)


def test_page_has_every_disagreement_once() -> None:
    page = text_page()
    for each in disagreements():
        assert page.count(f"\n| {each.title} | {each.suggests} |") == 1
    for name in unexplained_defects():
        assert f"- `{name}`: " in page


def test_the_verb_shows_the_list_in_every_form(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")

    def told(*options: str) -> str:
        assert main(["cards", "--origins", *options]) == 0
        return capsys.readouterr().out

    text = told()
    assert max(map(len, text.splitlines())) <= 100
    assert text.rstrip().endswith(f"{len(disagreements())} disagreements")
    record = json.loads(told("--format", "json"))
    assert [each["id"] for each in record["disagreements"]] == [e.id for e in disagreements()]
    assert record["unexplained"] == [*unexplained_defects()]
    table = list(csv.DictReader(told("--format", "csv").splitlines()))
    assert [each["disagreement"] for each in table] == [each.id for each in disagreements()]
