"""The data of the page that compares the programs' cards.

Cards of an operation in `data/cards/collation.toml` are aligned by similarity.
"""

import difflib
import re
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

from pyharness.edition.decks import Run
from pyharness.history.origins import Disagreement
from pyharness.model.listing import PROGRAMS
from pyharness.thesis import collation
from pyharness.thesis.cards import Card, deck, numbers

# Parts of a card by kind; operators include relations such as .GT., and powers.
_PART = re.compile(
    r"(?P<operator>\.[A-Z]+\.|\*\*|[-+*/=]|\.(?!\d))|(?P<name>[A-Z][A-Z0-9]*)"
    r"|(?P<number>\d+\.?\d*|\.\d+)|(?P<punctuation>\S)"
)
# Least fraction of equal parts of two aligned cards.
_ALIKE = 0.5
_LABEL = "statement number"
KINDS = (_LABEL, "name", "number", "operator", "punctuation")
"""Kinds of differences between two statements, in the order of display."""


class _Part(NamedTuple):
    column: int  # from 0
    text: str
    kind: str


class Cell(NamedTuple):
    """A card in an aligned row, in pieces whose `entry` is the kind of difference, if any."""

    card: Card
    runs: list[Run]


class AlignedRow(NamedTuple):
    cells: dict[str, Cell | None]
    differences: list[str]


class Operation(NamedTuple):
    row: collation.Row
    aligned: list[AlignedRow]


def operations() -> list[Operation]:
    return [Operation(row, _aligned(row.cards)) for row in collation.rows() if row.cards]


def thesis_on(disagreement: Disagreement) -> str:
    """Return a text on a disagreement's equations and place in the thesis."""
    given = ", ".join(disagreement.equations)
    noun = "equations" if "," in given or "-" in given else "equation"
    return "; ".join(filter(None, (given and f"{noun} {given}", disagreement.where)))


def _aligned(ranges: dict[str, str]) -> list[AlignedRow]:
    rows: list[dict[str, Card]] = []
    for program in PROGRAMS:
        cards = [deck(program).cards[n] for n in numbers(ranges.get(program, ""))]
        rows = _merged(rows, [card for card in cards if not card.is_comment])
    return [_compared(row) for row in rows]


def _merged(rows: Sequence[dict[str, Card]], cards: Sequence[Card]) -> list[dict[str, Card]]:
    """Return rows joined with a deck's most similar cards, in order; other cards are new rows."""
    # best[i][j] is the largest sum of likenesses for rows from i on and cards from j on.
    best = [[0.0] * (len(cards) + 1) for _ in range(len(rows) + 1)]
    pairs = [[max(_likeness(x, card) for x in row.values()) for card in cards] for row in rows]
    for i in reversed(range(len(rows))):
        for j in reversed(range(len(cards))):
            both = pairs[i][j] + best[i + 1][j + 1] if pairs[i][j] >= _ALIKE else 0.0
            best[i][j] = max(both, best[i + 1][j], best[i][j + 1])
    found: list[dict[str, Card]] = []
    i = j = 0
    while i < len(rows) or j < len(cards):
        both = i < len(rows) and j < len(cards) and pairs[i][j] >= _ALIKE
        if both and best[i][j] == pairs[i][j] + best[i + 1][j + 1]:
            found.append({**rows[i], cards[j].program: cards[j]})
            i, j = i + 1, j + 1
        elif j == len(cards) or (i < len(rows) and best[i][j] == best[i + 1][j]):
            found.append(rows[i])
            i += 1
        else:
            found.append({cards[j].program: cards[j]})
            j += 1
    return found


def _likeness(one: Card, other: Card) -> float:
    mine, theirs = (_PART.findall(card.text, 6) for card in (one, other))
    return difflib.SequenceMatcher(None, mine, theirs, autojunk=False).ratio()


def _compared(row: dict[str, Card]) -> AlignedRow:
    marks: dict[str, dict[int, str]] = {program: {} for program in row}
    parts = {program: _split_card(card) for program, card in row.items()}
    for one, other in combinations(row, 2):
        mine, theirs = (
            [(each.kind == _LABEL, each.text) for each in parts[name]] for name in (one, other)
        )
        matcher = difflib.SequenceMatcher(None, mine, theirs, autojunk=False)
        for what, i, j, k, m in matcher.get_opcodes():
            if what != "equal":
                marks[one] |= {each.column: each.kind for each in parts[one][i:j]}
                marks[other] |= {each.column: each.kind for each in parts[other][k:m]}
    kinds = {kind for found in marks.values() for kind in found.values()}
    cells: dict[str, Cell | None] = dict.fromkeys(PROGRAMS)
    for program, card in row.items():
        cells[program] = Cell(card, _runs(card.text, parts[program], marks[program]))
    return AlignedRow(cells, [kind for kind in KINDS if kind in kinds])


def _split_card(card: Card) -> list[_Part]:
    labels = [] if card.continues else _PART.finditer(card.text[:5])
    found = [_Part(each.start(), each[0], _LABEL) for each in labels]
    parts = _PART.finditer(card.text, 6)
    return [*found, *(_Part(each.start(), each[0], str(each.lastgroup)) for each in parts)]


def _runs(text: str, parts: Sequence[_Part], marks: dict[int, str]) -> list[Run]:
    """Return a card's text, without leading blanks, divided around the parts in `marks`."""
    found, done = [], 0
    for part in parts:
        if part.column in marks:
            found += [Run(text[done : part.column])] if done < part.column else []
            found.append(Run(part.text, part.kind))
            done = part.column + len(part.text)
    found += [Run(text[done:])] if text[done:] else []
    return [found[0]._replace(text=found[0].text.lstrip()), *found[1:]]
