"""A comparison of the decks with each other and with the thesis's text, operation by operation.

A deck consists of the cards of a program. The text is sections II to V of the thesis. The table
`data/cards/collation.toml` lists the operations of the programs, and what the text states about
them. Whether the decks agree on an operation is computed from their statements.
"""

import re
from typing import Any, NamedTuple

from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.original.cards import deck, numbers, tight

_OF_THE_SCAN = ("misreading", "missing text", "normalization")


class Row(NamedTuple):
    """An operation of the programs, and whether the decks of cards and the thesis agree on it.

    Attributes
    ----------
    what : str
        A description of the operation.
    cards : dict of str to str
        For each program whose deck has the operation, the numbers of its cards, as in
        ``750-770, 800``.
    decks : str
        ``agree`` if all decks that have the operation have the same statements. ``names`` if their
        statements differ only in names, ``order`` if they differ only in names and order, else
        ``differ``. ``-`` if no deck has the operation.
    thesis : str
        Whether the text of the thesis ``agrees`` with the decks or ``differs``; ``silent`` if it
        does not mention the operation.
    text, says : str
        The place in the thesis that mentions the operation, and the statement at this place. Both
        are empty if the thesis is silent.
    entries : tuple of str
        The identifiers of the apparatus entries that explain a disagreement.
    reason : str
        An explanation of a disagreement that is not in the apparatus.
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
        """Return whether decks and thesis agree on the operation, or the row explains why not.

        A deck contains the cards of a program. Decks and thesis agree if all three decks have the
        same statements, and the thesis agrees with them.
        """
        agrees = self.decks == "agree" and len(self.cards) == len(PROGRAMS)
        return (agrees and self.thesis == "agrees") or bool(self.entries or self.reason)


def rows() -> list[Row]:
    """Return the rows of the table that compares the decks of cards with the thesis's text.

    Each row is for one operation of the programs. The rows have the order of the operations in the
    decks.
    """
    return [_row(each) for each in facts("cards/collation")["row"]]


def faults(found: list[Row]) -> list[str]:
    """Return one sentence for each mistake or unexplained disagreement in the table `found`.

    The rows of the table compare the cards (lines) of the programs with the text of the thesis.
    They name entries of the critical apparatus that explain disagreements. An entry is a mistake if
    it is unknown, is in no row, or names no card of its row. A card is a mistake if it is unknown,
    in no row, or in two rows.
    """
    told = [f"{row.what}: no entry or reason" for row in found if not row.is_explained]
    known = {entry["id"]: entry for entry in facts("apparatus")["entry"]}
    for row in found:
        told += [f"{row.what}: no entry {name!r}" for name in row.entries if name not in known]
        told += [
            f"{row.what}: {name} names none of its cards"
            for name in row.entries
            if name in known and not _names_a_card(known[name], row)
        ]
    for program in PROGRAMS:
        named = [n for row in found for n in numbers(row.cards.get(program, ""))]
        wanted = [n for n, card in deck(program).cards.items() if not card.is_comment]
        told += [f"{program}:{n} is in no row" for n in wanted if n not in named]
        told += [f"{program}:{n} is in two rows" for n in wanted if named.count(n) > 1]
        comments = sorted(set(named) - set(wanted) - _comments(program))
        told += [f"{program}:{n} is no card" for n in comments]
    explaining = {name for row in found for name in row.entries}
    told += [
        f"{name}: in no row"
        for name, entry in known.items()
        if entry["cards"] and entry["kind"] not in _OF_THE_SCAN and name not in explaining
    ]
    return told


def statements(program: str, cards: str) -> list[str]:
    """Return the statements on some cards of a program, without blanks, labels and comments.

    `cards` contains the numbers of the cards as text, as in ``750-770, 800``.
    """
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
    """Return whether the decks that have an operation have the same statements.

    The result is ``agree``, ``names`` (only names differ), ``order`` (only names and order differ),
    ``differ``, or ``-`` if no deck has the operation. `given` is the operation's row in
    `data/cards/collation.toml`.
    """
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
    """Return a FORTRAN statement with some names replaced.

    `names` lists the old and the new name of each replacement, as in ``A=A1 B=B1``.
    """
    changes = dict(each.split("=") for each in names.split())
    return re.sub(r"[A-Z][A-Z0-9]*", lambda name: changes.get(name[0], name[0]), statement)


def _names_a_card(entry: dict[str, Any], row: Row) -> bool:
    """Return whether an entry of the critical apparatus names a card of a row, or names no card.

    The critical apparatus explains deviations in the thesis's programs. The row is one of the table
    that compares the programs' cards with the text of the thesis.
    """
    return not entry["cards"] or any(
        set(numbers(entry["cards"].get(program, ""))) & set(numbers(cards))
        for program, cards in row.cards.items()
    )


def _comments(program: str) -> set[int]:
    return {n for n, card in deck(program).cards.items() if card.is_comment}
