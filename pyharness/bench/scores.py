"""What the rows of a benchmark come to: time to an error, ratios, geometric means."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pyharness.bench.measure import TARGETS, Finding, Row, Workload

# The first of these that took part is the one others are measured by.
YARDSTICKS = ("heyoka", "solve_ivp-dop853")


@dataclass(frozen=True)
class Score:
    """A contender on one workload."""

    method: str
    seconds: tuple[float | None, ...]  # of the fastest setting with an error of each of `TARGETS`
    best: float | None  # the smallest error of any setting
    ratios: tuple[float | None, ...]  # time of the yardstick over its own: above 1 it is faster


def yardstick(finding: Finding) -> str | None:
    """Return the contender that others are measured by; None where nothing was measured."""
    names = list(dict.fromkeys(row.method for row in finding.rows))
    return next((name for name in (*YARDSTICKS, *names) if name in names), None)


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


def means(finding: Finding, loads: Sequence[Workload]) -> dict[str, list[float | None]]:
    """Return geometric means over `loads`; None where an error was not reached in all of them."""
    tables = [{each.method: each.ratios for each in scores(finding, load)} for load in loads]
    names = dict.fromkeys(name for table in tables for name in table)
    nowhere = (None,) * len(TARGETS)
    return {
        name: list(
            map(_geometric_mean, zip(*(table.get(name, nowhere) for table in tables), strict=True))
        )
        for name in names
    }


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
    if len(known) < len(ratios):
        return None
    return math.exp(math.fsum(map(math.log, known)) / len(known))
