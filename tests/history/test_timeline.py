"""Every date is in its source, and the page and the site show the same events."""

import re
from datetime import datetime
from pathlib import Path

import pytest

from pyharness.history.timeline import Event, timeline
from pyharness.model.facts import facts

ROOT = Path(__file__).parents[2]
THESIS = ROOT.parent / "shared/thesis/thesis.txt"
EVENTS = {each.id: each for each in timeline()}


@pytest.mark.parametrize("event", EVENTS.values(), ids=EVENTS)
def test_every_event_has_a_source_and_a_date_that_agrees_with_its_certainty(event: Event) -> None:
    assert event.what.endswith(".")
    assert event.where
    assert event.certainty in {"certain", "probable", "unknown"}
    assert bool(event.first) == (event.certainty != "unknown")
    assert bool(event.why) == (event.certainty != "certain")
    if event.first:
        months = [datetime.strptime(each, "%Y-%m") for each in (event.first, event.last)]
        assert months == sorted(months)
    if event.certainty == "certain":  # the words of the source have the date
        named = re.findall(r"[A-Z][a-z]+", event.date)
        assert named
        assert all(each in event.quote for each in (*named, event.first[:4]))
    if event.why.startswith("part of the work"):
        assert (event.first, event.last) == (EVENTS["work-begins"].first, EVENTS["work-ends"].last)


@pytest.mark.skipif(not THESIS.exists(), reason="the text of the thesis is not beside the project")
def test_every_quotation_is_in_the_thesis_and_no_later_date_or_missing_part() -> None:
    """The Bibliography has no later date than the entry says, and the gaps are gaps."""
    text = THESIS.read_text()
    words = " ".join(text.split())
    for event in EVENTS.values():
        assert event.quote in words, event.id
    assert [each.id for each in EVENTS.values() if not each.quote] == ["scan"]
    named = {int(year) for year in re.findall(r"\b(19[78]\d)\b(?!-)", text)}
    assert max(named - {1981, 1982}) == 1980
    assert re.findall(r"\b19(?:81|82)\b(?!-)", text) == ["1982", "1981", "1981", "1981"]
    for missing in ("1473", "DTIC", "AFWAL-TR", "Vita", "VITA", "Approved by"):
        assert missing not in text
    assert "his help in the base computing system" in words
    assert len(facts("timeline")["gap"]) == 7


def test_dates_in_words() -> None:
    assert Event("a", "", "", "certain", "1980-03", "1980-04").date == "March to April 1980"
    turn = Event("a", "", "", "certain", "1979-12", "1980-01")
    assert turn.date == "December 1979 to January 1980"
    assert EVENTS["rechecked"].date == "between January 1979 and April 1981"
    assert EVENTS["scan"].date == "not dated"
    # Home page, README and documents take their dates from `account.toml`.
    work = facts("account")["work"]
    for name in ("began", "ended", "submitted", "published"):
        event = {"began": "work-begins", "ended": "work-ends"}.get(name, name)
        assert EVENTS[event].date == work[name]
    assert EVENTS["manuscript"].last == EVENTS["submitted"].first
