"""The claims of the thesis and our verdicts on them."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

from pyharness.history.claims import methods, rules, theory, verdicts
from pyharness.history.claims.laboratory import Assumptions, Laboratory, start_text, starts
from pyharness.history.claims.verdicts import REPRODUCED, Judged
from pyharness.model.assumptions import assumption_records, claim_records, open_starts
from pyharness.model.errors import unknown
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.report import Column, Field, Line, Report, Section, Table, short, words
from pyharness.model.scene import Triple
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.thesis.programs import BINARY64


@dataclass(frozen=True)
class Survival:
    """The verdicts after a change of one assumption; `survives` if neither verdict changes."""

    assumption: str
    original: str
    corrected: str
    survives: bool


@dataclass(frozen=True)
class Judgement:
    """The verdicts on a claim, from the original and from the corrected programs."""

    claim: dict[str, Any]
    original: Judged
    corrected: Judged
    survivals: tuple[Survival, ...]


@dataclass(frozen=True)
class Assignment:
    """An initial omega for a case without one in the thesis, with the verdicts by claim."""

    case: int
    start: Triple  # rad/s
    verdicts: dict[str, str]
    # Whether all claims whose verdicts depend on `start` are reproduced, at least in part.
    holds: bool


def claims() -> list[dict[str, Any]]:
    return list(facts("claims")["claim"])


def claim(identity: str) -> dict[str, Any]:
    by_name = {each["id"]: each for each in claims()}
    if identity not in by_name:
        raise unknown("claim", identity, list(by_name))
    return by_name[identity]


@cache
def judgement(identity: str, word: str = BINARY64) -> Judgement:
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
    return [judgement(entry["id"]) for entry in claims()]


def outcome(entry: dict[str, Any], laboratory: Laboratory) -> Judged:
    """Return the verdict on a claim, which is an entry of `data/claims.toml`."""
    name, parameters = entry["test"], entry.get("parameters", {})
    for module in (verdicts, methods, theory):
        if name in vars(module):
            judged: Judged = vars(module)[name](laboratory, **parameters)
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
            # Remove the conjecture if the original listing has it, else add it.
            conjecture = name.removeprefix("conjecture ")
            own = Listing.original(PROGRAMS[0]).conjectures
            told = "without" if conjecture in own else "with"
            yield f"{told} {name}", Assumptions(conjectures=own ^ {conjecture})
        else:
            yield name, Assumptions(readings=frozenset([name.removeprefix("reading ")]))


def assignments() -> list[Assignment]:
    """Return the verdicts for each start, in each case for which the thesis gives no omega(0)."""
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


# Each verdict as written in the table of claims, and in its legend.
_VERDICTS = {
    "reproduced": ("yes", "reproduced (yes)"),
    "reproduced in part": ("in part", "in part"),
    "not reproduced": ("no", "not reproduced (no)"),
    "false": ("FALSE", "false"),
    "not testable": ("n/t", "not testable (n/t)"),
    "undecided": ("?", "undecided (?)"),
}


def _verdict(verdict: str) -> str:
    return _VERDICTS[verdict][0]


_LEDGER = (
    *words("claim where"),
    Column("original", _verdict, left=True), Column("corrected", _verdict, left=True),
    Column("depends on", left=True, fit="wrap"),
)  # fmt: skip
_DATA = (*_LEDGER[:1], *words("kind"), *_LEDGER[1:])
KINDS = {
    "result": "what the programs gave, and what is concluded of it",
    "theory": "equations, methods, their errors and what causes them",
    "design": "how programs and cases were made",
    "history": "what others did, and what the author did",
    "recommendation": "neither true nor false, and so not testable",
}
"""The kinds of claims and their subjects."""


def claims_report(judgements: Sequence[Judgement]) -> Report:
    rows = []
    for each in judgements:
        place = [each.claim[name] for name in ("id", "kind", "where")]
        needed = ", ".join(_hangs_on(each)) or "-"
        rows.append([*place, each.original.verdict, each.corrected.verdict, needed])
    legend = "; ".join(name for _, name in _VERDICTS.values())
    head = (
        "original, corrected: our verdict for the programs as printed and as corrected: "
        f"{legend}. depends on: assumptions without which a verdict changes."
    )
    text: list[Section] = [[head]]
    for kind, about in KINDS.items():
        if of_kind := [[name, *rest] for name, its, *rest in rows if its == kind]:
            text.append([f"{kind}: {about}", Table(_LEDGER, of_kind)])
    text.append(["Number of verdicts by kind, original / corrected:", kinds_table(judgements)])
    text.append(["`claims --explain ID` explains a verdict with its numbers."])
    return Report("claims", text, lambda: _record(judgements), Table(_DATA, rows))


def kinds_table(judgements: Sequence[Judgement]) -> Table:
    columns = [*words("kind"), Column("claims"), *map(Column, _VERDICTS)]
    rows = []
    for kind in KINDS:
        of_kind = [each for each in judgements if each.claim["kind"] == kind]
        original = Counter(each.original.verdict for each in of_kind)
        corrected = Counter(each.corrected.verdict for each in of_kind)
        pairs = [(original[verdict], corrected[verdict]) for verdict in _VERDICTS]
        told = [f"{one} / {other}" if one or other else "-" for one, other in pairs]
        rows.append([kind, len(of_kind), *told])
    return Table(columns, rows)


def explanation(judgement: Judgement) -> Report:
    entry = judgement.claim
    labels = {"kind": "kind", "statement": "says", "rule": "rule", "source": "by"}
    fields = [Field(f"{x:6s}", entry[name]) for name, x in labels.items() if name in entry]
    text: list[Section] = [[f'{entry["id"]} ({entry["where"]}): "{entry["quote"]}"'], fields]
    for title, outcome in (("original", judgement.original), ("corrected", judgement.corrected)):
        width = max(map(len, outcome.numbers), default=0)
        numbers = outcome.numbers.items()
        lines = [Line(f"  {name.ljust(width)}  {written(x)}") for name, x in numbers]
        text.append([Line(f"{title}: {outcome.verdict}"), *lines])
    if judgement.survivals:
        lines = [Line("without its assumptions (original, corrected):")]
        for each in judgement.survivals:
            mark = "same" if each.survives else "CHANGES"
            lines.append(Line(f"  {mark:9s}{each.assumption}: {each.original}, {each.corrected}"))
        text.append(lines)
    return claims_report([judgement])._replace(text=text)


def assignments_report(assignments: Sequence[Assignment]) -> Report:
    head = (
        "omega(0) of Cases 1, 3, 4, 6 and 7 is not given. With each start that the thesis shows, "
        "and (1, 1, 1), which is ours, the claims about that case alone, for the original "
        "programs; those with the same failing verdict for every start do not count:"
    )
    text: list[Section] = [[head]]
    holding = []
    for case in dict.fromkeys(each.case for each in assignments):
        starts = [each for each in assignments if each.case == case]
        lines = [f"Case {case}"]
        for each in starts:
            told = "all others hold" if each.holds else "they do not all hold"
            lines.append(f"  ({start_text(each.start)}): {told}")
            lines += [f"      {verdict:20s}{name}" for name, verdict in each.verdicts.items()]
        text.append(list(map(Line, lines)))
        holding.append(sum(each.holds for each in starts))
    every = (len(assignments) // len(holding)) ** len(holding)
    number = f"all hold at once for {math.prod(holding)} of {every} assignments"
    text.append([Line(f"{number}, but for claims that fail with every start")])
    record = {"assignments": list(map(asdict, assignments))}
    return Report("claims", text, lambda: record)


def _record(judgements: Sequence[Judgement]) -> dict[str, Any]:
    entries = []
    for each in judgements:
        about = {name: each.claim[name] for name in ("id", "kind", "where", "quote")}
        both = {"original": each.original, "corrected": each.corrected}
        numbers = {"numbers": {name: found.numbers for name, found in both.items()}}
        about |= {name: found.verdict for name, found in both.items()} | numbers
        entries.append(about | {"assumptions": list(map(asdict, each.survivals))})
    return {"claims": entries, "assumptions": _supplied(judgements)}


def _supplied(judgements: Sequence[Judgement]) -> list[dict[str, Any]]:
    told = [each.claim for each in judgements]
    named = {name.rpartition(" ")[2] for each in told for name in each["assumptions"]}
    others = {name.partition(":")[0] for each in told for name in each.get("otherwise", {})}
    named |= {name.replace(" ", "-") for name in others}
    runs = [(case_scene(n), [*map(Listing.original, PROGRAMS)]) for n in case_numbers()]
    found = [*assumption_records(runs), *claim_records()]
    return [each for each in found if each["id"] in {*named, "units"}]


def _hangs_on(judgement: Judgement) -> list[str]:
    found = []
    for each in (each.assumption for each in judgement.survivals if not each.survives):
        name = each.replace("conjecture ", "").replace("reading ", "").partition(":")[0]
        found.append("omega(0)" if name.startswith("omega") else name)
    return list(dict.fromkeys(found))


def written(x: float) -> str:
    if not math.isfinite(x):
        return short(x)
    return f"{x:.0f}" if x == int(x) and abs(x) < 1e6 else f"{x:.3g}"
