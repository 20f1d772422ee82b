"""The reports of `bench`.

A ratio is the baseline solver's run time divided by another solver's, at equal error.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, astuple
from functools import partial
from operator import attrgetter
from typing import Any

from pyharness.bench.growth import Growth
from pyharness.bench.measure import TARGETS, Finding, Refusal, Row, Workload
from pyharness.bench.pictures import bench_picture, growth_picture
from pyharness.bench.random_loads import KINDS
from pyharness.bench.savings import Saving
from pyharness.bench.scores import groups, means, scores, spreads, yardstick
from pyharness.model.build import build, machine
from pyharness.model.report import (
    Column,
    Line,
    Report,
    Section,
    Table,
    digits,
    numbers,
    short,
    words,
)

_MOST_SHOWN = 3
_RATIO = Column("ratio", digits(".2f"), full=digits(".2f"))
_DRIFT = (
    "One process and one run: medians of interleaved batches. Times drift with the machine and "
    "with what else it does: compare the ratios, not the times."
)


def measured_report(
    title: str, worth: str, found: Report, packages: Iterable[str], command: str
) -> Report:
    """Return the report `found` with machine, build and a Markdown page added.

    `worth` is a text on how comparable the numbers are.
    """
    here, built = machine(packages), build()
    *parts, notes = found.text
    compiler = f"{built.compiler}, {built.flags}"
    versions = [*here.items(), ("pyharness", built.version), ("Fortran compiler", compiler)]
    names = ("Python", "NumPy", "SciPy", "platform")
    versions += [(name, getattr(built, name.lower())) for name in names]
    mark = "#" + title.split()[0]
    tables: list[Section] = [[Line(f"{mark} {head}"), table] for head, table in parts]
    made = f"Made by `{command}`; run that again to have it for another machine."
    page: list[Section] = [[Line(told)] for told in (title, made, worth)]
    page += [[Table((Column(""), Column("version")), versions)], *tables]
    page += [[Line(f"{mark} Notes")], [Line(f"- {line}") for line in notes]]
    about = {"machine": here, "build": asdict(built)}
    return found._replace(record=lambda: found.record() | about, page=page)


def grouped(reasons: Iterable[tuple[str, str, str]], most: int | None = None) -> list[str]:
    """Return lines on missing results, from tuples (contender, reason, task).

    Contenders with the same reason and tasks share a line.
    """
    places: dict[tuple[str, str], list[str]] = {}
    for who, why, where in reasons:
        places.setdefault((who, why), []).append(where)
    alike: dict[tuple[str, str], list[str]] = {}
    for (who, why), found in places.items():
        more = f" and {len(found) - most} more" if most and len(found) > most else ""
        alike.setdefault((why, ", ".join(filter(None, found[:most])) + more), []).append(who)
    return [
        f"{', '.join(names)}: {why}" + (f" ({where})" if where else "")
        for (why, where), names in alike.items()
    ]


def bench_report(finding: Finding, packages: Iterable[str], command: str) -> Report:
    drawn, data = _random(finding), _data(finding)
    title = "# Run time against error" + (" of omega and attitude" if finding.attitude else "")
    text = [*(_spread_parts if drawn else _make_tables)(finding), _notes(finding)]
    shown = _spread_data(finding) if drawn else data
    pictures = {"precision": partial(bench_picture, finding, data)}
    found = Report("bench", text, partial(_record, finding), shown, pictures=pictures)
    return measured_report(title, _DRIFT, found, packages, command)


def _random(finding: Finding) -> bool:
    return bool(finding.workloads and finding.workloads[0].kinds)


def _spread_data(finding: Finding) -> Table:
    rows = [[*fields, *quartiles] for *fields, quartiles in map(astuple, spreads(finding, KINDS))]
    names = "method kind target scenes reached mean smallest lower_quartile median upper_quartile"
    return numbers(names, rows)


def _spread_parts(finding: Finding) -> list[tuple[str, Table]]:
    heads = ("mean", "smallest", "25 %", "median", "75 %")
    columns = [*words("kind"), Column("scenes"), *(Column(head, ratio) for head in heads)]
    tables: dict[str, list[list[Any]]] = {}
    for each in spreads(finding, KINDS):
        title = f"{yardstick(finding)} time / time of {each.method}, at errors of "
        scenes = f"{each.reached} of {each.scenes}"
        row = [each.kind, scenes, each.mean, each.smallest, *each.quartiles]
        tables.setdefault(title + power(each.target), []).append(row)
    return [(title, Table(columns, rows)) for title, rows in tables.items()]


def _data(finding: Finding) -> Table:
    heads = "method kind setting seconds error evaluations note"
    values = attrgetter("workload.horizon", *heads.split())
    rows = [[row.workload.scene.case or None, *values(row)] for row in finding.rows]
    return numbers("case horizon " + heads, rows)


def savings_report(found: Sequence[Saving]) -> Report:
    time = digits(".3g", 1e6)
    columns = (
        *words("skipped where"), Column("us with it", time, unit="s", full=time),
        Column("us without", time, unit="s", full=time), _RATIO,
    )  # fmt: skip
    rows = [[each.part, each.where, each.with_it, each.without, each.ratio] for each in found]
    table = Table(columns, rows)
    record = {"savings": [asdict(each) for each in found]}
    return Report("bench", [[table]], lambda: record, table)


def growth_report(found: Mapping[int, Sequence[Growth]]) -> Report:
    time, error = digits(".3g"), digits(".2g")
    columns = (
        *words("case"), Column("time", time, unit="s", full=time),
        Column("error", error, full=error), Column("one rounding of time", error, full=error),
        _RATIO, Column("steps"),
    )  # fmt: skip
    rows = [
        [case, each.time, each.error, each.conditioning, each.error / each.conditioning, each.steps]
        for case, growths in found.items()
        for each in growths
    ]
    table = Table(columns, rows)

    record = {str(case): [asdict(each) for each in growths] for case, growths in found.items()}
    pictures = {"growth": lambda: growth_picture(found)}
    return Report("bench", [[table]], lambda: {"growth": record}, table, pictures=pictures)


def _record(finding: Finding) -> dict[str, Any]:
    drawn = _random(finding)
    rows, what = [], "scene" if drawn else "case"
    for row in finding.rows:
        own = {name: getattr(row, name) for name in ("seconds", "error", "evaluations", "kind")}
        rows.append(_settings_of(row) | own | {"note": row.note or None})
    refused = [_settings_of(each) | {"reason": each.reason} for each in finding.refused]
    compiling, bounds = [], {label: each.record() for label, each in finding.bounds.items()}
    for (place, method), seconds in finding.preparation.items():
        compiling.append({what: place, "method": method, "seconds": seconds})
    found: dict[str, Any] = {"rows": rows, "refused": refused, "compile_seconds": compiling}
    found |= {"reference_error": finding.doubt, "reference_bound": bounds}
    found["attitude"] = finding.attitude
    if drawn:
        found["spreads"] = [asdict(each) for each in spreads(finding, KINDS)]
        scenes = attrgetter("scene.name", "kinds", "growth", "turns")
        names = ("scene", "kinds", "growth", "turns")
        found["scenes"] = [dict(zip(names, scenes(x), strict=True)) for x in finding.workloads]
    return found


def _settings_of(each: Row | Refusal) -> dict[str, Any]:
    load = each.workload
    asked = {"case": load.scene.case} | ({"scene": load.scene.name} if load.kinds else {})
    return asked | {"horizon": load.horizon} | {"method": each.method, "setting": each.setting}


def microseconds(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    value = seconds * 1e6
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def ratio(value: float | None) -> str:
    if value is None:
        return "-"
    if value >= 99.95:
        return f"{value:.0f}"
    digits = 2 - math.floor(math.log10(value)) if value < 1.0 else 2 if value < 9.995 else 1
    return f"{value:.{min(digits, 5)}f}"


def _make_tables(finding: Finding) -> list[tuple[str, Table]]:
    targets = list(map(power, TARGETS))
    columns = [Column("us per solve to", left=True)]
    for name in targets:
        columns += [Column(name, microseconds, unit="s"), Column("ratio", ratio)]
    columns.append(Column("best", short))
    parts = []
    for load in finding.workloads:
        rows: list[list[Any]] = []
        for score in scores(finding, load):
            pairs = zip(score.seconds, score.ratios, strict=True)
            rows.append([score.method, *(x for pair in pairs for x in pair), score.best])
        if rows:
            title = f"Case {load.label}: {load.scene.name}, T = {load.horizon:g} s"
            parts.append((title + _of_the_reference(finding, load), Table(columns, rows)))
    columns = [Column("ratio at", left=True), *(Column(name, ratio) for name in targets)]
    for group, loads in groups(finding).items():
        if len(loads) > 1:
            labels = ", ".join(load.label for load in loads)
            title = f"Geometric mean of {yardstick(finding)} time / own time: {group} "
            title += f"(cases {labels})"
            found = means(finding, loads)
            rows = [[name, *ratios] for name, ratios in found.items() if set(ratios) != {None}]
            if rows:
                parts.append((title, Table(columns, rows)))
    return parts


def _of_the_reference(finding: Finding, load: Workload) -> str:
    bound = finding.bounds.get(load.label)
    if bound is None:
        return ""
    text = bound.text("" if finding.attitude else "of the largest omega")
    warning = f"; WARNING: {bound.warning}" if bound.warning else ""
    return f", error of the reference at most {text}{warning}"


def power(target: float) -> str:
    return f"{target:.0e}".replace("e-0", "e-")


def _notes(finding: Finding) -> list[str]:
    drawn = _random(finding)
    last = "mean: geometric, over the scenes in which both reach the error."
    error = "max |w - ref| / max |ref| at T"
    if finding.attitude:
        error = f"{error} or the angle between the attitudes (rad), whichever is larger"
    lines = [
        f"ratio: time of {yardstick(finding)} over own time, above 1 is faster. A time is that of "
        f"the fastest setting whose error, {error}, is at most the one "
        f"named; '-': none is. {last if drawn else 'best: smallest error of any setting.'}"
    ]
    compiling: dict[str, float] = {}
    for (_, method), seconds in finding.preparation.items():
        compiling[method] = max(seconds, compiling.get(method, 0.0))
    told = [f"{name} {seconds:.2f}" for name, seconds in compiling.items() if seconds >= 0.05]
    if told:
        what = "scene" if drawn else "case"
        lines.append(f"preparation and compiling, not in the times, s a {what}: {', '.join(told)}")
    return lines + not_measured(finding)


def not_measured(finding: Finding) -> list[str]:
    """Return a line for each reason for missing results, with examples."""
    # Omit the expected time or last step from the reasons, so that alike ones share a line.
    came: list[tuple[Row | Refusal, str]] = [
        (each, each.reason.split(", a call would take")[0]) for each in finding.refused
    ]
    came += [(row, row.note.split(" at step")[0]) for row in finding.rows if row.error is None]
    told = []
    for each, why in came:
        at = "" if each.setting is None else f" at {each.setting:g}"
        told.append((each.method, why, each.workload.place + at))
    return grouped(told, _MOST_SHOWN)
