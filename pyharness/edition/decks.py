"""The data of the pages that show the listings card by card, with the scan and the ports.

A card has one line of a program. The port is the program in modern Fortran, and the twin is the
program in Python. An entry of the critical apparatus explains, for example, a defect, or a
difference between a card and the scan.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from pyharness.history.ablation import entries
from pyharness.original.cards import Card, Place, deck, parallels, tight

# Kinds of apparatus entries in order of precedence. A card with entries of several kinds has the
# colour of the first of these kinds.
_ORDER = (
    "defect", "reading", "conjecture", "missing text", "unreachable", "unread", "redundant",
    "dialect", "normalization", "misreading",
)  # fmt: skip


class Run(NamedTuple):
    """A run of consecutive characters of a card, or of the line of the scan that shows the card.

    `entry` is the identifier of the record in our apparatus that explains why card and scan differ
    in these characters. It is None if card and scan agree.
    """

    text: str
    entry: str | None = None


class CardView(NamedTuple):
    """A card as a page shows it, with its line of the scan and its apparatus entries.

    An apparatus entry records, for example, a defect, or a difference between card and scan. `card`
    is the text of the card. `scan` is its line in the scan, or None if the scan lacks the card.
    `port` and `twin` are the lines of the Fortran port and of the Python port that correspond to
    the card. `absent` is the reason why the Fortran port has no statement for the card, or None.
    `otherwise` is the reason why the port's statement is different, or None. `parallels` are the
    cards of the other programs with the same text.
    """

    number: int
    card: list[Run]
    scan: list[Run] | None
    port: list[Place]
    twin: list[Place]
    entries: list[dict[str, Any]]
    kinds: list[str]  # kinds of the entries by precedence; the first determines the colour
    absent: str | None
    otherwise: str | None
    parallels: list[Card]


def card_views(program: str) -> list[CardView]:
    """Return a view of each card of a program, in the order of the cards.

    A view has the card, its line of the scan, and the corresponding lines of the ports, as a page
    shows them. `program` is the name of the program.
    """
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
    """Return the number of cards that have an apparatus entry of a kind, for each kind.

    An apparatus entry records, for example, a defect or a doubtful reading of the card. `views` are
    the cards as a page shows them. The kinds are in order of precedence; kinds without cards are
    omitted.
    """
    counts = dict.fromkeys(_ORDER, 0)
    for view in views:
        for kind in view.kinds:
            counts[kind] += 1
    return {kind: count for kind, count in counts.items() if count}


def _scan(card: Card) -> list[Run] | None:
    """Return the line of the scan that shows a card, as runs of characters.

    The runs are the card number, a dash, and one or more runs for the text without blanks. Return
    None if the scan lacks the card.
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
