"""The claims of the thesis, each with verdicts computed for the programs and for the methods."""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from pyharness.history.claims.laboratory import Assumptions, Laboratory
from pyharness.history.claims.verdicts import REPRODUCED, Judged, Test
from pyharness.model.errors import unknown
from pyharness.model.facts import facts
from pyharness.model.scene import Triple
from pyharness.model.scene_file import case_numbers


@dataclass(frozen=True)
class Survival:
    """A verdict without one of its assumptions.

    Attributes
    ----------
    assumption : str
        What was changed, and to what.
    original, corrected : str
        The verdicts then.
    survives : bool
        Whether both are what they were.
    """

    assumption: str
    original: str
    corrected: str
    survives: bool


@dataclass(frozen=True)
class Judgement:
    """A claim with its verdicts.

    Attributes
    ----------
    claim : dict
        The entry of `data/claims.toml`.
    original, corrected : Judged
        For the original programs, and for the corrected methods.
    survivals : tuple of Survival
        The verdicts without each assumption.
    """

    claim: dict[str, Any]
    original: Judged
    corrected: Judged
    survivals: tuple[Survival, ...]


def claims() -> list[dict[str, Any]]:
    """Return the entries of the ledger."""
    entries: list[dict[str, Any]] = facts("claims")["claim"]
    return entries


def claim(identity: str) -> dict[str, Any]:
    """Return one entry; InputError where there is none of that name."""
    for each in claims():
        if each["id"] == identity:
            return each
    raise unknown("claim", identity, [each["id"] for each in claims()])


def judge(entry: dict[str, Any], fixed: frozenset[str] = frozenset()) -> Judgement:
    """Test one claim.

    Parameters
    ----------
    entry : dict
        An entry of the ledger.
    fixed : frozenset of str
        Defects to correct even in the original programs.
    """

    def verdicts(assumptions: Assumptions) -> tuple[Judged, Judged]:
        programs = outcome(entry, Laboratory(True, assumptions, fixed))
        return programs, outcome(entry, Laboratory(False, assumptions))

    programs, methods = verdicts(Assumptions())
    survivals = []
    for name, assumptions in _alternatives(entry):
        other_programs, other_methods = verdicts(assumptions)
        same = (other_programs.verdict, other_methods.verdict) == (
            programs.verdict,
            methods.verdict,
        )
        survivals.append(Survival(name, other_programs.verdict, other_methods.verdict, same))
    return Judgement(entry, programs, methods, tuple(survivals))


def outcome(entry: dict[str, Any], laboratory: Laboratory) -> Judged:
    """Run the test of a claim in one laboratory."""
    return _test(entry["test"])(laboratory, entry.get("parameters", {}))


def _test(name: str) -> Test:
    for room in ("cases", "programs", "methods"):
        test = getattr(import_module(f"pyharness.history.claims.about_{room}"), name, None)
        if test is not None:
            found: Test = test
            return found
    raise LookupError(f"claims.toml: there is no test '{name}'")


def starts() -> list[Triple]:
    """Return the initial angular velocities that the thesis shows, and our own (rad/s)."""
    return [
        (float(a), float(b), float(c)) for a, b, c in (s["omega"] for s in facts("claims")["start"])
    ]


def _alternatives(entry: dict[str, Any]) -> Iterator[tuple[str, Assumptions]]:
    for name in entry["assumptions"]:
        if name == "omega0":
            for start in starts():
                shown = ", ".join(f"{x:g}" for x in start)
                yield f"omega(0) = ({shown}) where not given", Assumptions(start=start)
        elif name == "steps":
            yield "300 steps", Assumptions(steps=300)
        else:
            reading = name.removeprefix("reading ")
            yield f"reading {reading}", Assumptions(readings=frozenset([reading]))


@dataclass(frozen=True)
class Assignment:
    """A start of a case that is not given, and what the claims about that case make of it.

    Attributes
    ----------
    case : int
        Of Table 1.
    start : Triple
        omega(0), rad/s.
    verdicts : dict
        Verdict of every claim about this case alone, for the original programs.
    holds : bool
        Whether all are reproduced, at least in part.
    """

    case: int
    start: Triple
    verdicts: dict[str, str]
    holds: bool


def assignments() -> list[Assignment]:
    """Return, for every case whose start is not given and every start, what holds.

    The claims of a case depend on no other case's start, so all claims hold at once for the
    assignments that choose, in every case, a start that holds there.
    """
    found = []
    unresolvable = _claims_that_no_start_changes()
    for case in case_numbers():
        about = [each for each in claims() if each.get("parameters", {}).get("case") == case]
        if case not in facts("claims")["assumed"]["cases"]:
            continue
        for start in starts():
            laboratory = Laboratory(True, Assumptions(start=start))
            verdicts = {each["id"]: outcome(each, laboratory).verdict for each in about}
            holds = all(
                verdict.startswith(REPRODUCED)
                for identity, verdict in verdicts.items()
                if identity not in unresolvable
            )
            found.append(Assignment(case, start, verdicts, holds))
    return found


def _claims_that_no_start_changes() -> set[str]:
    """Return the claims about a case that have the same verdict, a failure, for every start."""
    failing = set()
    for each in claims():
        if each.get("parameters", {}).get("case") not in facts("claims")["assumed"]["cases"]:
            continue
        verdicts = {
            outcome(each, Laboratory(True, Assumptions(start=start))).verdict for start in starts()
        }
        if len(verdicts) == 1 and not verdicts.pop().startswith(REPRODUCED):
            failing.add(each["id"])
    return failing
