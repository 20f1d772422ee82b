"""The table of `stress`: for each trial what was tried, and a row for each method."""

from collections.abc import Sequence

from pyharness.compare.checks import Check
from pyharness.compare.checks_report import failure_lines, few_lines, verdict
from pyharness.stress.run import Trial
from pyharness.views.text import WIDTH, aligned, short, wrapped

_HEAD = ("method", "checks", "failed", "bounded", "share", "value", "limit", "worst at")
_NOTE = (
    "bounded: checks with a bound, the rest describe; share: of the bound that the worst takes, "
    "value and limit its own (without a bound: the largest value)"
)


def stress_table(trials: Sequence[Trial], checks: Sequence[Check]) -> str:
    """Return the failures, then a table for each trial."""
    failures = failure_lines(checks) + few_lines(checks)
    lines = [*failures, ""] if failures else []
    for each in trials:
        own = [check for check in checks if check.kind == each.name]
        if not own:
            continue
        lines += wrapped(f"{each.name}: {each.title}")
        lines += wrapped(f"  bound: {each.bound}")
        lines += ["", *_rows(own), ""]
    lines += [*wrapped(_NOTE), verdict(checks)]
    return "\n".join(lines) + "\n"


def _rows(checks: Sequence[Check]) -> list[str]:
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault(check.id.split("/")[1], []).append(check)
    rows = []
    for name, members in groups.items():
        judged = [check for check in members if check.limit is not None]
        failed = sum(not check.passed for check in members)
        worst = max(judged, key=severity, default=None)
        if worst is None:
            worst = max(members, key=lambda check: _size(check.value))
        share = "-" if worst.limit is None else short(severity(worst)[1])
        where = "/".join(worst.id.split("/")[2:]) or "-"
        row = [name, str(len(members)), str(failed), str(len(judged)), share]
        rows.append([*row, short(worst.value), short(worst.limit), where])
    return _left_last(aligned(_HEAD, rows, left=1), rows)


def _left_last(lines: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines with their last column to the left, cut where it does not fit."""
    width = max(len(row[-1]) for row in [_HEAD, *rows])
    before = max(map(len, lines)) - width
    cells = [_HEAD[-1], *(row[-1] for row in rows)]
    return [(line[:before] + cell)[:WIDTH] for line, cell in zip(lines, cells, strict=True)]


def severity(check: Check) -> tuple[bool, float]:
    """Return what orders checks: those that failed last, then by their share of the limit."""
    if check.value is None or check.limit is None:
        return not check.passed, 0.0
    if check.limit == 0.0:
        return not check.passed, 0.0 if check.value == 0.0 else float("inf")
    share = abs(check.value) / check.limit
    # NaN compares with nothing.
    return not check.passed, share if share == share else float("inf")


def _size(value: float | None) -> float:
    return -1.0 if value is None else value if value == value else float("inf")
