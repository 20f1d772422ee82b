"""Disagreements of the decks with each other and with the thesis, as evidence on faults' origins.

`data/disagreements.toml` separates the sources' statements from our inferences.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from pyharness.history.tei import CERTAINTY
from pyharness.model.facts import facts
from pyharness.thesis.cards import deck, tight
from pyharness.thesis.collation import names_a_card, rows


class Disagreement(NamedTuple):
    """A disagreement of the decks with each other or with the thesis."""

    id: str
    title: str
    steps: Sequence[str]  # operations in `data/cards/collation.toml`
    equations: Sequence[str]
    where: str  # place in the thesis
    says: str  # words quoted from this place
    cards: dict[str, dict[int, str]]  # texts by program and card number
    differs: str
    known: str  # facts in the sources
    suggests: str  # our inference
    origin: str  # kind of origin that we infer
    certainty: str
    entries: Sequence[str]
    unnoticed: str  # why the test cases do not reveal the fault


def disagreements() -> list[Disagreement]:
    found = []
    for given in facts("disagreements")["disagreement"]:
        cards = {
            program: {int(number): text for number, text in quotes.items()}
            for program, quotes in given["cards"].items()
        }
        may_lack = {"where": "", "says": "", "unnoticed": ""}
        found.append(Disagreement(**may_lack | given | {"cards": cards}))
    return found


def origins() -> dict[str, str]:
    return dict(facts("disagreements")["origin"])


def unexplained_defects() -> dict[str, str]:
    """Return the reasons for defects that no disagreement explains, by defect."""
    return dict(facts("disagreements")["unexplained"])


def mistakes() -> list[str]:
    found = disagreements()
    return [*_of_each(found), *_of_defects(found), *_of_steps(found)]


def _of_each(found: list[Disagreement]) -> Iterator[str]:
    known = {entry["id"]: entry for entry in facts("apparatus")["entry"]}
    steps = {row.what for row in rows()}
    formulas = {each.get("number") for each in facts("formulas")["formula"]}
    for name, count in Counter(each.id for each in found).items():
        if count > 1:
            yield f"{name}: is {count} times in the table"
    for each in found:
        for program, quotes in each.cards.items():
            for number, text in quotes.items():
                card = deck(program).cards.get(number)
                if card is None or tight(card.text) != tight(text):
                    yield f"{each.id}: {program}:{number} is not {text!r}"
        yield from (f"{each.id}: no step {name!r}" for name in each.steps if name not in steps)
        yield from (f"{each.id}: no formula {n!r}" for n in each.equations if n not in formulas)
        for name in each.entries:
            if name not in known:
                yield f"{each.id}: no entry {name!r}"
            elif not names_a_card(known[name], each.cards):
                yield f"{each.id}: {name} names none of its cards"
        if each.origin not in origins():
            yield f"{each.id}: no origin {each.origin!r}"
        if each.certainty not in CERTAINTY:
            yield f"{each.id}: no certainty {each.certainty!r}"


def _of_defects(found: list[Disagreement]) -> Iterator[str]:
    explained = {name for each in found for name in each.entries}
    defects = [each["id"] for each in facts("apparatus")["entry"] if each["kind"] == "defect"]
    given = unexplained_defects()
    for name in defects:
        if (name in explained) == (name in given):
            yield f"{name}: must be in a disagreement or without an explanation, and not in both"
    yield from (f"{name}: is no defect" for name in given if name not in defects)


def _of_steps(found: list[Disagreement]) -> Iterator[str]:
    named = {name for each in found for name in each.steps}
    required = facts("disagreements")["as_required"]["steps"]
    steps = {row.what: row for row in rows()}
    yield from (f"as_required: no step {name!r}" for name in required if name not in steps)
    for name, row in steps.items():
        differs = row.thesis == "differs" or row.decks in ("differ", "names", "order")
        if differs and (name in named) == (name in required):
            yield f"{name}: must be in a disagreement or as required, and not in both"
