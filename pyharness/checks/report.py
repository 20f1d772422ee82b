"""The report of checks: each failure, a summary by kind, the JSON record, the JUnit cases."""

import math
from collections.abc import Sequence
from typing import Any

from pyharness.checks.check import Check, Sample, severity
from pyharness.model.records import build_record
from pyharness.model.report import Column, Line, Report, Section, Table, counted, short, words

_MOST_FAILURES = 50
_FEW = 10  # up to this number of checks, passed checks are shown too
_GROUPS = (
    *words("checks"), Column("made"), Column("failed"), Column("worst/limit", short),
)  # fmt: skip


def checks_report(
    verb: str, checks: Sequence[Check], text: Sequence[Section], **extra: Any
) -> Report:
    """Return the report of the checks that a command made, for the screen and for files.

    `verb` is the name of the command, and `text` has the sections for the screen. For files there
    are a JSON record, which also has the fields `extra`, and JUnit test cases.
    """
    return Report(
        verb,
        text,
        record=lambda: {
            "checks": [check.record() for check in checks],
            "passed": all(check.passed for check in checks),
            **extra,
            "build": build_record(),
        },
        cases=[(each.suite, each.id, _failure(each), each.replay) for each in checks],
    )


def _failure(check: Check) -> str:
    if check.passed:
        return ""
    note = f": {check.note}" if check.note else ""
    return f"{short(check.value)}, limit {short(check.limit)}{note}"


def summary(
    title: Sequence[str], checks: Sequence[Check], depth: int = 1, more: Section = ()
) -> list[Section]:
    """Return the printed sections: title, failures, a table of groups of checks, and verdict.

    A group consists of the checks whose ids have the first `depth` parts in common. The section
    `more` is printed between the table and the verdict. The verdict is a line with the numbers of
    all checks and of the failed ones.
    """
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault("/".join(check.id.split("/")[:depth]), []).append(check)
    rows = []
    for name, members in groups.items():
        worst = max((severity(check)[1] for check in members if check.limit), default=None)
        rows.append([name, len(members), sum(not check.passed for check in members), worst])
    return [title, listed_singly(checks), [Table(_GROUPS, rows)], more, [verdict(checks)]]


def listed_singly(checks: Sequence[Check]) -> list[str]:
    """Return lines that show each failed check, with the command that repeats it.

    At most `_MOST_FAILURES` failed checks are shown. If `checks` has at most `_FEW` elements, the
    lines also show the checks that passed.
    """
    failed = [check for check in checks if not check.passed]
    lines = []
    for check in failed[:_MOST_FAILURES]:
        # The command is never shortened, so that it can be copied.
        lines += [f"FAILED {check.id}{_seen(check, ' > ')}", Line(f"  {check.replay}")]
    if len(failed) > _MOST_FAILURES:
        lines.append(f"... and {len(failed) - _MOST_FAILURES} more; --format json tells all")
    if len(checks) <= _FEW:
        lines += [f"{each.id}:{_seen(each, ', limit ')}" for each in checks if each.passed]
    return lines


def _seen(check: Check, against: str) -> str:
    found = "" if check.value is None else f" {short(check.value)}"
    allowed = "" if check.limit is None else f"{against}{short(check.limit)}"
    return f"{found}{allowed}" + (f" ({check.note})" if check.note else "")


_BANDS = ((1e-6, "1e-3 to 1e-6"), (1e-9, "1e-6 to 1e-9"), (0.0, "finer"))
_GROWTHS = (10.0, 1e3, math.inf)
_SAMPLES = (
    *words("entrance tolerance"), Column("K<10"), Column("worst", short),
    Column("K<1e3"), Column("worst", short), Column("K>1e3"), Column("worst", short),
)  # fmt: skip


def samples(checks: Sequence[Check], rounding: float) -> Section:
    """Return a table of the worst ratio of error to tolerance, by entry point and tolerance.

    Only checks in random scenes (class `Sample`) are counted. An entry point is a call with a
    method, as in ``solve-taylor``. Before an error is divided by the tolerance, the rounding error
    is subtracted from it. This rounding error is `rounding`, a relative error, times the error
    amplification. For each of three ranges of the error amplification, the table shows the number
    of checks with a result and the worst ratio.
    """
    cells: dict[tuple[str, str], list[list[float]]] = {}
    for check in checks:
        if isinstance(check, Sample) and check.value is not None:
            band = next(name for least, name in _BANDS if check.tolerance >= least)
            column = next(k for k, most in enumerate(_GROWTHS) if check.growth < most)
            over = (check.value - rounding * check.growth) / check.tolerance
            cells.setdefault((check.entrance, band), [[], [], []])[column].append(max(0.0, over))
    if not cells:
        return []
    bands = [name for _, name in _BANDS]
    rows = [
        [*key, *(x for values in cells[key] for x in (len(values), max(values, default=None)))]
        for key in sorted(cells, key=lambda each: (each[0], bands.index(each[1])))
    ]
    told = "worst: (error - 2e-15 K) / tolerance, with K the error amplification:"
    return [told, Table(_SAMPLES, rows)]


def verdict(checks: Sequence[Check]) -> str:
    """Return a line with the number of checks and the number of failed ones."""
    failed = sum(not check.passed for check in checks)
    made = counted(len(checks), "check")
    return f"{made}, {failed} failed" if failed else f"{made}, all well"
