"""What the rows of a benchmark come to: time to an error, ratios, geometric means."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pyharness.bench.measure import TARGETS, Finding, Row, Workload

# The first of these that took part is the one others are measured by.
YARDSTICKS = ("heyoka", "solve_ivp-dop853")


@dataclass(frozen=True)
class Score:
    """A contender on one workload.

    Attributes
    ----------
    method : str
        Its name.
    seconds : tuple of (float or None)
        Time of the fastest setting whose error is at most each of `TARGETS`.
    best : float or None
        The smallest error of any setting.
    ratios : tuple of (float or None)
        Time of the yardstick over its own: above 1 it is faster.
    """

    method: str
    seconds: tuple[float | None, ...]
    best: float | None
    ratios: tuple[float | None, ...]


@dataclass(frozen=True)
class Mean:
    """Geometric means of the ratios of a contender over the workloads of a group."""

    method: str
    ratios: tuple[float | None, ...]


def yardstick(finding: Finding) -> str | None:
    """Return the contender that others are measured by; None where nothing was measured."""
    names = list(dict.fromkeys(row.method for row in finding.rows))
    for name in YARDSTICKS:
        if name in names:
            return name
    return names[0] if names else None


def scores(finding: Finding, load: Workload) -> list[Score]:
    """Return the contenders of a workload, the yardstick first, the others as they came."""
    rows: dict[str, list[Row]] = {}
    for row in finding.rows:
        if row.workload == load:
            rows.setdefault(row.method, []).append(row)
    first = yardstick(finding)
    names = sorted(rows, key=lambda name: name != first)
    by = [_time_to(rows.get(first or "", []), target) for target in TARGETS]
    found = []
    for name in names:
        seconds = tuple(_time_to(rows[name], target) for target in TARGETS)
        errors = [row.error for row in rows[name] if row.error is not None]
        ratios = tuple(map(_ratio, by, seconds))
        found.append(Score(name, seconds, min(errors, default=None), ratios))
    return found


def groups(finding: Finding) -> dict[str, list[Workload]]:
    """Return the workloads whose ratios are averaged, by the name of the group."""
    found: dict[str, list[Workload]] = {}
    for load in finding.workloads:
        found.setdefault(load.group, []).append(load)
    return dict(sorted(found.items(), key=lambda item: (item[1][0].horizon, item[0])))


def means(finding: Finding, loads: Sequence[Workload]) -> list[Mean]:
    """Return geometric means over `loads`; None where an error was not reached in all of them."""
    tables = [{score.method: score for score in scores(finding, load)} for load in loads]
    names = list(dict.fromkeys(name for table in tables for name in table))
    found = []
    for name in names:
        columns = []
        for index in range(len(TARGETS)):
            ratios = [table[name].ratios[index] if name in table else None for table in tables]
            columns.append(_geometric_mean(ratios))
        found.append(Mean(name, tuple(columns)))
    return found


def _time_to(rows: Sequence[Row], target: float) -> float | None:
    times = [
        row.seconds
        for row in rows
        if row.error is not None and row.seconds is not None and row.error <= target
    ]
    return min(times, default=None)


def _ratio(by: float | None, seconds: float | None) -> float | None:
    return by / seconds if by is not None and seconds else None


def _geometric_mean(ratios: Sequence[float | None]) -> float | None:
    known = [ratio for ratio in ratios if ratio is not None]
    if not known or len(known) < len(ratios):
        return None
    return math.exp(math.fsum(map(math.log, known)) / len(known))
