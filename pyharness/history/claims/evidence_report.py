"""The report of `claims --evidence`: the score of each combination of choices."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from pyharness.history.claims.evidence import (
    POINTS,
    Combination,
    discriminating,
    evidence_rule,
    undecided,
)
from pyharness.history.claims.verdicts import NOT_TESTABLE
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

_SHOWN = 12
_SHORT = {
    "omega(0)": "omega(0)", "reading c1-for-c": "C1", "reading do-variable": "DO",
    "conjecture torque-held": "held", "conjecture initial-torque": "first", "steps": "steps",
}  # fmt: skip


def evidence_report(found: Sequence[Combination]) -> Report:
    """Return the report of the combinations, highest score first, with a picture."""
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
        by_verdict = {
            verdict: sum(_choice_of(each, name) == verdict for each in ordered)
            for verdict in dict.fromkeys(_choice_of(each, name) for each in ordered)
        }
        told = ", ".join(f"{verdict} {number}" for verdict, number in by_verdict.items())
        spread.append([name, told])
    best = ordered[0].score
    open_axes = undecided(ordered)
    gap: list[Any] = ["...", *[None] * (len(columns) - 1)]
    many = len(rows) > 2 * _SHOWN
    shown = [*rows[:_SHOWN], gap, *rows[-_SHOWN:]] if many else rows
    keys = "; ".join(f"{short}: {axis}" for axis, short in _SHORT.items() if short != axis)
    return Report(
        "claims",
        [
            [evidence_rule()],
            [f"Each row is one combination; reproduced: number of claims. {keys}"],
            [Table(columns, shown)],
            [f"{counted(len(telling), 'claim')} of {len(ordered[0].verdicts)} discriminate:"],
            [Table([*words("claim"), Column("verdicts", left=True, fit="wrap")], spread)],
            [f"what remains among those of the highest score, {best:g}:"],
            [Field(f"  {axis}: ", " or ".join(values)) for axis, values in open_axes.items()],
        ],
        record=lambda: {
            "rule": evidence_rule(),
            "combinations": [
                {**each.choices(), "score": each.score, "holding": each.holding,
                 "verdicts": each.verdicts}
                for each in ordered
            ],
            "discriminating": telling,
            "undecided": open_axes,
        },
        data=Table(columns, rows),
        pictures={"evidence": partial(_picture, ordered, telling)},
    )  # fmt: skip


def _choice_of(combination: Combination, name: str) -> str:
    return combination.verdicts.get(name, NOT_TESTABLE)


def _picture(ordered: Sequence[Combination], telling: Sequence[str]) -> Picture:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 8.0), dpi=110, layout="constrained")
    scores, verdicts = figure.subplots(2, 1, sharex=True, height_ratios=[1, 3])
    points = np.array([[POINTS.get(_choice_of(e, name), 0.0) for e in ordered] for name in telling])
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
        [k, *each.choices().values(), each.score, *(_choice_of(each, name) for name in telling)]
        for k, each in enumerate(ordered, 1)
    ]
    names = ["place", *(axis.replace(" ", "_") for axis in axes), "score", *telling]
    return Picture(
        figure, numbers(" ".join(names), rows), ["claims that discriminate, by combination"]
    )
