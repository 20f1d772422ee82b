"""The disagreements of decks and thesis: quoted cards, entries and formulas exist."""

import copy
import csv
import json
import re
from functools import reduce
from itertools import combinations
from operator import getitem
from typing import Any

import numpy as np
import pytest

from docs.text.page import shared_statements, statements, text_page
from pyharness import case_scene, run_program
from pyharness.history import origins
from pyharness.history.origins import disagreements, mistakes, unexplained_defects
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis.cards import deck
from tests.conftest import Printed


def test_nothing_is_wrong() -> None:
    assert mistakes() == []
    explained = {name for each in origins.disagreements() for name in each.entries}
    defects = {each["id"] for each in facts("apparatus")["entry"] if each["kind"] == "defect"}
    assert defects <= explained | set(unexplained_defects())
    assert set(unexplained_defects()) == {"impossible-body", "case-7-torque"}
    # J=I-1 gives stages 3 and 4 the values that cards 940 and 1110 set.
    cards = deck("runge-kutta").cards
    assert cards[780].statement.endswith("J=I-1")
    for number, stage in ((940, 3), (1110, 4)):
        assert cards[number].statement.replace(" ", "") == f"J={stage - 1}"


_NEITHER = "must be in a disagreement or"
# Changes of the table: an item of it, its new value, and mistakes that are found.
_CHANGES: list[tuple[list[Any], Any, list[str]]] = [
    (
        ["disagreement", 0, "cards", "two-term", "1660"], "DT=DT+.02",
        ["growing-dt: two-term:1660 is not 'DT=DT+.02'"],
    ),
    (
        ["unexplained", "stage-base"], "no reason",
        [f"stage-base: {_NEITHER} without an explanation, and not in both"],
    ),
    (
        ["disagreement", 0, "entries"], ["dt-accumulates"],
        [f"time-axis: {_NEITHER} without an explanation, and not in both"],
    ),
    (
        ["as_required", "steps", 0], "DT grows",
        [f"DT grows: {_NEITHER} as required, and not in both"],
    ),
    (["disagreement", 0, "steps"], ["DT shrinks"], ["no step 'DT shrinks'"]),
    (["disagreement", 0, "equations"], ["99"], ["no formula '99'"]),
    (
        ["disagreement", 0, "entries"], ["time-axis", "no-entry", "stage-base"],
        ["no entry 'no-entry'", "stage-base names none"],
    ),
    (["disagreement", 0, "origin"], "chance", ["no origin 'chance'"]),
    (["disagreement", 0, "certainty"], "sure", ["no certainty 'sure'"]),
    (["disagreement", 0, "id"], "end-of-the-interval", ["is 2 times in the table"]),
]  # fmt: skip


@pytest.mark.parametrize(("place", "value", "told"), _CHANGES, ids=range(len(_CHANGES)))
def test_a_mistake_is_found(
    place: list[Any], value: Any, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    content = copy.deepcopy(facts("disagreements"))
    reduce(getitem, place[:-1], content)[place[-1]] = value
    tables = {"disagreements": content}
    monkeypatch.setattr(origins, "facts", lambda name: tables.get(name) or facts(name))
    found = mistakes()
    for each in told:
        assert any(each in mistake for mistake in found), found
    # Deeper changes may have further consequences.
    assert len(place) == 3 or len(found) == len(told)


def test_decks_share_statements() -> None:
    found = shared_statements()
    two, *with_third = (found[pair] for pair in combinations(PROGRAMS, 2))
    assert two > 2 * max(with_third)
    for (one, other), count in found.items():
        assert count < min(len(statements(one)), len(statements(other)))
    # Seven statements are the same because we call the torques N in both decks.
    in_scan = shared_statements(scanned_names=True)
    assert [found[pair] - in_scan[pair] for pair in found] == [7, 1, 0]
    rows = re.findall(r"^\| ([\w-]+) and ([\w-]+) \| (\d+) \| (\d+) \|", text_page(), re.M)
    assert rows == [(*pair, str(n), str(n - in_scan[pair])) for pair, n in found.items()]


@pytest.mark.parametrize("program", PROGRAMS)
def test_faults_have_no_effect_on_omega_in_case_1(program: str) -> None:
    """Therefore the tests of the thesis in Case 1 do not show them."""
    scene = case_scene(1)
    original = run_program(scene, Listing.original(program))
    truth = np.array(scene.omega) + 2.5 * original.time[:, None]
    assert len(original.time) > 90
    np.testing.assert_allclose(original.omega, truth, rtol=0, atol=1e-12)


def test_page_and_verb_have_every_row(printed: Printed, monkeypatch: pytest.MonkeyPatch) -> None:
    page = text_page()
    for each in disagreements():
        assert page.count(f"\n| {each.title} | {each.suggests} |") == 1
    for name in unexplained_defects():
        assert f"- `{name}`: " in page
    monkeypatch.setenv("COLUMNS", "100")
    text = printed("cards --origins")
    assert max(map(len, text.splitlines())) <= 100
    assert text.rstrip().endswith(f"{len(disagreements())} disagreements")
    record = json.loads(printed("cards --origins --format json"))
    assert [each["id"] for each in record["disagreements"]] == [e.id for e in disagreements()]
    assert record["unexplained"] == [*unexplained_defects()]
    table = list(csv.DictReader(printed("cards --origins --format csv").splitlines()))
    assert [each["disagreement"] for each in table] == [each.id for each in disagreements()]
