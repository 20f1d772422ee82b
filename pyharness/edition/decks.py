"""The listing card by card, for its pages: scan, card, port, twin, and the apparatus beside."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from pyharness.history.ablation import entries
from pyharness.original.cards import Card, Difference, Place, deck, parallels, tight

# Whose colour a card takes where it has entries of several kinds.
_ORDER = (
    "defect", "reading", "conjecture", "missing text", "dead code", "dialect", "misreading",
)  # fmt: skip


class Run(NamedTuple):
    """Characters in a row, and the entry that says why they differ; None where they do not."""

    text: str
    entry: str | None = None


class CardView(NamedTuple):
    """A card as a page shows it: `card` and `scan` in runs, the scan's None where it has none."""

    number: int
    name: str
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
    """Return the cards of a program in their order."""
    by_name = {each["id"]: each for each in entries()}
    found = deck(program)
    return [
        CardView(
            card.number,
            card.name,
            marked(card.text, card.differences),
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
    """Return the number of cards by kind of their entries, those with a say first."""
    counts = dict.fromkeys(_ORDER, 0)
    for view in views:
        for kind in view.kinds:
            counts[kind] += 1
    return {kind: count for kind, count in counts.items() if count}


def marked(text: str, differences: Sequence[Difference]) -> list[Run]:
    """Return a card in runs: our characters where the scan has others carry the entry."""
    # Differences do not count blanks; the page shows them.
    owners: list[str | None] = []
    for run in _runs(tight(text), [(each.ours, each.ours, each.entry) for each in differences]):
        owners += [run.entry] * len(run.text)
    runs: list[Run] = []
    position = 0
    for letter in text:
        # A blank belongs to what stands before it.
        owner = runs[-1].entry if letter.isspace() and runs else None
        if not letter.isspace():
            owner, position = owners[position], position + 1
        if runs and runs[-1].entry == owner:
            runs[-1] = Run(runs[-1].text + letter, owner)
        else:
            runs.append(Run(letter, owner))
    return runs


def _scan(card: Card) -> list[Run] | None:
    """Return the line of the scan in runs, its number among them."""
    if card.lost:
        return None
    number = Run(*card.printed) if card.printed else Run(str(card.number))
    changes = [(each.ours, each.scans, each.entry) for each in card.differences]
    return [number, Run("-"), *_runs(tight(card.text), changes)]


def _runs(text: str, changes: Iterable[tuple[str, str, str]]) -> Iterator[Run]:
    """Give a text with `shown` in place of `ours`, each with its entry, and what is between."""
    rest = text
    for ours, shown, entry in changes:
        before, _, rest = rest.partition(ours)
        if before:
            yield Run(before)
        yield Run(shown, entry)
    if rest:
        yield Run(rest)


def _kinds(found: Iterable[str]) -> list[str]:
    return sorted(set(found), key=_ORDER.index)
