"""The data of the pages on the programs, card by card, with scan and ports.

A note is a numbered entry of the apparatus.
"""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import chain
from typing import Any, NamedTuple

from pyharness.history.ablation import effects_of, entries
from pyharness.history.tei import first_card
from pyharness.model.facts import facts
from pyharness.model.listing import names_of
from pyharness.thesis.cards import Card, Place, deck, numbers, switch_at, tight
from pyharness.thesis.collation import witness_lines
from pyharness.thesis.decks import corrected_cards, corrections

TITLES = {
    "two-term": "Two-term collocation",
    "four-term": "Four-term collocation",
    "runge-kutta": "Runge-Kutta",
}
"""Names of the programs in headings."""

# Kinds of entries by precedence; a card's first kind determines its colour.
_ORDER = (
    "defect", "reading", "conjecture", "missing text", "unreachable", "unread", "redundant",
    "dialect", "normalization", "misreading",
)  # fmt: skip


class Run(NamedTuple):
    """Successive characters of a card or of its line in the scan."""

    text: str
    entry: str | None = None  # apparatus entry if card and scan differ here


class Note(NamedTuple):
    """A numbered apparatus entry, and the cards of a program to which it applies."""

    number: int
    entry: dict[str, Any]
    cards: str  # as in ``860-910, 1040-1090``

    @property
    def kind(self) -> str:
        return str(self.entry["kind"])


class Corrected(NamedTuple):
    """The corrected form of a card, with the cards `inserted` after it."""

    text: str | None  # None for a deleted card
    changes: bool  # whether the card is deleted or replaced
    inserted: list[tuple[int, str]]
    defects: list[str]


class CardView(NamedTuple):
    """A card as shown on a page."""

    number: int
    card: list[Run]  # our text, in brackets if the scan lacks the card
    # Our text with the scan's names; None if equal to `card`, "" if the scan lacks the card.
    witness: str | None
    after: list[Run]  # following lines of the scan that belong to no card
    scan: list[Run] | None  # line of the scan
    corrected: Corrected
    # Lines of the Fortran port, each with the defect or reading on which it depends, and whether
    # this must be active.
    port: list[tuple[Place, str | None, bool]]
    notes: list[Note]  # by precedence of their kinds
    begins: list[Note]  # notes on ranges of cards that begin here, each with only this range
    kinds: list[str]  # kinds of the notes, by precedence


class Sheet(NamedTuple):
    """A printed page."""

    number: int
    cards: list[CardView]
    moved: str | None  # apparatus entry if the page is out of place in the scan


def sheets(program: str) -> list[Sheet]:
    """Return a program's pages, in the order of their lowest card numbers."""
    pages = [page for page in facts("cards/scan")["page"] if page["program"] == program]
    found = sorted((first_card(page["lines"]), page.get("moved")) for page in pages)
    ends = [*(first for first, _ in found[1:]), max(deck(program).cards) + 1]
    views = card_views(program)
    return [
        Sheet(number, [each for each in views if first <= each.number < end], moved)
        for number, ((first, moved), end) in enumerate(zip(found, ends, strict=True), 1)
    ]


def notes(program: str) -> list[Note]:
    """Return a program's notes, sorted by kind, size of effect and card."""
    having = [each for each in entries() if each["cards"].get(program)]

    def place(entry: dict[str, Any]) -> tuple[float, ...]:
        changes = (-change for change in _changes(entry["id"], program))
        return (_ORDER.index(entry["kind"]), *changes, numbers(entry["cards"][program])[0])

    having.sort(key=place)
    return [Note(n, each, each["cards"][program]) for n, each in enumerate(having, 1)]


@cache
def _changes(name: str, program: str) -> tuple[float, float]:
    """Return a correction's largest effects on the errors of omega (rad/s) and velocity (m/s)."""
    if name not in names_of("defect", program):
        return 0.0, 0.0
    found = [each for each in effects_of(name) if each.program == program]
    pairs = [(each.original, each.corrected_alone) for each in found]
    omega, velocity = (
        max(_change(*(getattr(each, part) for each in pair)) for pair in pairs)
        for part in ("omega", "velocity")
    )
    return omega, velocity


def _change(one: float, other: float) -> float:
    if math.isfinite(one) and math.isfinite(other):
        return float(f"{abs(one - other):.2e}")
    return math.inf if math.isfinite(one) or math.isfinite(other) else 0.0


def card_views(program: str) -> list[CardView]:
    found, every = deck(program), notes(program)
    corrected, changed = corrected_cards(program), corrections(program)
    phantoms = _phantoms(program)
    views = []
    for n, after in zip(found.cards, [*found.cards, math.inf][1:], strict=True):
        card, text = found.cards[n], corrected.get(n)
        about = [each for each in every if n in numbers(each.cards)]
        about.sort(key=lambda each: _ORDER.index(each.kind))
        ranges = [each._replace(cards=part) for each in about for part in each.cards.split(", ")]
        inserted = [pair for pair in corrected.items() if n < pair[0] < after]
        defects = (changed.get(number, ()) for number in (n, *(number for number, _ in inserted)))
        names = list(dict.fromkeys(chain.from_iterable(defects)))
        own = Corrected(text, text != card.text.rstrip(), inserted, names)
        witness = "" if card.lost else card.text_with_scanned_names
        shown = witness if card.lost or witness != card.text else None
        port = [(place, *(switch_at(place) or (None, True))) for place in found.port.get(n, ())]
        begins = [each for each in ranges if numbers(each.cards)[0] == n]
        kinds = list(dict.fromkeys(each.kind for each in about))
        scan, after_it = _scan(card), phantoms.get(n, [])
        view = CardView(n, _card(card), shown, after_it, scan, own, port, about, begins, kinds)
        views.append(view)
    return views


def kinds_of(views: Iterable[CardView]) -> dict[str, int]:
    counts = Counter(kind for view in views for kind in view.kinds)
    return {kind: counts[kind] for kind in _ORDER if counts[kind]}


def _card(card: Card) -> list[Run]:
    if card.lost:
        statement = card.text.lstrip()
        # The bracket replaces a blank, to keep the statement's columns.
        blanks = card.text[: max(len(card.text) - len(statement) - 1, 0)]
        return [Run(f"{blanks}[{statement}]")]
    return [Run(text, each and each.entry) for text, each in card.passages()]


def _phantoms(program: str) -> dict[int, list[Run]]:
    """Return the scan's lines that belong to no card, by the preceding card's number."""
    found: dict[int, list[Run]] = {}
    for page in facts("cards/scan")["page"]:
        for each in page["lines"] if page["program"] == program else ():
            if isinstance(each, str):
                last = numbers(each)[-1]
            elif "phantom" in each:
                found.setdefault(last, []).append(Run(each["phantom"], each["entry"]))
    return found


def _scan(card: Card) -> list[Run] | None:
    if card.lost:
        return None
    number = Run(*card.printed) if card.printed else Run(str(card.number))
    shown = (
        Run(each.scans, each.entry) if each else Run(tight(text)) for text, each in card.passages()
    )
    return _with_blanks([number, Run("-"), *shown], witness_lines()[card.name])


def _with_blanks(runs: Sequence[Run], line: str) -> list[Run]:
    """Return runs with the blanks of `line`, which otherwise has the same characters."""
    found, at = [], 0
    for run in runs:
        begin, missing = at, len(run.text)
        while missing:
            missing -= not line[at].isspace()
            at += 1
        blanks = len(line[begin:at]) - len(line[begin:at].lstrip())
        found += [Run(line[begin : begin + blanks])] if blanks else []
        found.append(Run(line[begin + blanks : at], run.entry))
    return found
