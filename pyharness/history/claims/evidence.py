"""Evidence on the choices that the thesis leaves open: a score for every combination.

A combination has an omega(0), readings, conjectures and a number of steps. Its omega(0) is one
value for all cases in which the thesis gives none, or our value for each case. The score is the
number of testable claims that the original programs reproduce; in part counts 1/2.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np

from pyharness.history.claims.laboratory import Assumptions, Laboratory, starts
from pyharness.history.claims.ledger import claim, claims, outcome
from pyharness.history.claims.verdicts import IN_PART, NOT_TESTABLE, REPRODUCED
from pyharness.model.listing import flagged, names_of
from pyharness.model.report import (
    Column,
    Field,
    Picture,
    Report,
    Table,
    counted,
    digits,
    numbers,
    words,
)
from pyharness.thesis.cells import subsets

POINTS = {REPRODUCED: 1.0, IN_PART: 0.5}
STEPS = (100, 300)
KINDS = ("result", "design")
"""The kinds of claims that are scored."""
_SHOWN = 12
_SHORT = {
    "omega(0)": "omega(0)",
    **{
        f"{each['kind']} {each['id']}": each["assumption"]["short"]
        for each in sorted(flagged(), key=lambda each: str(each["kind"]), reverse=True)
        if "assumption" in each
    },
    "steps": "steps",
}
_RULE = (
    "Every combination of starts (one for all cases in which none is given, or those adopted), "
    "readings, conjectures and steps, scored by the claims about results and design of the "
    "original programs: 1 for each reproduced, 1/2 in part, 0 otherwise; not testable ones do "
    "not count. No weights: abstract-superior and vi-superior are one measure."
)


@dataclass(frozen=True)
class Combination:
    assumptions: Assumptions
    verdicts: dict[str, str]

    @property
    def score(self) -> float:
        return sum(POINTS.get(each, 0.0) for each in self.verdicts.values())

    @property
    def holding(self) -> int:
        """The number of claims reproduced at least in part."""
        return sum(each in POINTS for each in self.verdicts.values())

    def choices(self) -> dict[str, str]:
        given = self.assumptions
        active = given.readings | (given.conjectures or frozenset())
        found = {"omega(0)": ",".join(f"{x:g}" for x in given.start or ()) or "adopted"}
        for kind in ("reading", "conjecture"):
            for name in names_of(kind):
                found[f"{kind} {name}"] = "yes" if name in active else "no"
        return found | {"steps": str(given.steps)}

    def verdict_on(self, name: str) -> str:
        return self.verdicts.get(name, NOT_TESTABLE)


def evidence() -> Iterator[Combination]:
    scored = {entry["id"]: entry for entry in claims() if entry["kind"] in KINDS}
    for chosen in combinations():
        found = {name: _verdict(name, _relevant(entry, chosen)) for name, entry in scored.items()}
        testable = {name: verdict for name, verdict in found.items() if verdict != NOT_TESTABLE}
        yield Combination(chosen, testable)


def combinations() -> list[Assumptions]:
    """Return all combinations; a start of None selects our values of omega(0)."""
    # Reversed, so that the last name varies fastest.
    readings, conjectures = (
        list(subsets(names_of(kind)[::-1])) for kind in ("reading", "conjecture")
    )
    choices = product([None, *starts()], readings, conjectures, STEPS)
    return [Assumptions(start, chosen, steps, assumed) for start, chosen, assumed, steps in choices]


def discriminating(found: list[Combination]) -> list[str]:
    every = dict.fromkeys(name for each in found for name in each.verdicts)
    return [name for name in every if len({each.verdict_on(name) for each in found}) > 1]


def undecided(found: list[Combination]) -> dict[str, list[str]]:
    """Return the values of each choice that occur with the highest score."""
    best = max(each.score for each in found)
    choices = [each.choices() for each in found if each.score == best]
    return {axis: sorted({each[axis] for each in choices}) for axis in choices[0]}


def _relevant(entry: dict[str, Any], chosen: Assumptions) -> Assumptions:
    """Return `chosen` with defaults for assumptions on which a claim does not depend."""
    # Combinations that then are equal share one test of the claim.
    hangs_on = entry["assumptions"]
    readings = frozenset(name for name in chosen.readings if f"reading {name}" in hangs_on)
    named = [each for each in hangs_on if each.startswith("conjecture ")]
    start = chosen.start if "omega0" in hangs_on else None
    steps = chosen.steps if "steps" in hangs_on else 100
    return Assumptions(start, readings, steps, chosen.conjectures if named else None)


@cache
def _verdict(identity: str, assumptions: Assumptions) -> str:
    return outcome(claim(identity), Laboratory(True, assumptions)).verdict


def evidence_report(found: Sequence[Combination]) -> Report:
    ordered = sorted(found, key=lambda each: -each.score)
    axes = list(ordered[0].choices())
    columns = [
        *(Column(_SHORT[axis], left=True, name=axis) for axis in axes),
        Column("score", digits(".1f")), Column("reproduced", name="hold"),
    ]  # fmt: skip
    rows = [[*each.choices().values(), each.score, each.holding] for each in ordered]
    telling = discriminating(ordered)
    spread = []
    for name in telling:
        by_verdict = Counter(each.verdict_on(name) for each in ordered)
        told = ", ".join(f"{verdict} {number}" for verdict, number in by_verdict.items())
        spread.append([name, told])
    best = ordered[0].score
    open_axes = undecided(ordered)
    gap: list[Any] = ["...", *[None] * (len(columns) - 1)]
    many = len(rows) > 2 * _SHOWN
    shown = [*rows[:_SHOWN], gap, *rows[-_SHOWN:]] if many else rows
    keys = "; ".join(f"{short}: {axis}" for axis, short in _SHORT.items() if short != axis)
    text: list[list[Any]] = [
        [_RULE],
        [f"Each row is one combination; reproduced: number of claims. {keys}"],
        [Table(columns, shown)],
        [f"{counted(len(telling), 'claim')} of {len(ordered[0].verdicts)} discriminate:"],
        [Table([*words("claim"), Column("verdicts", left=True, fit="wrap")], spread)],
        [f"what remains among those of the highest score, {best:g}:"],
        [Field(f"  {axis}: ", " or ".join(values)) for axis, values in open_axes.items()],
    ]

    def record() -> dict[str, Any]:
        names = ("score", "holding", "verdicts")
        found = [x.choices() | {name: getattr(x, name) for name in names} for x in ordered]
        told = {"rule": _RULE, "combinations": found, "discriminating": telling}
        return told | {"undecided": open_axes}

    pictures = {"evidence": partial(_picture, ordered, telling)}
    return Report("claims", text, record, Table(columns, rows), pictures=pictures)


def _picture(ordered: Sequence[Combination], telling: Sequence[str]) -> Picture:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 8.0), dpi=110, layout="constrained")
    scores, verdicts = figure.subplots(2, 1, sharex=True, height_ratios=[1, 3])
    points = np.array([[POINTS.get(e.verdict_on(name), 0.0) for e in ordered] for name in telling])
    place = np.arange(1, len(ordered) + 1)
    scores.plot(place, [each.score for each in ordered], color="#1040a0", drawstyle="steps-mid")
    scores.set_ylabel("score")
    verdicts.imshow(
        points, aspect="auto", interpolation="nearest", cmap="gray_r", vmin=0.0, vmax=1.6,
        extent=(0.5, len(ordered) + 0.5, len(telling) - 0.5, -0.5),
    )  # fmt: skip
    verdicts.set_yticks(range(len(telling)), telling, fontsize=8)
    verdicts.set_xlabel(
        "combinations, the highest score first; dark: reproduced, grey: in part, white: not"
    )
    axes = list(ordered[0].choices())
    rows = [
        [k, *each.choices().values(), each.score, *(each.verdict_on(name) for name in telling)]
        for k, each in enumerate(ordered, 1)
    ]
    names = ["place", *(axis.replace(" ", "_") for axis in axes), "score", *telling]
    title = ["claims that discriminate, by combination"]
    return Picture(figure, numbers(" ".join(names), rows), title)
