"""The views of `claims`: the ledger, the story of one claim, the table of assignments."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

from pyharness.history.claims.ledger import Assignment, Judgement
from pyharness.views.text import WIDTH, aligned, short, wrapped

_HEAD = ("claim", "where", "as punched", "as mended", "hangs on")


def claims_rows(judgements: Sequence[Judgement]) -> tuple[Sequence[str], list[list[str]]]:
    """Return head and rows of the ledger."""
    rows = [
        [
            each.claim["id"],
            each.claim["where"],
            each.programs.verdict,
            each.methods.verdict,
            ", ".join(_hangs_on(each)) or "-",
        ]
        for each in judgements
    ]
    return _HEAD, rows


def claims_table(judgements: Sequence[Judgement]) -> str:
    """Return the ledger, one line for each claim."""
    _, rows = claims_rows(judgements)
    short_names = {
        "reproduced": "yes",
        "reproduced in part": "in part",
        "not reproduced": "no",
        "false": "FALSE",
        "not testable": "n/t",
    }
    lines = aligned(
        _HEAD,
        [[*row[:2], short_names[row[2]], short_names[row[3]], row[4]] for row in rows],
        left=5,
    )
    counts = "; ".join(
        f"{name}: {sum(row[2] == verdict for row in rows)} as punched, "
        f"{sum(row[3] == verdict for row in rows)} as mended"
        for verdict, name in (
            ("reproduced", "reproduced (yes)"),
            ("reproduced in part", "in part"),
            ("not reproduced", "not reproduced (no)"),
            ("false", "false"),
            ("not testable", "not testable (n/t)"),
        )
    )
    lines += ["", *wrapped(counts), "`claims --explain ID` tells the story with its numbers."]
    return "\n".join(lines) + "\n"


def explanation(judgement: Judgement) -> str:
    """Return the story of one claim."""
    entry = judgement.claim
    lines = wrapped(f'{entry["id"]} ({entry["where"]}): "{entry["quote"]}"')
    lines += ["", *_field("says", entry["statement"]), *_field("rule", entry["rule"])]
    for title, outcome in (
        ("as punched", judgement.programs),
        ("as mended", judgement.methods),
    ):
        lines += ["", f"{title}: {outcome.verdict}"]
        width = max(map(len, outcome.numbers), default=0)
        lines += [f"  {name.ljust(width)}  {_number(x)}" for name, x in outcome.numbers.items()]
    if judgement.survivals:
        lines += ["", "without its assumptions (as punched, as mended):"]
    for each in judgement.survivals:
        mark = "stands" if each.survives else "TURNS"
        lines.append(f"  {mark:7s}{each.assumption}: {each.programs}, {each.methods}")
    return "\n".join(lines) + "\n"


def assignments_table(assignments: Sequence[Assignment]) -> str:
    """Return which starts let the claims of each case hold, for the programs as punched."""
    lines = [
        "omega(0) of Cases 1, 3, 4, 6 and 7 is not given. With each start that the thesis shows,",
        "the claims about that case alone, for the programs as punched:",
    ]
    for case in dict.fromkeys(each.case for each in assignments):
        rows = [each for each in assignments if each.case == case]
        lines += ["", f"Case {case}"]
        for each in rows:
            start = ", ".join(f"{x:g}" for x in each.start)
            lines.append(
                f"  ({start}): {'all can hold' if each.holds else 'they can not all hold'}"
            )
            lines += [f"      {verdict:20s}{name}" for name, verdict in each.verdicts.items()]
    holding = [
        sum(each.holds for each in assignments if each.case == case)
        for case in dict.fromkeys(each.case for each in assignments)
    ]
    every = (len(assignments) // len(holding)) ** len(holding)
    lines += [
        "",
        f"all hold at once for {math.prod(holding)} of {every} assignments, "
        "but for claims that fail with every start",
    ]
    return "\n".join(lines) + "\n"


def claims_record(judgements: Sequence[Judgement]) -> list[dict[str, Any]]:
    """Return the ledger for JSON."""
    return [
        {
            "id": each.claim["id"],
            "where": each.claim["where"],
            "quote": each.claim["quote"],
            "programs": each.programs.verdict,
            "methods": each.methods.verdict,
            "numbers": {"programs": each.programs.numbers, "methods": each.methods.numbers},
            "assumptions": [
                {
                    "assumption": survival.assumption,
                    "programs": survival.programs,
                    "methods": survival.methods,
                    "survives": survival.survives,
                }
                for survival in each.survivals
            ],
        }
        for each in judgements
    ]


def _hangs_on(judgement: Judgement) -> list[str]:
    """Return the assumptions without which a verdict turns, each once."""
    names = []
    for each in judgement.survivals:
        if not each.survives:
            names.append("omega(0)" if each.assumption.startswith("omega") else each.assumption)
    return list(dict.fromkeys(names))


def _field(name: str, text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=f"{name:6s}", subsequent_indent=" " * 6)


def _number(x: float) -> str:
    if not math.isfinite(x):
        return short(x)
    return f"{x:.0f}" if x == int(x) and abs(x) < 1e6 else f"{x:.3g}"
