"""Comparison of the decks with each other and with the thesis, operation by operation.

`data/cards/collation.toml` lists the operations of the programs, and the statements of sections II
to V about them. Whether the decks agree is computed from their statements.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import deck, numbers, tight

_OF_THE_SCAN = ("misreading", "missing text", "normalization")


class Row(NamedTuple):
    """An operation, and whether the decks and the thesis agree on it.

    `what` names the operation. `cards` has the numbers by program, as in ``750-770, 800``. `decks`
    is ``agree`` if all decks with the operation have the same statements. It is ``names`` if only
    names differ, ``order`` if only names and order, else ``differ``; ``-`` if no deck has it.
    `thesis` is ``agrees``, ``differs`` or ``silent``; `text` is the place in the thesis, and `says`
    its statement. `entries` of the apparatus, or `reason`, explain a disagreement.
    """

    what: str
    cards: dict[str, str]
    decks: str
    thesis: str
    text: str
    says: str
    entries: tuple[str, ...]
    reason: str

    @property
    def is_explained(self) -> bool:
        """Return whether all decks and the thesis agree, or the row explains why not."""
        agrees = self.decks == "agree" and len(self.cards) == len(PROGRAMS)
        return (agrees and self.thesis == "agrees") or bool(self.entries or self.reason)


def rows() -> list[Row]:
    """Return the rows of the comparison, in the order of the operations in the decks."""
    return [_row(each) for each in facts("cards/collation")["row"]]


def faults(found: list[Row]) -> list[str]:
    """Return a sentence for each mistake or unexplained disagreement.

    An apparatus entry must be known, be in a row, and name a card of its row. A card must be known
    and in exactly one row.
    """
    told = [f"{row.what}: no entry or reason" for row in found if not row.is_explained]
    known = {entry["id"]: entry for entry in facts("apparatus")["entry"]}
    for row in found:
        told += [f"{row.what}: no entry {name!r}" for name in row.entries if name not in known]
        cards = {program: numbers(ranges) for program, ranges in row.cards.items()}
        told += [
            f"{row.what}: {name} names none of its cards"
            for name in row.entries
            if name in known and not names_a_card(known[name], cards)
        ]
    for program in PROGRAMS:
        named = [n for row in found for n in numbers(row.cards.get(program, ""))]
        wanted = [n for n, card in deck(program).cards.items() if not card.is_comment]
        told += [f"{program}:{n} is in no row" for n in wanted if n not in named]
        told += [f"{program}:{n} is in two rows" for n in wanted if named.count(n) > 1]
        told += [f"{program}:{n} is no card" for n in sorted(set(named) - set(deck(program).cards))]
    explaining = {name for row in found for name in row.entries}
    told += [
        f"{name}: in no row"
        for name, entry in known.items()
        if entry["cards"] and entry["kind"] not in _OF_THE_SCAN and name not in explaining
    ]
    return told


def statements(program: str, cards: str) -> list[str]:
    """Return the statements on some cards, without blanks, labels and comments."""
    found: list[str] = []
    for number in numbers(cards):
        card = deck(program).cards[number]
        if card.is_comment:
            continue
        if card.continues:
            found[-1] += tight(card.text[6:])
        else:
            found.append(tight(card.text[6:]))
    return found


def _row(given: dict[str, Any]) -> Row:
    cards = given["cards"]
    thesis = "silent"
    if "text" in given:
        thesis = "agrees" if given["agrees"] else "differs"
    return Row(
        given["what"], cards, _decks(given), thesis, given.get("text", ""), given.get("says", ""),
        tuple(given.get("entries", ())), given.get("reason", ""),
    )  # fmt: skip


def _decks(given: dict[str, Any]) -> str:
    found = {program: statements(program, cards) for program, cards in given["cards"].items()}
    if not found:
        return "-"
    if _same(found):
        return "agree"
    renamed = {
        program: [_renamed(each, given.get("names", {}).get(program, "")) for each in texts]
        for program, texts in found.items()
    }
    if _same(renamed):
        return "names"
    if given.get("any_order"):
        ordered = {
            program: sorted(name for each in texts for name in re.split(r"[ ,]|REAL", each))
            for program, texts in renamed.items()
        }
        return "order" if _same(ordered) else "differ"
    return "differ"


def _same(found: dict[str, list[str]]) -> bool:
    first, *others = found.values()
    return all(each == first for each in others)


def _renamed(statement: str, names: str) -> str:
    """Return a statement with names replaced as in ``A=A1 B=B1``."""
    changes = dict(each.split("=") for each in names.split())
    return re.sub(r"[A-Z][A-Z0-9]*", lambda name: changes.get(name[0], name[0]), statement)


def names_a_card(entry: dict[str, Any], cards: Mapping[str, Iterable[int]]) -> bool:
    """Return whether an apparatus entry names one of some cards, or no card at all."""
    return not entry["cards"] or any(
        set(numbers(entry["cards"].get(program, ""))) & set(named)
        for program, named in cards.items()
    )
