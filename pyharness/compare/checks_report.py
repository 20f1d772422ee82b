"""Views of checks: a line for each failure and a summary by kind, JSON, JUnit's XML."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pyharness.compare.checks import Check, Sample
from pyharness.model.build import Build
from pyharness.views.text import aligned, counted, short, wrapped

if TYPE_CHECKING:
    from pyharness.verify.plants.self_test import Caught

_MOST_FAILURES = 50
_FEW = 10  # checks, each of which is told


def failure_lines(checks: Sequence[Check]) -> list[str]:
    """Return two lines for each check that failed: what is wrong, and how to see it again."""
    failed = [check for check in checks if not check.passed]
    lines = []
    for check in failed[:_MOST_FAILURES]:
        found = "" if check.value is None else f" {short(check.value)}"
        allowed = "" if check.limit is None else f" > {short(check.limit)}"
        note = f" ({check.note})" if check.note else ""
        lines += wrapped(f"FAILED {check.id}{found}{allowed}{note}")
        # Whole, however long: it is there to be copied.
        lines.append(f"  {check.replay}")
    if len(failed) > _MOST_FAILURES:
        lines.append(f"... and {len(failed) - _MOST_FAILURES} more; --format json tells all")
    return lines


def few_lines(checks: Sequence[Check]) -> list[str]:
    """Return a line for each check that passed, with what was seen, where there are but few."""
    if len(checks) > _FEW:
        return []
    lines = []
    for check in checks:
        if check.passed:
            found = "" if check.value is None else f" {short(check.value)}"
            allowed = "" if check.limit is None else f", limit {short(check.limit)}"
            note = f" ({check.note})" if check.note else ""
            lines += wrapped(f"{check.id}:{found}{allowed}{note}")
    return lines


def checks_table(
    title: Sequence[str], checks: Sequence[Check], depth: int = 1, more: Sequence[str] = ()
) -> str:
    """Return the failures, then a row for each group of checks that share `depth` parts.

    `more` are lines between these rows and the verdict.
    """
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault("/".join(check.id.split("/")[:depth]), []).append(check)
    rows = []
    for name, members in groups.items():
        judged = [check for check in members if check.limit]
        worst = max(judged, key=_share, default=None)
        failed = sum(not check.passed for check in members)
        share = "-" if worst is None else short(_share(worst))
        rows.append([name, str(len(members)), str(failed), share])
    failures = failure_lines(checks) + few_lines(checks)
    lines = [line for each in title for line in wrapped(each)]
    lines += [""] if title else []
    lines += [*failures, ""] if failures else []
    lines += aligned(["checks", "made", "failed", "worst/limit"], rows, left=1)
    lines += ["", *more] if more else []
    lines += ["", verdict(checks)]
    return "\n".join(lines) + "\n"


_BANDS = ((1e-6, "1e-3 to 1e-6"), (1e-9, "1e-6 to 1e-9"), (0.0, "finer"))
_GROWTHS = ((0.0, 10.0), (10.0, 1e3), (1e3, math.inf))


def samples_lines(checks: Sequence[Check], rounding: float) -> list[str]:
    """Return a row for each entrance and band of tolerances: the worst error over the tolerance.

    What rounding makes, `rounding` for each factor of growth, is taken off the error. Columns are
    the growth of small differences: checks with a result, and the worst of them.
    """
    cells: dict[tuple[str, str], list[list[float]]] = {}
    for check in checks:
        if isinstance(check, Sample) and check.value is not None:
            band = next(name for least, name in _BANDS if check.tolerance >= least)
            column = next(k for k, (_, most) in enumerate(_GROWTHS) if check.growth < most)
            over = (check.value - rounding * check.growth) / check.tolerance
            cells.setdefault((check.entrance, band), [[], [], []])[column].append(max(0.0, over))
    if not cells:
        return []
    bands = [name for _, name in _BANDS]
    rows = []
    for entrance, band in sorted(cells, key=lambda each: (each[0], bands.index(each[1]))):
        row = [entrance, band]
        for values in cells[entrance, band]:
            row += [str(len(values)), short(max(values)) if values else "-"]
        rows.append(row)
    head = ["entrance", "tolerance", "K<10", "worst", "K<1e3", "worst", "K>1e3", "worst"]
    text = "worst: error less rounding (2e-15 K) over the tolerance; K: growth of a difference"
    return [*aligned(head, rows, left=2), *wrapped(text)]


def self_test_table(title: Sequence[str], found: Sequence["Caught"]) -> str:
    """Return a paragraph for each plant: the fault, and how many checks of each kind caught it."""
    lines = [line for each in title for line in wrapped(each)]
    lines += [""] if title else []
    for caught in found:
        name, fault = "none", "no fault: nothing may fail"
        if caught.plant is not None:
            name, fault = caught.plant.name, caught.plant.fault
        counts = ", ".join(f"{kind} {count}" for kind, count in caught.failed.items())
        told = f"caught by {counts} ({caught.example})" if counts else "nothing fails"
        lines += wrapped(f"{'' if caught.passed else 'FAILED '}{name}: {fault}")
        lines += wrapped(f"  {told}")
    missed = sum(not caught.passed for caught in found)
    plants = len(found) - 1
    end = f"{missed} not as it should be" if missed else "each caught by more than the record"
    return "\n".join([*lines, "", f"{plants} plants and a control: {end}"]) + "\n"


def verdict(checks: Sequence[Check]) -> str:
    """Say in a line how many checks were made and how many failed."""
    failed = sum(not check.passed for check in checks)
    made = counted(len(checks), "check")
    return f"{made}, {failed} failed" if failed else f"{made}, all well"


def checks_record(checks: Sequence[Check], build: Build, **extra: Any) -> dict[str, Any]:
    """Return the record of `verify` and `stress`."""
    from pyharness.views.records import SCHEMA

    return {
        "schema": SCHEMA,
        "checks": [asdict(check) for check in checks],
        "passed": all(check.passed for check in checks),
        **extra,
        "build": asdict(build),
    }


def junit_text(name: str, checks: Sequence[Check]) -> str:
    """Return the XML that services for continuous integration read."""
    from xml.etree import ElementTree as xml

    suite = xml.Element(
        "testsuite",
        name=name,
        tests=str(len(checks)),
        failures=str(sum(not check.passed for check in checks)),
        errors="0",
        skipped="0",
    )
    for check in checks:
        case = xml.SubElement(suite, "testcase", classname=f"{name}.{check.kind}", name=check.id)
        if not check.passed:
            message = f"{short(check.value)}, limit {short(check.limit)}"
            message = f"{message}: {check.note}" if check.note else message
            failure = xml.SubElement(case, "failure", message=message)
            failure.text = f"{message}\n{check.replay}"
    xml.indent(suite)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + xml.tostring(suite, "unicode") + "\n"


def _share(check: Check) -> float:
    if check.value is None or not check.limit:
        return 0.0
    return abs(check.value) / check.limit
