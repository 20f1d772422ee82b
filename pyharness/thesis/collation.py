"""Checks that the scan, our text of the cards and the critical apparatus agree."""

import difflib
import re
from functools import cache
from itertools import pairwise
from typing import Any

from pyharness.model.errors import InputError
from pyharness.model.facts import facts
from pyharness.thesis.cards import chosen, deck, numbers, tight

HEADING = "APPENDIX AND PROGRAMS"


def expected_lines() -> list[tuple[str, str]]:
    """Return the lines that our tables expect in the appendix, as pairs (text, name).

    The text has no blanks. The name is a card's, as in ``two-term:1660``, ``furniture`` for a line
    that an editor added, or ``phantom`` for text that belongs to no card at its place.
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
    """Return the scan's line of each card by the card's name, with the scan's blanks.

    The blanks are from `data/cards/blanks.toml`. Callers must not change the dictionary.
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
    """Return a sentence for each line in which a scan of the thesis disagrees with our tables.

    Raise InputError if the text has no appendix.
    """
    _, heading, appendix = scan.rpartition(HEADING)
    if not heading or not re.search(r"^\s*\d+-", appendix, re.MULTILINE):
        raise InputError(
            f"the scan has no line {HEADING!r} with cards after it, so that it is not a scan "
            "of this thesis; give another file"
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
    """Return a sentence for each disagreement between the cards and the apparatus.

    Each deviation must name an entry that declares it, and each declared deviation must exist. A
    lost card must name an entry of the kind ``missing text``.
    """
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
