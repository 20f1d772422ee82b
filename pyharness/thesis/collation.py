"""Comparisons of the scan with our text of the cards, and of the three decks with the thesis.

`data/cards/collation.toml` has each operation's cards, and the thesis's statement about the
operation. Whether the decks agree is computed.
"""

import difflib
import re
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

from pyharness.model.errors import InputError
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import chosen, deck, numbers, statements_of, tight

HEADING = "APPENDIX AND PROGRAMS"
_OF_THE_SCAN = ("misreading", "missing text", "normalization")


def expected_lines() -> list[tuple[str, str]]:
    """Return pairs (text without blanks, name) for each expected line of the scanned appendix.

    The name is a card's, ``furniture`` (a heading) or ``phantom`` (text that belongs to no card).
    """
    found = []
    for page in facts("cards/scan")["page"]:
        for item in page["lines"]:
            if isinstance(item, str):
                for card in (deck(page["program"]).cards[number] for number in numbers(item)):
                    assert card.scan is not None
                    found.append((card.scan, card.name))
            else:
                kind = "furniture" if "furniture" in item else "phantom"
                found.append((tight(item[kind]), kind))
    return found


@cache
def witness_lines() -> dict[str, str]:
    """Return each card's line in the scan, with blanks, by the card's name.

    Callers must not change the dictionary.
    """
    blanks = facts("cards/blanks")
    found = {}
    for text, name in expected_lines():
        program, _, number = name.partition(":")
        if number:
            places = [0, *blanks[program][number], len(text)]
            found[name] = " ".join(text[begin:end] for begin, end in pairwise(places))
    return found


def unexplained(scan: str) -> list[str]:
    """Return a sentence for each line of a scan that disagrees with `expected_lines`."""
    _, heading, appendix = scan.rpartition(HEADING)
    if not heading or not re.search(r"^\s*\d+-", appendix, re.MULTILINE):
        raise InputError(
            f"the scan has no line '{HEADING}' with cards after it; give a scan of this thesis"
        )
    first = scan.count("\n", 0, len(scan) - len(appendix)) + 1
    lines = [(n, tight(text)) for n, text in enumerate(appendix.split("\n"), first)]
    lines = [(n, text) for n, text in lines if text not in ("", "```")]
    expected = expected_lines()
    found, wanted = [text for _, text in lines], [text for text, _ in expected]
    if len(found) == len(wanted):
        pairs = zip(lines, expected, strict=True)
        return [
            f"line {n}, {name}: {text!r}, where the table has {want!r}"
            for (n, text), (want, name) in pairs
            if text != want
        ]
    faults = []
    matcher = difflib.SequenceMatcher(None, wanted, found, autojunk=False)
    for what, i, j, k, m in matcher.get_opcodes():
        if what != "equal":
            faults += [f"line {n}: {text!r} is in no table" for n, text in lines[k:m]]
            faults += [f"{name}: {text!r} is not in the scan" for text, name in expected[i:j]]
    return faults


def undeclared() -> list[str]:
    """Return a sentence for each deviation of the scan on which cards and apparatus disagree."""
    used: set[tuple[Any, ...]] = set()
    for card in chosen(()):
        place = card.program, card.number
        used |= {(each.entry, *place, each.ours, each.scans) for each in card.differences}
        if card.printed:
            shown, entry = card.printed
            used.add((entry, *place, str(card.number), shown))
    declared: set[tuple[Any, ...]] = set()
    for entry in facts("apparatus")["entry"]:
        for ours, scans, cards in entry.get("pairs", ()):
            for program, ranges in cards.items():
                declared |= {(entry["id"], program, n, ours, scans) for n in numbers(ranges)}
        for program, ranges, first, step in entry.get("printed", ()):
            for index, number in enumerate(numbers(ranges)):
                shown = str(first + step * index)
                declared.add((entry["id"], program, number, str(number), shown))
    faults = [
        f"{program}:{number} {ours!r} read {scans!r}: {entry} does not declare it"
        for entry, program, number, ours, scans in sorted(used - declared)
    ]
    faults += [
        f"{entry} declares {ours!r} read {scans!r} of {program}:{number}: the card does not have it"
        for entry, program, number, ours, scans in sorted(declared - used)
    ]
    names = {each["id"]: each for each in facts("apparatus")["entry"]}
    for card in chosen(()):
        if card.lost and names.get(card.lost, {}).get("kind") != "missing text":
            faults.append(f"{card.name} is lost by {card.lost}: no entry of missing text")
        if not (card.lost or card.scan):
            faults.append(f"{card.name}: neither in the scan nor lost")
    return faults


class Row(NamedTuple):
    """A comparison of the decks and the thesis in an operation (`what`) of the programs."""

    what: str
    cards: dict[str, str]  # numbers by program, as in 750-770, 800
    # "agree", "names" (only names differ), "order" (order, too), "differ", or "-" (no cards).
    decks: str
    thesis: str  # "agrees" with the decks, "differs" or "silent"
    text: str  # place in the thesis
    says: str  # statement at this place
    entries: tuple[str, ...]  # apparatus entries that explain a disagreement
    reason: str  # explanation if there is no entry

    @property
    def is_explained(self) -> bool:
        agrees = self.decks == "agree" and len(self.cards) == len(PROGRAMS)
        return (agrees and self.thesis == "agrees") or bool(self.entries or self.reason)


def rows() -> list[Row]:
    found = []
    for given in facts("cards/collation")["row"]:
        thesis = ("agrees" if given["agrees"] else "differs") if "text" in given else "silent"
        found.append(
            Row(
                given["what"], given["cards"], _decks(given), thesis, given.get("text", ""),
                given.get("says", ""), tuple(given.get("entries", ())), given.get("reason", ""),
            )
        )  # fmt: skip
    return found


def faults(found: list[Row]) -> list[str]:
    """Return a sentence for each mistake or unexplained disagreement in `found`."""
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
    """Return the statements on a program's `cards`, without blanks, labels or comments."""
    texts = (deck(program).cards[number].text for number in numbers(cards))
    return [text for _, text in statements_of(texts)]


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
    """Return a statement with replaced names; ``A=A1 B=B1`` replaces A by A1 and B by B1."""
    changes = dict(each.split("=") for each in names.split())
    return re.sub(r"[A-Z][A-Z0-9]*", lambda name: changes.get(name[0], name[0]), statement)


def names_a_card(entry: dict[str, Any], cards: Mapping[str, Iterable[int]]) -> bool:
    return not entry["cards"] or any(
        set(numbers(entry["cards"].get(program, ""))) & set(named)
        for program, named in cards.items()
    )
