"""An estimate of remaining transcription errors, by capture and recapture.

The first reading of the scan is our text of the cards; the second is of a random sample of cards
(`data/cards/second-reading.toml`). The numbers of errors in the scanned text that each reading and
that both correct give an estimate of the remaining errors.
"""

from collections.abc import Iterator
from difflib import SequenceMatcher
from math import comb
from typing import NamedTuple

from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Column, Report, Table, counted, digits, words
from pyharness.thesis.cards import Card, deck, tight
from pyharness.thesis.collation import witness_lines

_TAIL = 0.025  # probability on each side of a 95 % interval
_COLUMNS = (
    *words("unit"), Column("first"), Column("second"), Column("both"),
    Column("estimate", digits(".1f")), Column("lower"), Column("upper"), Column("uncorrected"),
)  # fmt: skip


class ReadCard(NamedTuple):
    """A card of the sample: its text, without blanks, in the scan and in two readings."""

    card: Card
    scan: str
    first: str  # our text, with variables named as in the scan
    second: str


def chapman(first: int, second: int, both: int) -> float:
    """Return Chapman's estimate of a population from two samples' sizes and common members."""
    return (first + 1) * (second + 1) / (both + 1) - 1


def recapture_interval(first: int, second: int, both: int) -> tuple[int, int]:
    """Return a population's 95 % confidence interval, from arguments as in `chapman`."""
    if both < 1:
        raise ValueError("both must be positive")
    # For sizes in the interval, the hypergeometric probabilities of at most and of at least `both`
    # common members are 0.025 or more.
    least = first + second - both
    lower = least
    while _probability(lower, first, second, 0, both) < _TAIL:
        lower += 1
    upper = lower
    while _probability(upper + 1, first, second, both, min(first, second)) >= _TAIL:
        upper += 1
    return lower, upper


def _probability(size: int, first: int, second: int, begin: int, end: int) -> float:
    ways = sum(
        comb(first, both) * comb(size - first, second - both)
        for both in range(begin, min(end, second) + 1)
    )
    return ways / comb(size, second)


def read_cards() -> Iterator[ReadCard]:
    given = facts("cards/second-reading")
    for program in PROGRAMS:
        for number, text in given[program].items():
            card = deck(program).cards[int(number)]
            assert card.scan is not None
            yield ReadCard(
                card, card.scan.partition("-")[2], tight(card.text_with_scanned_names), tight(text)
            )


def misread_places(scan: str, reading: str) -> dict[int, str]:
    """Return the text of `reading` where it differs from `scan`, by index in `scan`.

    An insertion has the previous index, or -1.
    """
    found: dict[int, str] = {}
    matcher = SequenceMatcher(None, scan, reading, autojunk=False)
    for what, begin, end, first, last in matcher.get_opcodes():
        if what == "insert":
            found[begin - 1] = reading[first:last]
        elif what != "equal":
            for place in range(begin, end):
                at = first + place - begin
                found[place] = reading[at : last if place == end - 1 else min(at + 1, last)]
    return found


def recaptures() -> Table:
    """Return a table of estimates, with characters and with whole cards as units."""
    places: tuple[set[tuple[str, int]], ...] = (set(), set())
    for each in read_cards():
        for found, reading in zip(places, (each.first, each.second), strict=True):
            found |= {(each.card.name, place) for place in misread_places(each.scan, reading)}
    cards = tuple({name for name, _ in found} for found in places)
    rows = []
    # Only cards are nearly independent, because character recognition repeats its misreadings.
    for unit, (one, other) in (("places", places), ("cards", cards)):
        counts = len(one), len(other), len(one & other)
        lower, upper = recapture_interval(*counts)
        rows.append([unit, *counts, chapman(*counts), lower, upper, upper - len(one)])
    return Table(_COLUMNS, rows)


def disagreeing() -> list[ReadCard]:
    return [each for each in read_cards() if each.first != each.second]


def second_reading_report() -> Report:
    table, cards, differing = recaptures(), [*read_cards()], disagreeing()
    frame = len(witness_lines())
    seed = facts("cards/second-reading")["seed"]
    legend = (
        "first, second, both: number of misreadings of the scan in the sample that our text, the "
        "second reading, and both correct. estimate: Chapman's estimate of all misreadings in the "
        "sample. lower, upper: limits of its 95 % interval. uncorrected: upper, without those that "
        "our text corrects."
    )
    told = [f"{x.card.name}: scan {x.scan}; first {x.first}; second {x.second}" for x in differing]
    sample = f"Sample: {len(cards)} of the {frame} cards in the scan, drawn with seed {seed}."
    end = [f"{counted(len(differing), 'card')} read differently:", *told]
    record = {
        "sample": {"seed": seed, "size": len(cards), "cards": frame},
        "recaptures": [dict(zip(table.in_full()[0], row, strict=True)) for row in table.rows],
        "disagreeing": [each._asdict() | {"card": each.card.name} for each in differing],
    }
    return Report("cards", [[sample], [legend], [table], end], lambda: record, table)
