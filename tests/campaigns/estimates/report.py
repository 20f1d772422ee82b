"""Report of a campaign: errors above the limit, estimates by kind, unreported loss of digits."""

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from pyharness.model.report import Column, Report, Section, Table, digits, short
from tests.campaigns.estimates.campaign import ENTRANCES, Answer
from tests.campaigns.estimates.scenes import KINDS

_WORST = 8
_ULP = 2.0**-53  # errors below it are rounding errors of the result alone
_KNOWN = 1e13  # K above which a ratio to it is meaningless
_FEW = 1e3  # K below which second runs are counted


def report(found: Sequence[Answer], seed: str) -> Report:
    """Return the tables of a campaign."""
    scenes = len({each.draw.number for each in found})
    text: list[Section] = [[f"{scenes} scenes of seed {seed}, {len(found)} answers"]]
    text += [_entrances(found), _worst(found), _endings(found), _kinds(found)]
    for entrance in ENTRANCES:
        text += _estimates([each for each in found if each.entrance == entrance], entrance)
    return Report("estimates", text, dict)


def _entrances(found: Sequence[Answer]) -> Section:
    rows = []
    for entrance in ENTRANCES:
        some = [each for each in found if each.entrance == entrance]
        judged = [each for each in some if each.is_judged]
        due = [each for each in some if each.lost > 3.0]
        runs = [each.runs for each in judged if each.runs and each.draw.truth.growth < _FEW]
        rows.append(
            [
                entrance,
                len(some),
                len(judged),
                sum(each.exceeds for each in some),
                max((each.error / each.limit for each in judged), default=None),
                len(due),
                sum(each.is_silent for each in some),
                sum(each.is_false_alarm for each in some),
                sum(each.is_unfinished for each in some),
                sum(each.is_low for each in some),
                sum(each.is_blind for each in some),
                100.0 * sum(run > 1 for run in runs) / len(runs) if runs else None,
            ]
        )
    columns = [Column("entrance", left=True), Column("answers"), Column("K < 1e6")]
    columns += [Column("exceed"), Column("worst", short), Column("due"), Column("silent")]
    columns += [Column("alarms"), Column("no end"), Column("low"), Column("blind")]
    columns += [Column("2nd, %", digits(".1f"))]
    return [
        "exceed: error above tolerance + 4e-15 K at K < 1e6, worst: over that; due: rounding times "
        "K above 3 tolerances, silent: not `sensitive` there; alarms: `sensitive` below 1/30; no "
        "end: neither complete nor sensitive at K < 1e6; low, blind: reported error below a tenth, "
        "a hundredth of the true one; 2nd: second runs at K < 1e3",
        Table(columns, rows),
    ]


def _worst(found: Iterable[Answer]) -> Section:
    """List the worst scenes of each fault, which `--only NUMBER` repeats."""
    faults: list[tuple[str, Callable[[Answer], bool], Callable[[Answer], float]]] = [
        ("exceeds", lambda each: each.exceeds, lambda each: each.error / each.limit),
        ("silent", lambda each: each.is_silent, lambda each: each.lost),
        ("false alarm", lambda each: each.is_false_alarm, lambda each: 1.0 / each.lost),
        ("unfinished", lambda each: each.is_unfinished, lambda each: each.draw.truth.turns),
        ("low", lambda each: each.is_low, lambda each: 1.0 / max(each.seen or 0.0, 1e-300)),
    ]
    rows = []
    for name, applies, size in faults:
        by_number: dict[int, Answer] = {}
        for each in sorted(filter(applies, found), key=size, reverse=True):
            by_number.setdefault(each.draw.number, each)
        for number, each in itertools.islice(by_number.items(), _WORST):
            of = each.draw
            values = [of.tolerance, of.truth.growth, each.error, each.estimate, each.growth]
            rows.append([name, number, each.entrance, *values, ", ".join(of.kinds[1:-1])])
    if not rows:
        return ["no faults"]
    columns = [Column("fault", left=True), Column("--only"), Column("entrance", left=True)]
    columns += [Column(head, short) for head in ("tolerance", "K", "error", "estimate", "growth")]
    return [Table([*columns, Column("kinds", left=True, fit="cut")], rows)]


def _endings(found: Iterable[Answer]) -> Section:
    counts = Counter((each.entrance, each.ended.partition(":")[0]) for each in found)
    rows = [[*key, count] for key, count in sorted(counts.items())]
    return [Table([Column("entrance", left=True), Column("ended", left=True), Column("n")], rows)]


def _kinds(found: Sequence[Answer]) -> Section:
    """List the kinds of scenes drawn, and the ratios of the series' errors to the tolerance."""
    rows = []
    for kind in KINDS:
        some = [e for e in found if e.entrance == "solve taylor" and kind in e.draw.kinds]
        if not some:
            continue
        growth = np.array([each.draw.truth.growth for each in some])
        turns = [each.draw.truth.turns for each in some]
        use = [each.error / each.draw.tolerance for each in some if each.is_judged]
        rows.append(
            [
                kind, len(some), float(np.median(turns)), *_quantiles(growth, (50, 95)),
                *(100.0 * float(np.mean(growth >= least)) for least in (1e3, 1e6, 1e13)),
                *_quantiles(use, (50, 99, 100)),
            ]
        )  # fmt: skip
    columns = [Column("kind", left=True), Column("scenes"), Column("turns", digits(".2g"))]
    columns += [Column("K", short), Column("95 %", short)]
    columns += [Column(f"%>{least}", digits(".0f")) for least in ("1e3", "1e6", "1e13")]
    columns += [Column("error", short), Column("99 %", short), Column("most", short)]
    return [
        "scenes, their K (median, 95 %), and the error of `solve taylor` over the tolerance at "
        "K < 1e6 (median, 99 %)",
        Table(columns, rows),
    ]


def _estimates(found: Sequence[Answer], entrance: str) -> list[Section]:
    """Compare the reported errors and amplifications with the true ones."""
    rows = []
    for kind in KINDS:
        some = [each for each in found if kind in each.draw.kinds]
        errors = [
            each.estimate / max(each.error, _ULP)
            for each in some
            if each.estimate is not None and each.lost < 1.0 and each.error < 1.0
        ]
        growths = [
            each.growth / each.draw.truth.growth
            for each in some
            if each.growth is not None and each.draw.truth.growth < _KNOWN
        ]
        if errors or growths:
            said = [len(errors), *_quantiles(errors, (1, 50, 99))]
            rows.append([kind, *said, len(growths), *_quantiles(growths, (0, 1, 50, 99, 100))])
    if not rows:
        return []
    columns = [Column("kind", left=True), Column("errors")]
    columns += [Column(head, short) for head in ("1 %", "median", "99 %")]
    columns += [Column("growths")]
    columns += [Column(head, short) for head in ("least", "1 %", "median", "99 %", "most")]
    text = (
        f"{entrance}: estimate over error (at least 2^-53; where K leaves a digit), growth over K "
        "(below 1e13)"
    )
    return [[text, Table(columns, rows)]]


def _quantiles(values: Iterable[float], percents: Sequence[int]) -> list[float | None]:
    given = list(values)
    if not given:
        return [None] * len(percents)
    # No interpolation, because infinity minus infinity is not a number.
    return [float(x) for x in np.percentile(given, percents, method="nearest")]
