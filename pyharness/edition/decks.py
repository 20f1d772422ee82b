"""The data of the listing's pages: each card with its scan, port, twin and apparatus entries.

The port is the program in Fortran of today, and the twin is the program in Python. An entry of the
critical apparatus explains, for example, a defect, or a difference between a card and the scan.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from pyharness.history.ablation import entries
from pyharness.original.cards import Card, Place, deck, parallels, tight

# Kinds of apparatus entries by precedence: a card with entries of several kinds has the colour of
# the first one.
_ORDER = (
    "defect", "reading", "conjecture", "missing text", "unreachable", "unread", "redundant",
    "dialect", "normalization", "misreading",
)  # fmt: skip


class Run(NamedTuple):
    """A run of consecutive characters of a card, or of the line of the scan that shows the card.

    `entry` is the apparatus entry that explains why card and scan differ in these characters. It is
    None if they agree.
    """

    text: str
    entry: str | None = None


class CardView(NamedTuple):
    """A card as a page shows it, with its line of the scan and its apparatus entries.

    `card` is the text of the card and `scan` the line of the scan, which is None if the scan lacks
    the card. `port` and `twin` are the card's lines in the Fortran port and the Python twin.
    `absent` is the reason why the port has no statement for the card, and `otherwise` the reason
    why its statement is different. `parallels` are the cards of other decks with the same text.
    """

    number: int
    card: list[Run]
    scan: list[Run] | None
    port: list[Place]
    twin: list[Place]
    entries: list[dict[str, Any]]
    kinds: list[str]  # the first gives the colour
    absent: str | None
    otherwise: str | None
    parallels: list[Card]


def card_views(program: str) -> list[CardView]:
    """Return the views of a program's cards, in the order of the cards."""
    by_name = {each["id"]: each for each in entries()}
    found = deck(program)
    return [
        CardView(
            card.number,
            [Run(text, each and each.entry) for text, each in card.passages()],
            _scan(card),
            found.port.get(card.number, []),
            found.twin.get(card.number, []),
            [by_name[name] for name in card.entries],
            _kinds([by_name[name]["kind"] for name in card.entries]),
            found.absent.get(card.number),
            found.otherwise.get(card.number),
            parallels(card),
        )
        for card in found.cards.values()
    ]


def kinds_of(views: Iterable[CardView]) -> dict[str, int]:
    """Return the number of cards for each kind of apparatus entry, in the kinds' precedence."""
    counts = dict.fromkeys(_ORDER, 0)
    for view in views:
        for kind in view.kinds:
            counts[kind] += 1
    return {kind: count for kind, count in counts.items() if count}


def _scan(card: Card) -> list[Run] | None:
    """Return the line of the scan that shows a card, as runs: number, dash and text.

    Return None if the scan lacks the card.
    """
    if card.lost:
        return None
    number = Run(*card.printed) if card.printed else Run(str(card.number))
    shown = (
        Run(each.scans, each.entry) if each else Run(tight(text)) for text, each in card.passages()
    )
    return [number, Run("-"), *shown]


def _kinds(found: Iterable[str]) -> list[str]:
    return sorted(set(found), key=_ORDER.index)
