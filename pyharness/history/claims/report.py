"""The reports of `claims`: all verdicts, one claim in detail, and the initial omegas."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from pyharness.history.claims.laboratory import start_text
from pyharness.history.claims.ledger import Assignment, Judgement
from pyharness.model.assumptions import assumption_records, claim_records
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.report import Column, Field, Line, Report, Section, Table, short, words
from pyharness.model.scene_file import case_numbers, case_scene

# A verdict as written in the table of all claims, and in its legend.
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
"""The kinds of claims, each with its subject."""


def claims_report(judgements: Sequence[Judgement]) -> Report:
    """Return the report of our verdicts, one line for each claim."""
    rows = []
    for each in judgements:
        place = [each.claim[name] for name in ("id", "kind", "where")]
        needed = ", ".join(_hangs_on(each)) or "-"
        rows.append([*place, each.original.verdict, each.corrected.verdict, needed])
    legend = "; ".join(name for _, name in _VERDICTS.values())
    text: list[Section] = [
        [
            "original, corrected: our verdict for the programs as printed and as corrected: "
            f"{legend}. depends on: assumptions without which a verdict changes."
        ]
    ]
    for kind, about in KINDS.items():
        if of_kind := [[name, *rest] for name, its, *rest in rows if its == kind]:
            text.append([f"{kind}: {about}", Table(_LEDGER, of_kind)])
    note = "`claims --explain ID` explains a verdict with its numbers."
    text.append(["Number of verdicts by kind, original / corrected:", kinds_table(judgements)])
    text.append([note])
    data = Table(_DATA, rows)
    return Report("claims", text, record=lambda: _record(judgements), data=data)


def kinds_table(judgements: Sequence[Judgement]) -> Table:
    """Return a table of the numbers of claims by kind and verdict, original / corrected."""
    columns = [*words("kind"), Column("claims"), *map(Column, _VERDICTS)]
    rows = []
    for kind in KINDS:
        of_kind = [each for each in judgements if each.claim["kind"] == kind]
        pairs = [
            [sum(getattr(each, state).verdict == verdict for each in of_kind)
             for state in ("original", "corrected")]
            for verdict in _VERDICTS
        ]  # fmt: skip
        told = ["-" if pair == [0, 0] else f"{pair[0]} / {pair[1]}" for pair in pairs]
        rows.append([kind, len(of_kind), *told])
    return Table(columns, rows)


def explanation(judgement: Judgement) -> Report:
    """Return the report of one claim: quotation, rule, verdicts and their numbers."""
    entry = judgement.claim
    text: list[Section] = [
        [f'{entry["id"]} ({entry["where"]}): "{entry["quote"]}"'],
        [
            Field("kind  ", entry["kind"]),
            Field("says  ", entry["statement"]),
            Field("rule  ", entry["rule"]),
            *([Field("by    ", entry["source"])] if "source" in entry else []),
        ],
    ]
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
    """Return the report on the initial omegas with which the claims about each case hold."""
    text: list[Section] = [
        [
            "omega(0) of Cases 1, 3, 4, 6 and 7 is not given. With each start that the thesis "
            "shows, and (1, 1, 1), which is ours, the claims about that case alone, for the "
            "original programs; those with the same failing verdict for every start do not count:"
        ]
    ]
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
    end = (
        f"all hold at once for {math.prod(holding)} of {every} assignments, "
        "but for claims that fail with every start"
    )
    record = {"assignments": list(map(asdict, assignments))}
    return Report("claims", [*text, [Line(end)]], lambda: record)


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
    """Return for JSON the assumptions on which the claims may depend; all depend on the units."""
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
    """Return a number as text: whole numbers below a million exactly, others with three digits."""
    if not math.isfinite(x):
        return short(x)
    return f"{x:.0f}" if x == int(x) and abs(x) < 1e6 else f"{x:.3g}"
