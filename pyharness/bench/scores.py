"""Contenders' times to reach target errors, and a baseline's times divided by them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pyharness.bench.measure import TARGETS, Finding, Row, Workload

# The first of these contenders that was measured is the baseline.
YARDSTICKS = ("heyoka", "solve_ivp-dop853")


@dataclass(frozen=True)
class Score:
    """A contender's times to reach target errors on a workload."""

    method: str
    # For each target error, the time (s) of the fastest setting that reaches it, or None.
    seconds: tuple[float | None, ...]
    best: float | None  # the smallest error of any setting
    # The baseline's times divided by `seconds`: above 1 if this contender is faster.
    ratios: tuple[float | None, ...]


@dataclass(frozen=True)
class Spread:
    """The distribution of a contender's ratios over the random scenes of one kind."""

    method: str
    kind: str
    target: float  # target error, as in `Row.error`
    scenes: int
    reached: int  # number of scenes in which contender and baseline reach the target error
    mean: float | None  # geometric mean over these scenes
    smallest: float | None
    quartiles: tuple[float | None, float | None, float | None]


def yardstick(finding: Finding) -> str | None:
    """Return the baseline's name, or None if nothing was measured."""
    names = list(dict.fromkeys(row.method for row in finding.rows))
    return next((name for name in (*YARDSTICKS, *names) if name in names), None)


def scores(finding: Finding, load: Workload, targets: Sequence[float] = TARGETS) -> list[Score]:
    """Return each contender's score on a workload, the baseline's first."""
    rows: dict[str, list[Row]] = {}
    for row in finding.rows:
        if row.workload == load:
            rows.setdefault(row.method, []).append(row)
    first = yardstick(finding)
    names = sorted(rows, key=lambda name: name != first)
    by = [_time_to(rows.get(first or "", []), target) for target in targets]
    found = []
    for name in names:
        seconds = tuple(_time_to(rows[name], target) for target in targets)
        errors = [row.error for row in rows[name] if row.error is not None]
        ratios = tuple(map(_ratio, by, seconds))
        found.append(Score(name, seconds, min(errors, default=None), ratios))
    return found


def _ratios(finding: Finding, load: Workload) -> dict[str, tuple[float | None, ...]]:
    return {each.method: each.ratios for each in scores(finding, load)}


def groups(finding: Finding) -> dict[str, list[Workload]]:
    found: dict[str, list[Workload]] = {}
    for load in finding.workloads:
        found.setdefault(load.group, []).append(load)
    return dict(sorted(found.items(), key=lambda item: (item[1][0].horizon, item[0])))


def means(finding: Finding, loads: Sequence[Workload]) -> dict[str, list[float | None]]:
    """Return each contender's geometric mean ratios over `loads`, one for each target error.

    A mean is None if a ratio is missing.
    """
    tables = [_ratios(finding, load) for load in loads]
    names = dict.fromkeys(name for table in tables for name in table)
    nowhere = (None,) * len(TARGETS)
    found = {}
    for name in names:
        by_target = zip(*(table.get(name, nowhere) for table in tables), strict=True)
        found[name] = list(map(geometric_mean, by_target))
    return found


def spreads(finding: Finding, kinds: Sequence[str]) -> list[Spread]:
    """Return distributions of ratios by contender (not the baseline), target error and kind."""
    tables = {load.label: _ratios(finding, load) for load in finding.workloads}
    names = dict.fromkeys(name for table in tables.values() for name in table)
    first, found = yardstick(finding), []
    for name, place, kind in product(names, range(len(TARGETS)), kinds):
        tables_of = [tables[load.label] for load in finding.workloads if kind in load.kinds]
        if tables_of and name != first:
            found.append(_spread(name, kind, place, [each.get(name) for each in tables_of]))
    return found


def _spread(
    name: str, kind: str, place: int, found: Sequence[tuple[float | None, ...] | None]
) -> Spread:
    known = [each[place] for each in found if each is not None]
    ratios = [ratio for ratio in known if ratio is not None]
    low, middle, high = np.percentile(ratios, (25, 50, 75)).tolist() if ratios else [None] * 3
    mean = geometric_mean(ratios) if ratios else None
    least, quartiles = min(ratios, default=None), (low, middle, high)
    return Spread(name, kind, TARGETS[place], len(found), len(ratios), mean, least, quartiles)


def _time_to(rows: Sequence[Row], target: float) -> float | None:
    reaching = [row for row in rows if row.error is not None and row.error <= target]
    return min((row.seconds for row in reaching if row.seconds is not None), default=None)


def _ratio(by: float | None, seconds: float | None) -> float | None:
    return by / seconds if by is not None and seconds else None


def geometric_mean(ratios: Sequence[float | None]) -> float | None:
    known = [ratio for ratio in ratios if ratio is not None]
    if len(known) < len(ratios):
        return None
    return math.exp(math.fsum(map(math.log, known)) / len(known))
