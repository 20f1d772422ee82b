"""The decks compared with each other and with the thesis: every difference is explained."""

import copy
import csv
import json
from typing import Any

import pytest

from pyharness.cli.main import main
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.original import cards, deck_collation
from pyharness.original.deck_collation import faults, rows, statements


def test_nothing_is_unexplained() -> None:
    assert faults(rows()) == []


def _with(monkeypatch: pytest.MonkeyPatch, name: str, change: Any) -> list[str]:
    """Return the faults found after a change of one table of facts."""
    content = copy.deepcopy(facts(name))
    change(content)
    for module in (deck_collation, cards):
        monkeypatch.setattr(
            module, "facts", lambda table: content if table == name else facts(table)
        )
    cards.deck.cache_clear()
    try:
        return faults(rows())
    finally:
        cards.deck.cache_clear()


def _row(content: Any, what: str) -> Any:
    (found,) = [each for each in content["row"] if each["what"] == what]
    return found


@pytest.mark.parametrize(
    ("program", "number", "old", "new", "what"),
    [
        ("four-term", "640", "MS1", "MS2", "accelerations"),
        ("runge-kutta", "370", "I3-I1", "I1-I3", "A, B and C"),
        ("runge-kutta", "560", "40.", "41.", "forces"),
        ("two-term", "750", "U2(1)", "U1(1)", "right-hand sides of omega at the beginning"),
        ("four-term", "2250", "+.01", "+.02", "DT grows"),
    ],
)
def test_a_card_that_differs_is_found_where_decks_agreed(
    program: str, number: str, old: str, new: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {row.what: row.decks for row in rows()}

    def alter(content: Any) -> None:
        card = content["cards"][number]
        assert old in card["text"]
        card["text"] = card["text"].replace(old, new)

    after = {row.what: row.decks for row in _rows_with(monkeypatch, f"cards/{program}", alter)}
    assert {name for name in before if before[name] != after[name]} == {what}
    assert after[what] == "differ"


def _rows_with(monkeypatch: pytest.MonkeyPatch, name: str, change: Any) -> Any:
    content = copy.deepcopy(facts(name))
    change(content)
    monkeypatch.setattr(cards, "facts", lambda table: content if table == name else facts(table))
    cards.deck.cache_clear()
    try:
        return rows()
    finally:
        cards.deck.cache_clear()


def test_what_is_left_out_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def forget(what: str, *keys: str) -> Any:
        def change(content: Any) -> None:
            for key in keys:
                _row(content, what).pop(key)

        return change

    told = _with(monkeypatch, "cards/collation", forget("label 30", "entries"))
    assert told == ["label 30: no entry or reason", "dead-label-30: in no row"]
    told = _with(monkeypatch, "cards/collation", forget("END", "reason"))
    assert told == ["END: no entry or reason"]

    def other_card(content: Any) -> None:
        _row(content, "label 30")["cards"]["two-term"] = "1010"

    told = _with(monkeypatch, "cards/collation", other_card)
    assert set(told) == {"two-term:1010 is in two rows", "two-term:1000 is in no row"}

    def misnamed(content: Any) -> None:
        _row(content, "label 30")["entries"] = ["dead-label-30", "stage-base", "dead-label-31"]

    told = _with(monkeypatch, "cards/collation", misnamed)
    assert told == [
        "label 30: no entry 'dead-label-31'",
        "label 30: stage-base names none of its cards",
    ]

    def disagrees(content: Any) -> None:
        _row(content, "the step").update(agrees=False, entries=[])

    told = _with(monkeypatch, "cards/collation", disagrees)
    assert "the step: no entry or reason" in told


def test_stages_of_the_runge_kutta_deck_have_the_same_right_hand_sides() -> None:
    for groups in (("800-820", "950-970", "1120-1140"), ("830-850", "980-1000", "1150-1170")):
        first, *others = (statements("runge-kutta", each) for each in groups)
        assert all(each == first for each in others)


def test_every_disagreement_that_is_named_in_the_apparatus_is_in_the_table() -> None:
    found = {name for row in rows() for name in row.entries}
    for name in (
        "three-masses", "points-in-the-loop", "unused-elements", "oversized-work-area",
        "unused-torques", "silent-stop", "product-without-omega0", "case-7-torque",
        "translational-block",
    ):  # fmt: skip
        assert name in found


def test_the_verb_shows_the_table_in_every_form(capsys: pytest.CaptureFixture[str]) -> None:
    def told(*options: str) -> str:
        assert main(["cards", "--collate", *options]) == 0
        return capsys.readouterr().out

    text = told()
    assert max(map(len, text.splitlines())) <= 100
    assert text.rstrip().endswith(f"{len(rows())} steps: nothing is unexplained")
    record = json.loads(told("--format", "json"))
    assert record["unexplained"] == []
    assert len(record["steps"]) == len(rows())
    (step,) = [each for each in record["steps"] if each["what"] == "the step"]
    assert set(step["cards"]) == set(PROGRAMS)
    table = list(csv.DictReader(told("--format", "csv").splitlines()))
    assert [each["step"] for each in table] == [row.what for row in rows()]
