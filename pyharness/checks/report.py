"""Reports of checks as text, Markdown page, JSON record and JUnit cases."""

import math
from collections import Counter
from collections.abc import Sequence
from itertools import chain
from typing import Any

from pyharness.checks.check import Check, Sample, severity
from pyharness.model.basis import MARKS
from pyharness.model.records import build_record
from pyharness.model.report import Column, Line, Report, Section, Table, counted, short, words
from pyharness.truth.bounded import ESTIMATED, PROVED, joined

_MOST_FAILURES = 50
_MOST_ON_PAGE = 10
_FEW = 10  # most checks of which passed ones are shown too
_GROUPS = (
    *words("checks"), Column("made"), Column("failed"), Column("worst/limit", short),
    *words("basis"),
)  # fmt: skip


def checks_report(
    verb: str,
    checks: Sequence[Check],
    text: Sequence[Section],
    page: Sequence[Section] | None = None,
    **extra: Any,
) -> Report:
    """Return the report of a command's checks; `extra` are further JSON fields."""
    return Report(
        verb,
        text,
        record=lambda: {
            "checks": [check.record() for check in checks],
            "passed": all(check.passed for check in checks),
            **extra,
            "build": build_record(),
        },
        page=summary_page(verb, checks) if page is None else page,
        cases=[(each.suite, each.id, _failure(each), each.replay, each.took) for each in checks],
    )


def summary_page(
    verb: str,
    checks: Sequence[Check],
    title: Sequence[str] = (),
    depth: int = 1,
    more: Sequence[Section] = (),
) -> list[Section]:
    """Return a Markdown page: verdict, table of checks by `depth` parts of their ids, failures."""
    failed = [check for check in checks if not check.passed]
    lines: list[str] = []
    for check in failed[:_MOST_ON_PAGE]:
        seen = f"{check.id}{_format_outcome(check, ' > ')}"
        lines += [Line(f"- FAILED {_code(seen)}  "), Line(f"  {_code(check.replay)}")]
    if len(failed) > _MOST_ON_PAGE:
        lines.append(f"- ... and {len(failed) - _MOST_ON_PAGE} more")
    head = [Line(f"## {verb}: {verdict(checks)}")]
    told: Section = [Line(f"{_code(line)}  ") for line in title]
    sections: list[Section] = [head, told, [_groups(checks, depth)], lines, *more]
    return [section for section in sections if section]


def _code(text: str) -> str:
    """Return Markdown code, because a port's text might contain links or tags."""
    return f"`{text.replace('`', chr(39))}`"


def _failure(check: Check) -> str:
    if check.passed:
        return ""
    if check.note and check.value is None and check.limit is None:
        return check.note
    note = f": {check.note}" if check.note else ""
    mark = f" ({check.mark})" if check.mark else ""
    return f"{short(check.value)}, limit {short(check.limit)}{mark}{note}"


def marks(checks: Sequence[Check]) -> str:
    """Return how the limits were set, as in ``proved, derived``, or "-" without limits."""
    found = {check.mark for check in checks}
    return ", ".join(mark for mark in MARKS if mark in found) or "-"


def basis_note(checks: Sequence[Check]) -> list[str]:
    """Return a legend of the marks with the number of limits of each, or [] without limits."""
    counts = Counter(check.mark for check in checks if check.mark)
    told = ", ".join(f"{counts[mark]} {mark}" for mark in MARKS)
    legend = (
        "basis: how a limit was set: proved by a theorem, derived by a formula with assumptions, "
        f"or measured in runs. Limits here: {told}."
    )
    return [legend] if counts else []


def summary(
    title: Sequence[str], checks: Sequence[Check], depth: int = 1, more: Section = ()
) -> list[Section]:
    """Return a text: title, failures, table of checks by `depth` parts of their ids, verdict."""
    table: Section = [*basis_note(checks), _groups(checks, depth)]
    return [title, listed_singly(checks), table, more, [verdict(checks)]]


def _groups(checks: Sequence[Check], depth: int) -> Table:
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault("/".join(check.id.split("/")[:depth]), []).append(check)
    rows = []
    for name, members in groups.items():
        worst = max((severity(check)[1] for check in members if check.limit), default=None)
        failed = sum(not check.passed for check in members)
        rows.append([name, len(members), failed, worst, marks(members)])
    return Table(_GROUPS, rows)


def listed_singly(checks: Sequence[Check]) -> list[str]:
    """Return lines on failed checks with commands to repeat them and, if few, on passed checks."""
    failed = [check for check in checks if not check.passed]
    lines = []
    for check in failed[:_MOST_FAILURES]:
        # The command is not shortened, so that it can be copied.
        lines += [f"FAILED {check.id}{_format_outcome(check, ' > ')}", Line(f"  {check.replay}")]
    if len(failed) > _MOST_FAILURES:
        lines.append(f"... and {len(failed) - _MOST_FAILURES} more; --format json tells all")
    few = [check for check in checks if check.passed] if len(checks) <= _FEW else []
    return lines + [f"{each.id}:{_format_outcome(each, ', limit ')}" for each in few]


def _format_outcome(check: Check, against: str) -> str:
    found = "" if check.value is None else f" {short(check.value)}"
    if check.value is not None and check.limit is not None and check.value <= check.limit:
        against = ", limit "  # the fault is not the value, but described in `note`
    allowed = "" if check.limit is None else f"{against}{short(check.limit)}"
    told = "; ".join(filter(None, (check.mark, check.note)))
    return f"{found}{allowed}" + (f" ({told})" if told else "")


_BANDS = ((1e-6, "1e-3 to 1e-6"), (1e-9, "1e-6 to 1e-9"), (0.0, "finer"))
_GROWTHS = (10.0, 1e3, math.inf)
_SAMPLES = (
    *words("entrance tolerance"), Column("K<10"), Column("worst", short),
    Column("K<1e3"), Column("worst", short), Column("K>1e3"), Column("worst", short),
)  # fmt: skip


def samples(checks: Sequence[Check], rounding: float) -> Section:
    """Return a table of the largest ratios of error, without amplified rounding, to tolerance."""
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
    rows: list[list[Any]] = []
    for key in sorted(cells, key=lambda each: (each[0], bands.index(each[1]))):
        pairs = ((len(values), max(values, default=None)) for values in cells[key])
        rows.append([*key, *chain.from_iterable(pairs)])
    told = "worst: (error - 2e-15 K) / tolerance, with K the error amplification:"
    return [told, Table(_SAMPLES, rows)]


def references(checks: Sequence[Check]) -> Section:
    """Return lines on the references' largest proved and largest estimated error, and warnings."""
    bounds = [each.reference_bound() for each in checks if each.reference_bound is not None]
    known = [each for each in bounds if each is not None]
    lines = []
    for basis in (PROVED, ESTIMATED):
        some = [each for each in known if each.basis == basis]
        if some:
            most, count = joined(some).text(""), counted(len(some), "check")
            lines.append(f"error of the reference, relative or in rad, at most {most} in {count}")
    warnings = dict.fromkeys(each.warning for each in known if each.warning)
    return lines + [f"WARNING: {each}" for each in warnings]


def verdict(checks: Sequence[Check]) -> str:
    failed = sum(not check.passed for check in checks)
    made = counted(len(checks), "check")
    return f"{made}, {failed} failed" if failed else f"{made}, all well"
