"""The decks compared with each other and with the thesis: every difference is explained."""

import copy
import csv
import json
from typing import Any

import pytest

from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis import cards, collation
from pyharness.thesis.collation import faults, rows, statements
from tests.conftest import Printed


def _rows_with(monkeypatch: pytest.MonkeyPatch, name: str, change: Any) -> Any:
    content = copy.deepcopy(facts(name))
    change(content)
    tables = {name: content}
    for module in (collation, cards):
        monkeypatch.setattr(module, "facts", lambda table: tables.get(table) or facts(table))
    cards.deck.cache_clear()
    try:
        return rows(), faults(rows())
    finally:
        cards.deck.cache_clear()


@pytest.mark.parametrize(("program", "number", "old", "new", "what"), [
    ("four-term", "640", "MS1", "MS2", "accelerations"),
    ("runge-kutta", "370", "I3-I1", "I1-I3", "A, B and C"),
    ("runge-kutta", "560", "40.", "41.", "forces"),
    ("two-term", "750", "U2(1)", "U1(1)", "right-hand sides of omega at the beginning"),
    ("four-term", "2250", "+.01", "+.02", "DT grows"),
])  # fmt: skip
def test_a_card_that_differs_is_found_where_decks_agreed(
    program: str, number: str, old: str, new: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def alter(content: Any) -> None:
        card = content["cards"][number]
        assert old in card["text"]
        card["text"] = card["text"].replace(old, new)

    before = {row.what: row.decks for row in rows()}
    found, _ = _rows_with(monkeypatch, f"cards/{program}", alter)
    after = {row.what: row.decks for row in found}
    assert {name for name in before if before[name] != after[name]} == {what}
    assert after[what] == "differ"


_NONE = "no entry or reason"
_MEND = "name it in a row of cards/collation.toml"
# Changes of the row of a step (None removes an item), and faults that are found.
_CHANGES: list[tuple[str, dict[str, Any], list[str]]] = [
    ("label 30", {"entries": None}, [f"label 30: {_NONE}", "dead-label-30: in no row"]),
    ("END", {"reason": None}, [f"END: {_NONE}"]),
    (
        "label 30", {"cards": {"two-term": "1010"}},
        ["two-term:1010 is in two rows", "two-term:1000 is in no row"],
    ),
    (
        "label 30", {"entries": ["dead-label-30", "stage-base", "dead-label-31"]},
        ["label 30: no entry 'dead-label-31'", "label 30: stage-base names none of its cards"],
    ),
    ("the step", {"agrees": False, "entries": []}, [f"the step: {_NONE}"]),
]  # fmt: skip


@pytest.mark.parametrize(("step", "changes", "told"), _CHANGES, ids=range(len(_CHANGES)))
def test_what_is_left_out_is_told(
    step: str, changes: dict[str, Any], told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def change(content: Any) -> None:
        (row,) = [each for each in content["row"] if each["what"] == step]
        for key, value in changes.items():
            row[key] = row[key] | value if isinstance(value, dict) else value
            if value is None:
                del row[key]

    _, found = _rows_with(monkeypatch, "cards/collation", change)
    assert set(found) >= set(told)
    assert len(found) == len(told) or step == "the step", _MEND


def test_stages_of_the_runge_kutta_deck_have_the_same_right_hand_sides() -> None:
    for groups in (("800-820", "950-970", "1120-1140"), ("830-850", "980-1000", "1150-1170")):
        first, *others = (statements("runge-kutta", each) for each in groups)
        assert all(each == first for each in others)


def test_every_disagreement_that_is_named_in_the_apparatus_is_in_the_table() -> None:
    assert {name for row in rows() for name in row.entries} >= {
        "three-masses", "points-in-the-loop", "unused-elements", "oversized-work-area",
        "unused-torques", "silent-stop", "product-without-omega0", "case-7-torque",
        "translational-block",
    }  # fmt: skip


def test_the_verb_shows_the_table_in_every_form(printed: Printed) -> None:
    assert faults(rows()) == [], _MEND
    text = printed("cards --collate")
    assert max(map(len, text.splitlines())) <= 100
    assert text.rstrip().endswith(f"{len(rows())} steps: nothing is unexplained")
    record = json.loads(printed("cards --collate --format json"))
    assert record["unexplained"] == []
    assert len(record["steps"]) == len(rows())
    (step,) = [each for each in record["steps"] if each["what"] == "the step"]
    assert set(step["cards"]) == set(PROGRAMS)
    table = list(csv.DictReader(printed("cards --collate --format csv").splitlines()))
    assert [each["step"] for each in table] == [row.what for row in rows()]
