"""The claims of the thesis, and the verdicts computed for the original and corrected programs."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pyharness.history.claims import methods, theory, verdicts
from pyharness.history.claims.laboratory import Assumptions, Laboratory, starts
from pyharness.history.claims.verdicts import REPRODUCED, Judged
from pyharness.model.errors import unknown
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Triple
from pyharness.original.programs import BINARY64

_ROOMS = (verdicts, methods, theory)


@dataclass(frozen=True)
class Survival:
    """The verdicts on one claim of the thesis, with one assumption changed.

    `assumption` describes the change, for example another initial omega. `original` and `corrected`
    are the verdicts for the original and for the corrected programs. `survives` is true if both
    verdicts are the same as with the adopted assumptions.
    """

    assumption: str
    original: str
    corrected: str
    survives: bool


@dataclass(frozen=True)
class Judgement:
    """A claim of the thesis with its verdicts for the original and corrected programs.

    `claim` is an entry of `data/claims.toml`. `survivals` has the verdicts with each assumption
    changed, one at a time.
    """

    claim: dict[str, Any]
    original: Judged
    corrected: Judged
    survivals: tuple[Survival, ...]


@dataclass(frozen=True)
class Assignment:
    """An initial omega for a case in which the thesis gives none, and the verdicts on its claims.

    `start` is the initial omega (rad/s). `verdicts` maps each claim about the case to the verdict
    for the original programs. `holds` is true if all claims about the case are reproduced, at least
    in part. Claims that fail with every start do not count.
    """

    case: int
    start: Triple
    verdicts: dict[str, str]
    holds: bool


def claims() -> list[dict[str, Any]]:
    """Return all claims of the thesis on which we give a verdict, as in `data/claims.toml`."""
    entries: list[dict[str, Any]] = facts("claims")["claim"]
    return entries


def claim(identity: str) -> dict[str, Any]:
    """Return the claim of the thesis with the identifier `identity`, as in `data/claims.toml`.

    Raise InputError if no claim has this identifier.
    """
    by_name = {each["id"]: each for each in claims()}
    if identity not in by_name:
        raise unknown("claim", identity, list(by_name))
    return by_name[identity]


def judge(entry: dict[str, Any], word: str = BINARY64) -> Judgement:
    """Test one claim under the adopted assumptions, and again with each assumption changed.

    The result has the verdicts for the original and the corrected programs. `entry` is the claim,
    as in `data/claims.toml`. `word` is the name of the floating-point arithmetic in which the
    programs run.
    """

    def verdicts(entry: dict[str, Any], assumptions: Assumptions) -> tuple[Judged, Judged]:
        programs = outcome(entry, Laboratory(True, assumptions))
        return programs, outcome(entry, Laboratory(False, assumptions))

    programs, methods = verdicts(entry, Assumptions(word=word))
    others = [
        (name, verdicts(entry, replace(each, word=word))) for name, each in _alternatives(entry)
    ]
    for name, changed in entry.get("otherwise", {}).items():
        other = {**entry, "parameters": {**entry["parameters"], **changed}}
        others.append((name, verdicts(other, Assumptions(word=word))))
    survivals = []
    for name, found in others:
        original, corrected = (each.verdict for each in found)
        same = (original, corrected) == (programs.verdict, methods.verdict)
        survivals.append(Survival(name, original, corrected, same))
    return Judgement(entry, programs, methods, tuple(survivals))


@cache
def judgement(identity: str, word: str = BINARY64) -> Judgement:
    """Return the verdicts on the claim with the identifier `identity`, as `judge` gives them.

    The verdicts are for the original and the corrected programs, under several assumptions. The
    result is cached. `word` is the name of the floating-point arithmetic in which the programs run.
    """
    return judge(claim(identity), word)


def judgements() -> list[Judgement]:
    """Return our verdicts on every claim of the thesis, for the original and corrected programs.

    A `Judgement` has the verdicts on one claim.
    """
    return [judgement(entry["id"]) for entry in claims()]


def outcome(entry: dict[str, Any], laboratory: Laboratory) -> Judged:
    """Return the verdict on one claim, for the programs that the laboratory runs.

    `laboratory` runs the original or the corrected programs under given assumptions. `entry` is the
    claim, as in `data/claims.toml`; the entry names the test function that gives the verdict.
    """
    (test,) = (vars(room)[entry["test"]] for room in _ROOMS if entry["test"] in vars(room))
    judged: Judged = test(laboratory, **entry.get("parameters", {}))
    return judged


def _alternatives(entry: dict[str, Any]) -> Iterator[tuple[str, Assumptions]]:
    for name in entry["assumptions"]:
        if name == "omega0":
            for start in starts():
                shown = ", ".join(f"{x:g}" for x in start)
                yield f"omega(0) = ({shown}) where not given", Assumptions(start=start)
        elif name == "steps":
            yield "300 steps", Assumptions(steps=300)
        elif name.startswith("conjecture "):
            # A conjecture of the original listing is removed; any other conjecture is added.
            conjecture, own = (
                name.removeprefix("conjecture "),
                Listing.original(PROGRAMS[0]).conjectures,
            )
            told = "without" if conjecture in own else "with"
            yield f"{told} {name}", Assumptions(conjectures=own ^ {conjecture})
        else:
            yield name, Assumptions(readings=frozenset([name.removeprefix("reading ")]))


def assignments() -> list[Assignment]:
    """Return one assignment for each start and each case in which the thesis gives no omega(0).

    An assignment has the verdicts on the claims about the case. The starts are the initial omegas
    from the function `starts`. The claims about a case do not depend on the start of another case.
    All claims therefore hold at once if every case has a start with which its own claims hold.
    Claims that fail with every start do not count.
    """
    found = []
    for case in facts("claims")["assumed"]["cases"]:
        about = [each for each in claims() if each.get("parameters", {}).get("case") == case]
        table = []
        for start in starts():
            laboratory = Laboratory(True, Assumptions(start=start))
            table.append({each["id"]: outcome(each, laboratory).verdict for each in about})
        unresolvable = {
            identity
            for identity, verdict in table[0].items()
            if not verdict.startswith(REPRODUCED)
            and all(each[identity] == verdict for each in table)
        }
        for start, told in zip(starts(), table, strict=True):
            holds = all(
                verdict.startswith(REPRODUCED)
                for identity, verdict in told.items()
                if identity not in unresolvable
            )
            found.append(Assignment(case, start, told, holds))
    return found
