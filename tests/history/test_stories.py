"""Every claim has a story of three sentences with the numbers of its verdicts."""

import re
from dataclasses import replace

import pytest

from pyharness.history.claims.ledger import Judgement, claim, claims, judgement
from pyharness.history.claims.stories import FIELD, Story, prose, story
from pyharness.history.claims.verdicts import REPRODUCED, Judged

pytestmark = pytest.mark.claims
CLAIMS = [each["id"] for each in claims()]
# Digits that are no results: names of cases, variables and equations, the step and the number of
# steps of every run, and the constant on the card.
NAMES = (
    r"Cases? \d(?:(?:,| and| to|) \d)*", r"omega[123]", r"\bV2\b", r"equations? \d+",
    r"\b0\.001 s", r"\b100 steps", r"constant of 500\b", r"axes \d and \d", r"\bCDC 6600\b",
)  # fmt: skip


@pytest.fixture(scope="module")
def judged() -> dict[str, Judgement]:
    return {identity: judgement(identity) for identity in CLAIMS}


def _given(identity: str) -> list[str]:
    return [claim(identity)[name] for name in Story._fields]


def test_each_line_is_one_sentence_of_thirty_words_at_most(judged: dict[str, Judgement]) -> None:
    for found in judged.values():
        for line in story(found):
            assert line.endswith("."), line
            assert not re.search(r"[.!?] [A-Z]", line), line
            assert len(line.split()) - 2 * line.count("\N{MULTIPLICATION SIGN}") <= 30, line
            assert "{" not in line
            assert "nan" not in line
            assert line.count("$") % 2 == 0


def test_no_number_is_written_by_hand() -> None:
    for identity in CLAIMS:
        entry = claim(identity)
        known = (*NAMES, *re.findall(r"\b1[78]\d\d\b", entry.get("source", "")))
        for line in _given(identity):
            # Formulas, words of the thesis, and the years of the sources are quoted.
            left = re.sub(r"\$[^$]*\$", "", FIELD.sub("", line))
            left = re.sub("|".join(known), "", left.replace(f"“{entry['quote']}”", ""))
            assert not re.search(r"\d", left), left


def test_a_story_without_a_number_tells_a_source() -> None:
    fields = [FIELD.findall(" ".join(_given(each))) for each in CLAIMS]
    assert sum(map(len, fields)) > 60
    without = [name for name, each in zip(CLAIMS, fields, strict=True) if not each]
    assert without == ["i2-euler-symmetric", "i2-lagrange"]


def _changed(found: Judged) -> Judged:
    return Judged(found.verdict, {key: x * 3.0 + 1.0 for key, x in found.numbers.items()})


@pytest.mark.parametrize("identity", ["v2-case-2-stopped", "abstract-superior", "vi-suffices"])
def test_other_numbers_tell_another_story(identity: str, judged: dict[str, Judgement]) -> None:
    found = judged[identity]
    original, corrected = _changed(found.original), _changed(found.corrected)
    assert story(replace(found, original=original, corrected=corrected)) != story(found)


def test_least_and_largest_of_a_pattern(judged: dict[str, Judgement]) -> None:
    entry = {
        "id": "x", "saw": "{original: a}", "why": "{original: min of a*} {original: max of a*}",
        "truth": "{corrected: max of [!b]* in %}",
    }  # fmt: skip
    found = Judgement(
        entry, Judged(REPRODUCED, {"a": 2.0, "ab": 1.0, "b": 9.0}),
        Judged(REPRODUCED, {"a": 0.25, "b": 9.0}), (),
    )  # fmt: skip
    assert story(found) == ("2", "1 2", "25 %")
    # A field without its number is an error.
    found = judged["v2-case-2-stopped"]
    with pytest.raises(ValueError, match="v2-case-2-stopped has no number"):
        story(replace(found, original=found.corrected))


@pytest.mark.parametrize(("x", "text"), [
    (25.0, "25"), (19367.2, "19,400"), (0.0018, "0.0018"), (0.2, "0.2"), (0.0, "0"),
    (4.45e6, "4.45\N{NO-BREAK SPACE}\N{MULTIPLICATION SIGN}\N{NO-BREAK SPACE}10⁶"),
    (5.6e-13, "5.6\N{NO-BREAK SPACE}\N{MULTIPLICATION SIGN}\N{NO-BREAK SPACE}10⁻¹³"),
    (-0.5, "-0.5"), (99.96, "100"),
])  # fmt: skip
def test_numbers_in_sentences(x: float, text: str) -> None:
    assert prose(x) == text


def test_what_is_called_true_is_reproduced(judged: dict[str, Judgement]) -> None:
    for identity, found in judged.items():
        verdicts = (found.original.verdict, found.corrected.verdict)
        is_true = story(found).truth.startswith(("This is true", "True "))
        if verdicts == (REPRODUCED, REPRODUCED):
            assert is_true, identity
        if is_true:
            assert found.corrected.verdict.startswith(REPRODUCED), identity


def test_words_say_what_the_numbers_say(judged: dict[str, Judgement]) -> None:
    """Words of the stories that stand for an order or a number of results."""
    best = judged["abstract-superior"]
    assert best.original.numbers["of 5 cases, won by collocation"] == 5
    assert best.corrected.numbers["of 5 cases, won by collocation"] == 0
    inside = judged["iv2-points-inside"]
    # "which is the first step alone": one of a hundred steps.
    assert set(inside.original.numbers.values()) == {0.01}
    apart = judged["v2-case-7-concur"].original.numbers
    errors = [apart["two-term error (rad/s)"], apart["four-term error (rad/s)"]]
    assert max(errors) < 1.01 * min(errors)  # "nearly alike"
    parts = judged["v2-case-3-concur"].original.numbers
    assert parts["difference over the range of a component"] > 1.0
    assert set(judged["iv3-same-step"].original.numbers.values()) == {0.01}
    ratios = judged["v3-twice-the-time"].original.numbers
    for terms, is_twice in (("two-term", True), ("four-term", False)):
        ratio = ratios[f"{terms}: over Runge-Kutta, as written"]
        assert not 1.414 <= ratio <= 2.828  # "were all operations alike, neither"
        ratio = ratios[f"{terms}: time over Runge-Kutta, as written"]
        assert (1.414 <= ratio <= 2.828) == is_twice  # "about twice"
    assert len(judged["v2-case-6-too-fast"].corrected.numbers) == 3  # "each of three starts"
    assert judged["iv3-guard"].corrected.numbers["our own scene, unbounded at 1 s: stopped"] == 1
