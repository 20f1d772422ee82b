"""The claims of the thesis, entries of `data/claims.toml`, and our verdicts on them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pyharness.history.claims import methods, rules, theory, verdicts
from pyharness.history.claims.laboratory import Assumptions, Laboratory, start_text, starts
from pyharness.history.claims.verdicts import REPRODUCED, Judged
from pyharness.model.assumptions import open_starts
from pyharness.model.errors import unknown
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Triple
from pyharness.thesis.programs import BINARY64


@dataclass(frozen=True)
class Survival:
    """The verdicts on a claim with one assumption changed; it `survives` if they do not change."""

    assumption: str
    original: str
    corrected: str
    survives: bool


@dataclass(frozen=True)
class Judgement:
    """The verdicts on a claim, as adopted and with each assumption changed, one at a time."""

    claim: dict[str, Any]
    original: Judged
    corrected: Judged
    survivals: tuple[Survival, ...]


@dataclass(frozen=True)
class Assignment:
    """An initial omega (rad/s) for a case in which the thesis gives none, with verdicts.

    It `holds` if the original programs reproduce, at least in part, all claims about this case.
    Claims that fail with every start do not count.
    """

    case: int
    start: Triple
    verdicts: dict[str, str]
    holds: bool


def claims() -> list[dict[str, Any]]:
    """Return all claims of the thesis on which we have a verdict."""
    return list(facts("claims")["claim"])


def claim(identity: str) -> dict[str, Any]:
    """Return the claim `identity`; raise InputError if there is none."""
    by_name = {each["id"]: each for each in claims()}
    if identity not in by_name:
        raise unknown("claim", identity, list(by_name))
    return by_name[identity]


@cache
def judgement(identity: str, word: str = BINARY64) -> Judgement:
    """Return the verdicts on one claim, as adopted and with each assumption changed."""
    entry = claim(identity)

    def outcomes(entry: dict[str, Any], assumptions: Assumptions) -> list[Judged]:
        chosen = replace(assumptions, word=word)
        return [outcome(entry, Laboratory(original, chosen)) for original in (True, False)]

    programs, methods = outcomes(entry, Assumptions())
    others = [(name, outcomes(entry, each)) for name, each in _alternatives(entry)]
    for name, changed in entry.get("otherwise", {}).items():
        other = {**entry, "parameters": {**entry["parameters"], **changed}}
        others.append((name, outcomes(other, Assumptions())))
    survivals = []
    for name, found in others:
        original, corrected = (each.verdict for each in found)
        same = (original, corrected) == (programs.verdict, methods.verdict)
        survivals.append(Survival(name, original, corrected, same))
    return Judgement(entry, programs, methods, tuple(survivals))


def judgements() -> list[Judgement]:
    """Return our judgements of all claims."""
    return [judgement(entry["id"]) for entry in claims()]


def outcome(entry: dict[str, Any], laboratory: Laboratory) -> Judged:
    """Return the verdict of a claim's test, for the laboratory's programs."""
    name, parameters = entry["test"], entry.get("parameters", {})
    for room in (verdicts, methods, theory):
        if name in vars(room):
            judged: Judged = vars(room)[name](laboratory, **parameters)
            return judged
    return verdicts.judged(vars(rules)[name](laboratory, **parameters))


def _alternatives(entry: dict[str, Any]) -> Iterator[tuple[str, Assumptions]]:
    for name in entry["assumptions"]:
        if name == "omega0":
            for start in starts():
                text = start_text(start)
                yield f"omega(0) = ({text}) where not given", Assumptions(start=start)
        elif name == "steps":
            yield "300 steps", Assumptions(steps=300)
        elif name.startswith("conjecture "):
            # An original listing's conjecture is removed; any other is added.
            conjecture = name.removeprefix("conjecture ")
            own = Listing.original(PROGRAMS[0]).conjectures
            told = "without" if conjecture in own else "with"
            yield f"{told} {name}", Assumptions(conjectures=own ^ {conjecture})
        else:
            yield name, Assumptions(readings=frozenset([name.removeprefix("reading ")]))


def assignments() -> list[Assignment]:
    """Return one assignment for each start and each case in which the thesis gives no omega(0).

    Claims about a case do not depend on another case's start. Therefore all hold at once if each
    case has a start with which its claims hold.
    """
    found = []
    for case in open_starts():
        about = [each for each in claims() if each.get("parameters", {}).get("case") == case]
        table = []
        for start in starts():
            laboratory = Laboratory(True, Assumptions(start=start))
            table.append({each["id"]: outcome(each, laboratory).verdict for each in about})
        fixed = {name for name in table[0] if len({each[name] for each in table}) == 1}
        for start, told in zip(starts(), table, strict=True):
            held = (name in fixed or told[name].startswith(REPRODUCED) for name in told)
            found.append(Assignment(case, start, told, all(held)))
    return found
