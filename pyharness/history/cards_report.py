"""The reports of `cards`: each card with its lines in scan, Fortran port and twin."""

import textwrap
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from typing import Any

from pyharness.history.text_digest import text_digest
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Column, Field, Line, Report, Section, Table, counted, words
from pyharness.model.report import numbers as columns
from pyharness.thesis.cards import Card, Place, deck, parallels
from pyharness.thesis.cards import numbers as cards_named

_CLASSES = (
    *words("class"), Column("entries"), Column("flags"), Column("two-term"), Column("four-term"),
    Column("runge-kutta"), Column("places"),
)  # fmt: skip
_CLASSES_NAMES = [each.head for each in _CLASSES]
_HALF = 48  # width, in characters, of each of two texts printed side by side


def cards_report(cards: Sequence[Card], title: str = "cards") -> Report:
    """Return the report of `cards`, each with its lines in scan, port and twin, and its entries."""
    rows = [
        [each.program, each.number, each.statement, each.scan, " ".join(each.entries)]
        for each in cards
    ]
    return Report(
        title,
        [_block(each) for each in cards],
        record=lambda: {"cards": [card_record(each) for each in cards]},
        data=columns("program card statement scan entries", rows),
    )


def card_record(card: Card) -> dict[str, Any]:
    """Return a card as a JSON record, with its lines in Fortran and Python.

    `scan` is null where the scan agrees with our text, and empty where it lacks the card.
    """
    found = deck(card.program)
    scan = (card.scan or "") if card.deviates else None
    return {
        "program": card.program,
        "card": card.number,
        "statement": card.statement,
        "scan": scan,
        "differences": [each._asdict() for each in card.differences],
        "entries": list(card.entries),
        "fortran": [each._asdict() for each in found.port.get(card.number, [])],
        "twin": [each._asdict() for each in found.twin.get(card.number, [])],
        "absent": found.absent.get(card.number),
        "parallels": [each.name for each in parallels(card)],
    }


def scan_report(
    faults: Sequence[str], undeclared: Sequence[str], lines: int, digest: str
) -> Report:
    """Return the report on whether our text of the programs explains every line of a scan.

    `faults` are unexplained lines, `undeclared` disagreements of cards and apparatus.
    """
    cards = [card for program in PROGRAMS for card in deck(program).cards.values()]
    deviating = sum(bool(each.differences or each.lost) for each in cards)
    pairs = sum(len(each.differences) for each in cards)
    lost = sum(each.lost is not None for each in cards)
    told = (
        f"{counted(len(cards), 'card')}, {lost} of them lost; {deviating} deviate in their text, "
        f"in {pairs} places, {sum(each.printed is not None for each in cards)} in their number; "
        f"the scan has {counted(lines, 'line')}"
    )
    (read,) = (each["sha256"] for each in facts("cards/scan")["witness"])
    told += (
        "; it is " + ("the text that was read" if digest == read else "another text") + " (SHA-256)"
    )
    end = "nothing is unexplained" if not (faults or undeclared) else (
        f"{len(faults) + len(undeclared)} unexplained"
    )  # fmt: skip
    return Report(
        "cards",
        [[told], [*faults, *undeclared], [end]],
        record=lambda: {
            "lines": lines, "cards": len(cards), "lost": lost, "deviating": deviating,
            "differences": pairs, "sha256": digest, "unexplained": [*faults, *undeclared],
        },
        data=columns("unexplained", [[each] for each in (*faults, *undeclared)]),
    )  # fmt: skip


def classes_report() -> Report:
    """Return the report of the numbers of apparatus entries and of their cards, by kind."""
    entries = facts("apparatus")["entry"]
    rows = []
    for kind in dict.fromkeys(each["kind"] for each in entries):
        of_kind = [each for each in entries if each["kind"] == kind]
        named = [
            len({n for each in of_kind for n in cards_named(each["cards"].get(program, ""))})
            for program in PROGRAMS
        ]
        places = sum(
            each.entry in {entry["id"] for entry in of_kind}
            for program in PROGRAMS
            for card in deck(program).cards.values()
            for each in card.differences
        )
        rows.append([kind, len(of_kind), sum("flag" in each for each in of_kind), *named, places])
    sure = [
        [certainty, sum(each["certainty"] == certainty for each in entries)]
        for certainty in dict.fromkeys(each["certainty"] for each in entries)
    ]
    table = Table(_CLASSES, rows)
    edition = facts("cards/scan")
    head = [Field(f"{each['siglum']}  ", each["what"]) for each in edition["witness"]]
    grounds = [Field(f"{each['siglum']}  ", each["what"]) for each in edition["ground"]]
    principles = [Field(f"{name:12s}", f"{text}") for name, text in edition["principles"].items()]
    told = ", ".join(f"{number} {certainty}" for certainty, number in sure)
    return Report(
        "cards",
        [
            ["witness:", *head], ["grounds of the entries:", *grounds], principles, [table],
            [f"{len(entries)} entries: {told}; text {text_digest()}"],
        ],
        record=lambda: {
            "classes": [dict(zip(_CLASSES_NAMES, row, strict=True)) for row in rows],
            "certainty": dict(sure), "witnesses": edition["witness"],
            "grounds": edition["ground"],
            "principles": edition["principles"], "text": text_digest(),
        },
        data=table,
    )  # fmt: skip


def _block(card: Card) -> Section:
    found = deck(card.program)
    ours, scan = card.text[5 if card.continues else 0 :].strip(), card.scan
    shown = "lost" if scan is None else scan if card.deviates else "as the card"
    absent = found.absent.get(card.number)
    missing = "-" if absent is None else f"none: {absent}"
    left = [*_named("card", [ours]), *_named("scan", [shown])]
    right = [
        *_named("port", _texts_of(found.port.get(card.number, [])) or [missing]),
        *_named("twin", _texts_of(found.twin.get(card.number, [])) or [missing]),
    ]
    pairs = zip_longest(left, right, fillvalue="")
    lines = [Line(f"{a.ljust(_HALF)}   {b}".rstrip()) for a, b in pairs]
    entries = [each for each in facts("apparatus")["entry"] if each["id"] in card.entries]
    told = [
        Field(f"  {each['id']}: ", f"{each['kind']}, {each['certainty']}: {each['why']}")
        for each in entries
    ]
    beside = ", ".join(each.name for each in parallels(card))
    return [
        Line(f"{card.program} {card.number}" + (f"   (parallel: {beside})" if beside else "")),
        *lines,
        *told,
    ]


def _texts_of(places: Iterable[Place]) -> list[str]:
    return [f"{each.file}:{each.line} {each.text}" for each in places]


def _named(name: str, texts: Iterable[str]) -> list[str]:
    lines = [line for text in texts for line in textwrap.wrap(text, _HALF - 6)]
    return [f"{name if not k else '':6s}{line}" for k, line in enumerate(lines)]
