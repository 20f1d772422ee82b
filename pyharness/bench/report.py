"""The views of `bench`: tables of at most 100 columns, CSV, JSON, Markdown."""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from pyharness.bench.measure import TARGETS, Finding, Workload
from pyharness.bench.scores import groups, means, scores, yardstick
from pyharness.model.build import Build
from pyharness.views.records import SCHEMA
from pyharness.views.text import aligned, markdown_text, short, wrapped

_MOST_SHOWN = 3


def bench_table(finding: Finding) -> str:
    """Return the default view: a table for each workload, then the means."""
    lines: list[str] = []
    for title, head, rows in _parts(finding):
        lines += [*wrapped(title), *aligned(head, rows, left=1), ""]
    for line in _notes(finding):
        lines += textwrap.wrap(line, 100, subsequent_indent="  ")
    return "\n".join(lines) + "\n"


def bench_markdown(finding: Finding, machine: dict[str, str], build: Build, command: str) -> str:
    """Return a page: machine, versions, how to run it again, the tables, what was not run."""
    parts = [
        "# Run time against error",
        f"Made by `{command}`; run that again to have it for another machine.",
        "One process and one run: medians of interleaved batches. Times drift with the machine "
        "and with what else it does: compare the ratios, not the times.",
        markdown_text(
            ("", "version"),
            [
                *([name, text] for name, text in machine.items()),
                ["pyharness", build.version],
                ["Fortran compiler", f"{build.compiler}, {build.flags}"],
                ["Python", build.python],
                ["NumPy", build.numpy or "-"],
                ["SciPy", build.scipy or "-"],
                ["platform", build.platform],
            ],
        ).rstrip(),
    ]
    for title, head, rows in _parts(finding):
        parts += [f"## {title}", markdown_text(head, rows).rstrip()]
    parts += ["## Notes", "\n".join(f"- {line}" for line in _notes(finding))]
    return "\n\n".join(parts) + "\n"


def bench_rows(finding: Finding) -> tuple[Sequence[str], list[list[str]]]:
    """Return head and rows for CSV: full numbers, empty where there is none."""
    head = ("case", "horizon", "method", "kind", "setting", "seconds", "error", "evaluations",
            "note")  # fmt: skip

    def text(x: float | None) -> str:
        return "" if x is None else repr(x)

    rows = [
        [
            str(row.workload.scene.case or ""), repr(row.workload.horizon), row.method, row.kind,
            text(row.setting), text(row.seconds), text(row.error), text(row.evaluations), row.note,
        ]
        for row in finding.rows
    ]  # fmt: skip
    return head, rows


def bench_record(finding: Finding, machine: dict[str, str], build: Build) -> dict[str, Any]:
    """Return what `bench` found."""
    return {
        "schema": SCHEMA,
        "rows": [
            {
                "case": row.workload.scene.case,
                "horizon": row.workload.horizon,
                "method": row.method,
                "setting": row.setting,
                "seconds": row.seconds,
                "error": row.error,
                "evaluations": row.evaluations,
                "kind": row.kind,
                "note": row.note or None,
            }
            for row in finding.rows
        ],
        "refused": [
            {
                "case": each.workload.scene.case,
                "horizon": each.workload.horizon,
                "method": each.method,
                "setting": each.setting,
                "reason": each.reason,
            }
            for each in finding.refused
        ],
        "compile_seconds": [
            {"case": case, "method": method, "seconds": seconds}
            for (case, method), seconds in finding.preparation.items()
        ],
        "reference_error": finding.doubt,
        "machine": machine,
        "build": asdict(build),
    }


def microseconds(seconds: float | None) -> str:
    """Return two or three digits of a time: 0.63, 12, 1234, -."""
    if seconds is None:
        return "-"
    value = seconds * 1e6
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def ratio(value: float | None) -> str:
    """Return three digits of a ratio: 12.3, 0.0123, -; whole numbers from 100 on."""
    if value is None:
        return "-"
    if value >= 99.95:
        return f"{value:.0f}"
    digits = 2 - math.floor(math.log10(value)) if value < 1.0 else 2 if value < 9.995 else 1
    return f"{value:.{min(digits, 5)}f}"


def _parts(finding: Finding) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return title, head and rows of every table."""
    by = yardstick(finding)
    targets = [f"{target:.0e}".replace("e-0", "e-") for target in TARGETS]
    head = ["us per solve to", *(cell for name in targets for cell in (name, "ratio")), "best"]
    parts = []
    for load in finding.workloads:
        rows = []
        for score in scores(finding, load):
            row = [score.method]
            for seconds, relative in zip(score.seconds, score.ratios, strict=True):
                row += [microseconds(seconds), ratio(relative)]
            rows.append([*row, short(score.best)])
        if rows:
            parts.append((_title(finding, load), head, rows))
    for group, loads in groups(finding).items():
        if len(loads) > 1:
            labels = ", ".join(load.label for load in loads)
            rows = [[each.method, *map(ratio, each.ratios)] for each in means(finding, loads)]
            rows = [row for row in rows if set(row[1:]) != {"-"}]
            title = f"Geometric mean of {by} time / own time: {group} (cases {labels})"
            if rows:
                parts.append((title, ["ratio at", *targets], rows))
    return parts


def _title(finding: Finding, load: Workload) -> str:
    scene = load.scene
    doubt = short(finding.doubt.get(load.label))
    return (
        f"Case {load.label}: {scene.name}, T = {load.horizon:g} s "
        f"(reference good to {doubt} of the largest omega)"
    )


def _notes(finding: Finding) -> list[str]:
    lines = [
        f"ratio: time of {yardstick(finding)} over own time, above 1 is faster. A time is that of "
        "the fastest setting whose error, max |w - ref| / max |ref| at T, is at most the one "
        "named; '-': none is. best: smallest error of any setting.",
    ]
    compiling: dict[str, float] = {}
    for (_, method), seconds in finding.preparation.items():
        compiling[method] = max(seconds, compiling.get(method, 0.0))
    told = [f"{name} {seconds:.2f}" for name, seconds in compiling.items() if seconds >= 0.05]
    if told:
        lines.append(f"preparation and compiling, not in the times, s a case: {', '.join(told)}")
    return lines + not_measured(finding)


def not_measured(finding: Finding) -> list[str]:
    """Return what came to nothing, a line for each contender and reason, with the first places."""
    lines = []
    reasons: dict[tuple[str, str], list[str]] = {}
    for each in finding.refused:
        # What a call would take differs from case to case; the reason does not.
        reason = each.reason.split(", a call would take")[0]
        reasons.setdefault((each.method, reason), []).append(_place(each.workload, each.setting))
    for row in finding.rows:
        if row.error is None:
            reason = row.note.split(" at step")[0]
            place = _place(row.workload, row.setting)
            reasons.setdefault((row.method, reason), []).append(place)
    for (method, reason), places in reasons.items():
        shown = ", ".join(places[:_MOST_SHOWN])
        more = f" and {len(places) - _MOST_SHOWN} more" if len(places) > _MOST_SHOWN else ""
        lines.append(f"{method}: {reason} ({shown}{more})")
    return lines


def _place(load: Workload, setting: float | None) -> str:
    return f"case {load.label}" if setting is None else f"case {load.label} at {setting:g}"
