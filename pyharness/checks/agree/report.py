"""The checks and the report of `agree`."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from pyharness.checks.agree.comparing import Agreement, Column, Place
from pyharness.checks.agree.noise import Noise
from pyharness.checks.agree.plan import Plan
from pyharness.checks.check import Check, Name
from pyharness.checks.report import checks_report, listed_singly, summary_page, verdict
from pyharness.model.basis import Basis
from pyharness.model.report import Column as Head
from pyharness.model.report import Picture, Report, Section, Table, numbers, short, words

_ROWS = Basis(
    "derived", "missing and additional rows", "both programs print a row for the same events"
)
_HEADS = (
    *words("program column"), Head("cells"), Head("differ"), Head("ulp", short),
    Head("noise", short), Head("beyond"), *words("limit"),
)  # fmt: skip


@dataclass(frozen=True)
class Compared:
    """A port with its agreement, or the line that names its failure."""

    port: str
    agreement: Agreement | None
    failure: str = ""
    took: float | None = None  # run time (s)


def checks_of(plan: Plan, each: Compared, again: str) -> list[Check]:
    if each.agreement is None:
        name = Name("agree", each.port)
        failed = Check(name, False, None, None, None, each.failure, again, took=each.took)
        return [failed]
    found = each.agreement
    lost = [*found.missing, *found.additional]
    name = Name("agree", each.port, "rows")
    rows = Check(
        name, not lost, float(len(lost)), 0.0, _ROWS, "; ".join(lost[:3]), again, took=each.took
    )
    return [rows, *(_check(each.port, column, again) for column in found.columns)]


def _check(port: str, column: Column, again: str) -> Check:
    limit = column.limit
    basis = Basis("measured", f"distance of a value, {limit.unit}", limit.because)
    notes = [f"in {limit.unit}"] + [f"{n} x {kind}" for kind, n in column.kinds.items()]
    if column.first_beyond is not None:
        notes.append(f"first beyond its limit: {column.first_beyond}")
    value = column.distance if math.isfinite(column.distance) else None
    name = Name("agree", port, column.name)
    return Check(name, not column.beyond, value, limit.value, basis, "; ".join(notes), again)


def agreement_report(
    plan: Plan, found: Sequence[Compared], noise: Noise | None, again: str, title: Sequence[str]
) -> Report:
    checks = [check for each in found for check in checks_of(plan, each, again)]
    floor = noise.floor if noise else {}
    rows = [
        [each.port, x.name, x.cells, x.differ, x.ulps, floor.get(x.name), x.beyond,
         f"{x.limit.value:g} {x.limit.unit}"]
        for each in found if each.agreement for x in each.agreement.columns
    ]  # fmt: skip
    heads: list[Head] = [*_HEADS]
    of_noise = "; noise: of other builds of the original"
    if noise is None:
        of_noise, heads = "", _without_noise(heads)
        rows = [_without_noise(row) for row in rows]
    table: Section = [
        "differ: cells that differ in any bit. ulp: largest distance, in units in the last "
        f"place{of_noise}. beyond: cells beyond the limit",
        Table(heads, rows),
    ]
    parts = [table] if rows else []
    text: list[Section] = [title, listed_singly([x for x in checks if not x.passed]), *parts]
    lines: Section = [*_parting(found), *_sentences(found, noise)]
    text += [lines, [verdict(checks)]]
    page = summary_page("agree", checks, title, depth=2, more=[*parts, lines])

    def record() -> dict[str, Any]:
        more: dict[str, Any] = {
            "original": plan.original.name,
            "ports": [_record(each) for each in found],
            "noise": None if noise is None else {
                "floor": floor,
                "builds": [{"flags": x.flags, "failure": x.note} for x in noise.builds],
                "initial": [*noise.initial],
            },
        }  # fmt: skip
        return {**more, **report.record()}

    report = checks_report("agree", checks, text, page)
    pictures = {"growth": lambda: _picture(found)}
    return report._replace(record=record, pictures=pictures)


def _without_noise(row: Sequence[Any]) -> list[Any]:
    return [*row[:5], *row[6:]]


def _parting(found: Sequence[Compared]) -> list[str]:
    lines = []
    for each in found:
        if each.agreement is None:
            continue
        place = each.agreement.first_difference
        lines.append(f"{each.port}: " + (f"parts at {place}" if place else "every bit agrees"))
    return lines


def _sentences(found: Sequence[Compared], noise: Noise | None) -> list[str]:
    if noise is None:
        return []
    lines = [f"the original depends on initial values: {each}" for each in noise.initial]
    lines += [f"a build failed: {x.flags}: {x.note}" for x in noise.builds if x.rows is None]
    worst = max(noise.floor, key=lambda name: noise.floor[name])
    for each in found:
        if each.agreement is None:
            continue
        ulps = {x.name: x.ulps for x in each.agreement.columns}
        column = max(ulps, key=lambda name: ulps[name])
        lines.append(
            f"{each.port} differs by {short(ulps[column])} ulp ({column}); the original differs "
            f"from itself by {short(noise.floor[worst])} ulp ({worst}), in {noise.count} builds"
        )
    return lines


def _record(each: Compared) -> dict[str, Any]:
    if each.agreement is None:
        return {"name": each.port, "failure": each.failure}
    found = each.agreement
    columns = [
        asdict(x) | {"first": _place(x.first), "first_beyond": _place(x.first_beyond)}
        for x in found.columns
    ]
    return {
        "name": each.port, "failure": "", "columns": columns, "missing": [*found.missing],
        "additional": [*found.additional],
        "growth": {name: [list(x) for x in rows] for name, rows in found.growth.items()},
    }  # fmt: skip


def _place(place: Place | None) -> dict[str, Any] | None:
    return None if place is None else asdict(place)


def _picture(found: Sequence[Compared]) -> Picture:
    """Draw the distance (ulp) by row of each column."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.5), dpi=110, layout="constrained")
    axes = figure.subplots()
    rows = []
    for each in found:
        for name, growth in (each.agreement.growth if each.agreement else {}).items():
            finite = [(n, x) for n, x in growth if math.isfinite(x)]
            axes.plot(
                *zip(*finite, strict=True) if finite else ((), ()),
                ".-",
                label=f"{each.port} {name}",
            )
            rows += [[each.port, name, n, x] for n, x in growth]
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set_xlabel("row")
    axes.set_ylabel("largest distance (ulp)")
    if rows:
        axes.legend()
    return Picture(figure, numbers("program column row ulp", rows))
