"""The cards of the three programs, in our text and in the scan of the thesis.

A card is a line of a printed program, a deck all cards of a program. `data/cards` has the decks,
the scan's pages, and each card's lines in the Python port (the twin). A line of the scan has card
number, dash and text; blanks are ignored. `data/apparatus.toml`, the critical apparatus, explains
deviations of the scan.
"""

import re
from collections.abc import Iterable, Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple

from pyharness.model.errors import InputError, unknown
from pyharness.model.facts import facts, shipped
from pyharness.model.listing import PROGRAMS

_SPECIFICATION = re.compile(r"PROGRAM |DIMENSION |REAL |FORMAT\(|END$")
_MARGIN = re.compile(r"^(.*?)\s*!\s*(\d+(?:[-,\s]+\d+)*)\s*$")
_TWINS = Path(__file__).parent
PORT = "fortran/original"
"""Folder of the Fortran port in the source repository."""


class Difference(NamedTuple):
    """A passage of a card, without blanks, that differs between our text and the scan.

    The apparatus entry `entry` explains it.
    """

    ours: str
    scans: str
    entry: str


class Place(NamedTuple):
    """A line of a source file, with its number from 1."""

    file: str
    line: int
    text: str


class Card(NamedTuple):
    """A card of a printed program, and its appearance in the scan."""

    program: str
    number: int
    text: str  # our text of columns 1 to 72
    differences: tuple[Difference, ...] = ()  # from left to right
    printed: tuple[str, str] | None = None  # other number in the scan, and its apparatus entry
    lost: str | None = None  # apparatus entry if the scan lacks the card

    @property
    def name(self) -> str:
        return f"{self.program}:{self.number}"

    @property
    def statement(self) -> str:
        return " ".join(self.text.split())

    @property
    def is_comment(self) -> bool:
        return self.text.startswith("C")

    @property
    def continues(self) -> bool:
        return not self.is_comment and self.text[5:6].strip() != ""

    @property
    def scan(self) -> str | None:
        """The card's line in the scan, without blanks, or None if the scan lacks it."""
        if self.lost:
            return None
        number = self.printed[0] if self.printed else str(self.number)
        shown = (each.scans if each else tight(text) for text, each in self.passages())
        return f"{number}-{''.join(shown)}"

    def passages(self) -> Iterator[tuple[str, Difference | None]]:
        """Yield each passage of the text, with its difference from the scan or None."""
        places = [n for n, letter in enumerate(self.text) if not letter.isspace()]
        letters = tight(self.text)
        done = at = 0
        for each in self.differences:
            # A difference begins where its text first occurs after the previous difference.
            first = letters.find(each.ours, at)
            if first < 0:
                raise ValueError(f"{each.ours!r} does not stand in {self.text!r} where it should")
            at = first + len(each.ours)
            begin, end = places[first], places[at - 1] + 1
            if done < begin:
                yield self.text[done:begin], None
            yield self.text[begin:end], each
            done = end
        if self.text[done:]:
            yield self.text[done:], None

    @property
    def text_with_scanned_names(self) -> str:
        """Our text, but with the scan's names of variables where we normalise them."""
        kinds = {each["id"]: each["kind"] for each in facts("apparatus")["entry"]}
        return "".join(
            each.scans if each and kinds[each.entry] == "normalization" else text
            for text, each in self.passages()
        )

    @property
    def deviates(self) -> bool:
        return bool(self.lost or self.printed or self.differences)

    @property
    def entries(self) -> tuple[str, ...]:
        return tuple(
            each["id"]
            for each in facts("apparatus")["entry"]
            if self.number in numbers(each["cards"].get(self.program, ""))
        )


class Deck:
    def __init__(self, program: str) -> None:
        self.program = program
        self._places = facts("cards/places")[program]
        self.cards = {
            int(number): Card(
                program,
                int(number),
                row["text"],
                tuple(Difference(*each) for each in row.get("scan", ())),
                tuple(row["printed"]) if "printed" in row else None,
                row.get("lost"),
            )
            for number, row in facts(f"cards/{program}")["cards"].items()
        }

    @cached_property
    def executable(self) -> frozenset[int]:
        found, computes = set(), False
        for card in self.cards.values():
            if not card.continues:
                computes = not (card.is_comment or _SPECIFICATION.match(card.text[6:]))
            if computes:
                found.add(card.number)
        return frozenset(found)

    def statement_kind(self, card: Card) -> str:
        if card.is_comment:
            return "comment"
        return "executable" if card.number in self.executable else "specification"

    @cached_property
    def absent(self) -> dict[int, str]:
        """Reasons why the Fortran port omits cards, by card number."""
        return {n: why for cards, why in self._places["absent"] for n in numbers(cards)}

    @cached_property
    def otherwise(self) -> dict[int, str]:
        """Reasons why the Fortran port changes the form of statements, by card number."""
        return {n: why for cards, why in self._places["otherwise"] for n in numbers(cards)}

    @cached_property
    def port(self) -> dict[int, list[Place]]:
        file = port_file(self.program)
        lines = enumerate(_lines(shipped(PORT) / file), 1)
        found = ((number, match) for number, text in lines if (match := _MARGIN.match(text)))
        return _by_card((match[2], Place(file, n, match[1].strip())) for n, match in found)

    @cached_property
    def twin(self) -> dict[int, list[Place]]:
        places = self._places["twin"]
        return _by_card((cards, twin_line(file, text)) for cards, file, text in places)


@cache
def deck(program: str) -> Deck:
    """Return a program's deck, which callers must not change."""
    return Deck(program)


def statements_of(texts: Iterable[str]) -> list[list[str]]:
    """Return [label, text] of each statement on cards with `texts`, without blanks."""
    found: list[list[str]] = []
    for text in texts:
        if text.startswith("C"):
            continue
        if text[5:6].strip():
            found[-1][1] += tight(text[6:72])
        else:
            found.append([text[:5].strip(), tight(text[6:72])])
    return found


def numbers(ranges: str) -> list[int]:
    """Return the card numbers in a text; ``750-770, 800`` gives 750, 760, 770 and 800."""
    found: list[int] = []
    for each in ranges.split(",") if ranges else ():
        first, _, last = each.strip().partition("-")
        found += range(int(first), int(last or first) + 1, 10)
    return found


def chosen(asked: Iterable[str]) -> list[Card]:
    """Return the cards that `asked` names, by default all.

    Names are as in ``two-term``, ``two-term:1660``, ``1660`` or ``1040-1090``.
    """
    every = (card for each in list(asked) or PROGRAMS for card in _cards_of(each))
    return list(dict.fromkeys(every))


def parallels(card: Card) -> list[Card]:
    """Return the cards of other programs with equal text."""
    if card.is_comment or not card.text[6:].strip():
        return []
    same_text = _by_text().get(tight(card.text), [])
    return [other for other in same_text if other.program != card.program]


@cache
def _by_text() -> dict[str, list[Card]]:
    found: dict[str, list[Card]] = {}
    for card in (card for program in PROGRAMS for card in deck(program).cards.values()):
        found.setdefault(tight(card.text), []).append(card)
    return found


def _cards_of(asked: str) -> list[Card]:
    program, colon, ranges = asked.rpartition(":")
    if asked in PROGRAMS:
        return list(deck(asked).cards.values())
    if colon and program not in PROGRAMS:
        raise unknown("program", program, PROGRAMS, f"cards {asked!r}")
    programs = (program,) if colon else PROGRAMS
    if not (match := re.fullmatch(r"([0-9]{1,6})(?:-([0-9]{1,6}))?", ranges)):
        raise InputError(
            f"cards {asked!r}: neither a program ({', '.join(PROGRAMS)}) nor a card or a range of "
            "cards, as 1660, 1040-1090, two-term:1660"
        )
    first, last = int(match[1]), int(match[2] or match[1])
    every = [card for each in programs for card in deck(each).cards.values()]
    found = [card for card in every if first <= card.number <= last]
    if not found and match[2] is None:
        near = sorted(every, key=lambda card: abs(card.number - first))[:2]
        told = " and ".join(card.name for card in sorted(near, key=lambda card: card.number))
        raise InputError(f"card {first}: there is no such card; the nearest are {told}")
    if not found:
        ends = ", ".join(
            f"{each} {min(c)}-{max(c)}" for each in programs for c in [deck(each).cards]
        )
        raise InputError(f"cards {asked!r}: the range is empty; the decks have {ends}")
    return found


def _by_card(places: Iterable[tuple[str, Place]]) -> dict[int, list[Place]]:
    found: dict[int, list[Place]] = {}
    for cards, place in places:
        for number in numbers(cards):
            found.setdefault(number, []).append(place)
    return found


def tight(text: str) -> str:
    return "".join(text.split())


def port_file(program: str) -> str:
    return f"{program.replace('-', '_')}.fypp"


def switch_at(place: Place) -> tuple[str, bool] | None:
    """Return the defect or reading on which a Fortran line depends, and whether it must be active.

    Return None if the line does not depend on one.
    """
    # Seek the innermost `if` around the line that tests only a defect or reading.
    lines = _lines(shipped(PORT) / place.file)
    depth = _indentation(lines[place.line - 1])
    beyond_else = False
    for line in filter(str.strip, reversed(lines[: place.line - 1])):
        text, here = line.strip(), _indentation(line)
        # `line` opens a block around the place, or the branch before the `else` around the place.
        if here < depth or (beyond_else and here == depth and text.startswith(("if ", "else if "))):
            if match := re.fullmatch(r"if \(listing%(\w+)\) then", text):
                return match[1].replace("_", "-"), not beyond_else
            depth, beyond_else = here, text == "else"
    return None


def twin_line(file: str, text: str) -> Place:
    where = [n for n, line in enumerate(_lines(_TWINS / file), 1) if line.strip() == text]
    if len(where) != 1:
        raise ValueError(f"{text!r} occurs {len(where)} times in {file}")
    return Place(file, where[0], text)


@cache
def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def _indentation(line: str) -> int:
    return len(line) - len(line.lstrip())
