"""The history of the text: the newest revision is the present text, and no entry is forgotten."""

import re
from datetime import date
from xml.etree import ElementTree as xml

from docs.text.page import text_page
from pyharness.history.identifiers import text_digest
from pyharness.history.tei import tei_document
from pyharness.history.timeline import CHANGES, revisions
from pyharness.model.facts import facts
from pyharness.thesis.cards import deck, numbers

TEI = "{http://www.tei-c.org/ns/1.0}"


def test_revisions_are_in_the_order_of_time_and_each_has_a_text_of_its_own() -> None:
    dates = [date.fromisoformat(each.date) for each in revisions()]
    assert dates == sorted(dates, reverse=True)
    digests = [each.digest for each in revisions()]
    known = [each for each in digests if each]
    assert all(re.fullmatch("[0-9a-f]{12}", each) for each in known)
    assert len({*known}) == len(known)
    # Only the oldest texts were not yet data.
    assert not any(digests[len(known) :])
    assert revisions()[0].digest == text_digest(), (
        f'the text has changed: set digest = "{text_digest()}" in a new revision at the beginning '
        "of pyharness/data/revisions.toml"
    )


def test_entries_and_cards_of_all_revisions_are_those_of_the_tables() -> None:
    entries: set[str] = set()
    for each in reversed(revisions()):
        assert each.added or each.changed or each.removed or each.cards
        assert not entries & {*each.added}
        assert entries >= {*each.changed, *each.removed}
        entries = entries - {*each.removed} | {*each.added}
    assert entries == {each["id"] for each in facts("apparatus")["entry"]}
    for each in revisions():
        for program, cards in each.cards.items():
            assert [deck(program).cards[number].number for number in numbers(cards)] == numbers(
                cards
            )
    for program, cards in [each for each in revisions() if each.digest][-1].cards.items():
        assert numbers(cards) == [int(number) for number in facts(f"cards/{program}")["cards"]]


def test_header_of_tei_has_every_revision() -> None:
    described = xml.fromstring(tei_document()).find(f"{TEI}teiHeader/{TEI}revisionDesc")
    assert described is not None
    entries = {row["id"] for row in facts("apparatus")["entry"]}
    for change, each in zip(described, revisions(), strict=True):
        assert (change.get("when"), change.get("who")) == (each.date, "#editors")
        assert (change.text or "").strip() == each.what
        assert [idno.text for idno in change] == ([each.digest] if each.digest else [])
        wanted = {f"#{name}" for name in {*each.added, *each.changed} & entries}
        for program, cards in each.cards.items():
            named = [f"#{program}.{number}" for number in numbers(cards)]
            is_whole = len(named) == len(facts(f"cards/{program}")["cards"])
            wanted |= {f"#{program}"} if is_whole else {*named}
        assert sorted(change.attrib["target"].split()) == sorted(wanted)


def test_page_has_the_newest_revision() -> None:
    page = " ".join(text_page().split())
    newest, *earlier = revisions()
    assert " ".join(f"- **{newest.date}**, digest `{newest.digest}`. {newest.what}".split()) in page
    for name, heading in CHANGES.items():
        if entries := getattr(newest, name):
            listed = ", ".join(f"`{id}`" for id in entries)
            assert f"{heading.capitalize()}: {listed}." in page
    assert f"The {len(earlier)} earlier revisions" in page
