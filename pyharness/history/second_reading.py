"""An estimate of the transcription errors that remain, by capture and recapture.

Two readings of the scan correct its misread characters. The first reading is our text of the cards.
The second reading is a random sample of cards that were read again from the scan
(`data/cards/second-reading.toml`). The misreadings that both readings correct, and those that only
one of them corrects, give an estimate of the misreadings that neither of them corrects.
"""

import random
from collections.abc import Iterator
from difflib import SequenceMatcher
from math import comb
from typing import NamedTuple

from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Column, Report, Table, counted, digits, words
from pyharness.model.report import numbers as columns
from pyharness.original.cards import Card, chosen, deck, tight
from pyharness.original.collation import witness_lines

_TAIL = 0.025  # probability beyond each end of a 95 % interval
_COLUMNS = (
    *words("unit"), Column("first"), Column("second"), Column("both"),
    Column("estimate", digits(".1f")), Column("lower"), Column("upper"), Column("uncorrected"),
)  # fmt: skip


class ReadCard(NamedTuple):
    """A card of the sample as the scan, the first reading and the second reading have it.

    The texts are without blanks and without the card number. The first reading keeps the names that
    our text of the cards makes uniform.
    """

    card: Card
    scan: str
    first: str
    second: str


class Recapture(NamedTuple):
    """The estimated number of misreadings in the sample, from two readings.

    Attributes
    ----------
    unit : str
        The unit of the counts: ``places`` (characters of the scan) or ``cards``.
    first, second, both : int
        Numbers of misreadings that the first, the second, and both readings correct.
    estimate : float
        Chapman's estimate of the number of all misreadings.
    lower, upper : int
        Limits of the 95 % confidence interval of the number of all misreadings.
    """

    unit: str
    first: int
    second: int
    both: int
    estimate: float
    lower: int
    upper: int

    @property
    def uncorrected(self) -> int:
        """Return the upper limit of the number of misreadings that our text does not correct."""
        return self.upper - self.first


def chapman(first: int, second: int, both: int) -> float:
    """Return Chapman's estimate of the size of a population.

    It is the estimate of Lincoln and Petersen, ``first * second / both``, with a correction for
    small samples. A first sample has `first` members of the population, a second sample has
    `second`, and `both` members are in both samples.
    """
    return (first + 1) * (second + 1) / (both + 1) - 1


def recapture_interval(first: int, second: int, both: int) -> tuple[int, int]:
    """Return the limits of the 95 % confidence interval of the size of a population.

    The arguments are those of `chapman`. If two samples are independent, the number of members in
    both has a hypergeometric distribution. A size is in the interval if neither tail of this
    distribution from `both` on has a probability below 0.025. `both` must be positive, because
    otherwise the interval has no upper limit.
    """
    if both < 1:
        raise ValueError("both must be positive")
    least = first + second - both
    lower = least
    while _probability(lower, first, second, 0, both) < _TAIL:
        lower += 1
    upper = lower
    while _probability(upper + 1, first, second, both, min(first, second)) >= _TAIL:
        upper += 1
    return lower, upper


def _probability(size: int, first: int, second: int, begin: int, end: int) -> float:
    """Return the probability that from `begin` to `end` members are in both samples."""
    ways = sum(
        comb(first, both) * comb(size - first, second - both)
        for both in range(begin, min(end, second) + 1)
    )
    return ways / comb(size, second)


def sample() -> list[Card]:
    """Return the cards that the second reading must contain, in the order of the decks.

    They are drawn at random from all cards of the scan, in the order of the scan.
    """
    given = facts("cards/second-reading")
    size = sum(len(given[program]) for program in PROGRAMS)
    drawn = set(random.Random(given["seed"]).sample([*witness_lines()], size))
    return [card for card in chosen(()) if card.name in drawn]


def read_cards() -> Iterator[ReadCard]:
    """Yield each card of the second reading with the scan and the first reading."""
    given = facts("cards/second-reading")
    for program in PROGRAMS:
        for number, text in given[program].items():
            card = deck(program).cards[int(number)]
            assert card.scan is not None
            yield ReadCard(
                card, card.scan.partition("-")[2], tight(card.text_with_scanned_names), tight(text)
            )


def misread_places(scan: str, reading: str) -> dict[int, str]:
    """Return the places of a scan's line at which a reading differs from the line.

    The keys are indices of characters in the line. Each value is the text of the reading at this
    place, which is empty if the reading deletes the character. Inserted characters belong to the
    character before them, or to the place -1.
    """
    found: dict[int, str] = {}
    matcher = SequenceMatcher(None, scan, reading, autojunk=False)
    for what, begin, end, first, last in matcher.get_opcodes():
        if what == "insert":
            found[begin - 1] = reading[first:last]
        elif what != "equal":
            # The last place has the characters that are more than those of the scan.
            for place in range(begin, end):
                at = first + place - begin
                found[place] = reading[at : last if place == end - 1 else min(at + 1, last)]
    return found


def recaptures() -> list[Recapture]:
    """Return the estimates from the two readings, with places and with whole cards as units.

    The misreadings of one card are not independent, because the machine tends to misread a letter
    in the same way several times. The estimate with whole cards avoids this dependence.
    """
    places: tuple[set[tuple[str, int]], ...] = (set(), set())
    for each in read_cards():
        for found, reading in zip(places, (each.first, each.second), strict=True):
            found |= {(each.card.name, place) for place in misread_places(each.scan, reading)}
    cards = tuple({name for name, _ in found} for found in places)
    return [
        _recapture("places", len(places[0]), len(places[1]), len(places[0] & places[1])),
        _recapture("cards", len(cards[0]), len(cards[1]), len(cards[0] & cards[1])),
    ]


def disagreeing() -> list[ReadCard]:
    """Return the cards of the sample that the two readings read differently."""
    return [each for each in read_cards() if each.first != each.second]


def second_reading_report() -> Report:
    """Return the report that compares the two readings, with the estimated misreadings."""
    found, cards, differing = recaptures(), [*read_cards()], disagreeing()
    frame = len(witness_lines())
    seed = facts("cards/second-reading")["seed"]
    rows = [[*each, each.uncorrected] for each in found]
    legend = (
        "first, second, both: number of misreadings of the scan in the sample that our text, the "
        "second reading, and both correct. estimate: Chapman's estimate of all misreadings in the "
        "sample. lower, upper: limits of its 95 % interval. uncorrected: upper, without those that "
        "our text corrects."
    )
    told = [
        f"{each.card.name}: scan {each.scan}; first {each.first}; second {each.second}"
        for each in differing
    ]
    return Report(
        "cards",
        [
            [f"Sample: {len(cards)} of the {frame} cards in the scan, drawn with seed {seed}."],
            [legend],
            [Table(_COLUMNS, rows)],
            [f"{counted(len(differing), 'card')} read differently:", *told],
        ],
        record=lambda: {
            "sample": {"seed": seed, "size": len(cards), "cards": frame},
            "recaptures": [
                {**each._asdict(), "uncorrected": each.uncorrected} for each in found
            ],
            "disagreeing": [
                {
                    "card": each.card.name, "scan": each.scan, "first": each.first,
                    "second": each.second,
                }
                for each in differing
            ],
        },
        data=columns("unit first second both estimate lower upper uncorrected", rows),
    )  # fmt: skip


def _recapture(unit: str, first: int, second: int, both: int) -> Recapture:
    estimate = chapman(first, second, both)
    return Recapture(unit, first, second, both, estimate, *recapture_interval(first, second, both))
