"""The report of `bench --terms`.

A ratio is heyoka's run time divided by our time, at equal error.
"""

import statistics
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from operator import attrgetter
from typing import Any

from pyharness.bench.ensemble_measure import TARGETS as BODY_TARGETS
from pyharness.bench.ensemble_measure import Rate, Rates
from pyharness.bench.measure import Finding, Row, Workload
from pyharness.bench.report import (
    grouped,
    measured_report,
    microseconds,
    not_measured,
    power,
    ratio,
)
from pyharness.bench.scores import geometric_mean, scores
from pyharness.bench.term_loads import (
    DOP853,
    EXPRESSION,
    HEYOKA,
    HORIZONS,
    MANY_HEYOKA,
    MANY_OURS,
    ONE_TOLERANCE,
    OURS,
    READY,
    VARIATIONAL,
)
from pyharness.model.report import Column, Report, Table, digits, numbers

_COMPARED = {DOP853: "DOP853", VARIATIONAL: "derivs"}
TARGETS = (1e-6, 1e-8, 1e-10, 1e-12)
_TITLES = {READY: "Ready terms", EXPRESSION: "Traced expressions"}
_WORTH = (
    "One process, one core and one run: processor times, medians of interleaved batches. Times "
    "drift with the machine and with what else it does: compare the ratios, not the times."
)


@dataclass(frozen=True)
class Terms:
    single: Finding
    many: Rates
    leaves: Counter[str] = field(default_factory=Counter)  # number of torques by `Solver.leaves`


@dataclass(frozen=True)
class Summary:
    """The mean and smallest ratio over the scenes of a kind at a target error."""

    kind: str
    bodies: int  # number of bodies in a call
    target: float | None  # target error; None for all together
    scenes: int  # number of pairs of scene and end time in which both solvers reach the error
    mean: float | None  # geometric mean
    smallest: float | None


def term_report(found: Terms, packages: Iterable[str], command: str) -> Report:
    text = [*_make_tables(found), _notes(found)]
    report = Report("bench", text, partial(_record, found), _data(found), pictures={})
    return measured_report("# Torques that depend on the state", _WORTH, report, packages, command)


def summaries(found: Terms) -> list[Summary]:
    """Return mean and smallest ratios by kind and target error, or [] without heyoka."""
    result = []
    for kind in _TITLES:
        loads = [load for load in found.single.workloads if kind in load.kinds]
        rows = [_ratios(found.single, load) for load in loads]
        result += _summary(kind, 1, TARGETS, rows)
        names = dict.fromkeys(load.label for load in loads)
        ratios = partial(_body_ratio, found.many)
        many = [[ratios(name, target) for target in BODY_TARGETS] for name in names]
        result += _summary(kind, found.many.bodies, BODY_TARGETS, many)
    return result


def _summary(
    kind: str, bodies: int, targets: Sequence[float], rows: Sequence[Sequence[float | None]]
) -> list[Summary]:
    result = []
    for target in (*targets, None):
        place = slice(None) if target is None else slice(k := targets.index(target), k + 1)
        known = [each for row in rows for each in row[place] if each is not None]
        if known:
            mean, least = geometric_mean(known), min(known)
            result.append(Summary(kind, bodies, target, len(known), mean, least))
    return result


def _ratios(finding: Finding, load: Workload) -> list[float | None]:
    times = {each.method: each.seconds for each in scores(finding, load, TARGETS)}
    nowhere = (None,) * len(TARGETS)
    pairs = zip(times.get(HEYOKA, nowhere), times.get(OURS, nowhere), strict=True)
    return [by / own if by and own else None for by, own in pairs]


def _body_row(rates: Rates, name: str, target: float, method: str) -> Rate | None:
    same = (r for r in rates.rows if (r.load, r.target, r.method) == (name, target, method))
    return next(same, None)


def _body_ratio(rates: Rates, name: str, target: float) -> float | None:
    own, other = (_body_row(rates, name, target, each) for each in (MANY_OURS, MANY_HEYOKA))
    return own.rate / other.rate if own and other else None


def _rows(finding: Finding, load: Workload, method: str) -> list[Row]:
    return [row for row in finding.rows if row.workload == load and row.method == method]


def _over(finding: Finding, load: Workload, peer: str) -> float | None:
    times = []
    for rows in (_rows(finding, load, name) for name in (peer, OURS)):
        times.append(next((x.seconds for x in rows if x.setting == ONE_TOLERANCE), None))
    by, own = times
    return by / own if by and own else None


def _preparing(finding: Finding, load: Workload, method: str) -> float | None:
    """Return a method's time (s) to prepare for a scene's shortest end time, or None."""
    first = next(each for each in finding.workloads if each.label == load.label)
    times = [row.preparing for row in _rows(finding, first, method)]
    return (times[0] if method == OURS else statistics.median(times)) if times else None


def _has(found: Terms, method: str) -> bool:
    rows: list[Row | Rate] = [*found.single.rows, *found.many.rows]
    return any(row.method == method for row in rows)


def _make_tables(found: Terms) -> list[tuple[str, Table]]:
    parts = []
    for kind, title in _TITLES.items():
        if loads := [load for load in found.single.workloads if kind in load.kinds]:
            parts.append((f"{title}: one body", _single_table(found, loads)))
            names = dict.fromkeys(load.label for load in loads)
            if any(row.load in names for row in found.many.rows):
                told = f"{title}: {found.many.bodies} bodies, T = {HORIZONS[0]:g} s"
                parts.append((told, _many_table(found, list(names))))
    if rows := [list(asdict(each).values()) for each in summaries(found)]:
        columns = [
            Column("heyoka's time / ours", left=True), Column("bodies"), Column("error", _target),
            Column("ratios"), Column("geometric mean", ratio), Column("smallest", ratio),
        ]  # fmt: skip
        parts.append(("Geometric mean and smallest ratio", Table(columns, rows)))
    return parts


def _single_table(found: Terms, loads: Sequence[Workload]) -> Table:
    with_heyoka = _has(found, HEYOKA)
    peers = [name for name in _COMPARED if _has(found, name)]
    columns = [Column("us per solve to", left=True), Column("T", digits("g"))]
    for target in TARGETS:
        columns.append(Column(_target(target), microseconds, unit="s"))
        columns += [Column("ratio", ratio)] * with_heyoka
    columns.append(Column("prepare", _milliseconds, unit="s"))
    columns += [Column("compile", _milliseconds, unit="s")] * with_heyoka
    columns += [Column(_COMPARED[name], ratio) for name in peers]
    rows = []
    for load in loads:
        times = {each.method: each.seconds for each in scores(found.single, load, TARGETS)}
        row: list[Any] = [load.label, load.horizon]
        own = times.get(OURS, (None,) * len(TARGETS))
        for seconds, by in zip(own, _ratios(found.single, load), strict=True):
            row += [seconds, by] if with_heyoka else [seconds]
        row.append(_preparing(found.single, load, OURS))
        row += [_preparing(found.single, load, HEYOKA)] * with_heyoka
        row += [_over(found.single, load, name) for name in peers]
        rows.append(row)
    return Table(columns, rows)


def _many_table(found: Terms, names: Sequence[str]) -> Table:
    with_heyoka = _has(found, MANY_HEYOKA)
    columns = [Column("us a body to", left=True)]
    for target in BODY_TARGETS:
        columns.append(Column(_target(target), microseconds, unit="s"))
        columns += [Column("ratio", ratio)] * with_heyoka
    rows = []
    for name in names:
        row: list[Any] = [name]
        for target in BODY_TARGETS:
            own = _body_row(found.many, name, target, MANY_OURS)
            row.append(1.0 / own.rate if own else None)
            row += [_body_ratio(found.many, name, target)] * with_heyoka
        rows.append(row)
    return Table(columns, rows)


def _target(target: float | None) -> str:
    return "all" if target is None else power(target)


def _milliseconds(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    return f"{1e3 * seconds:.2g}" if seconds < 0.1 else f"{1e3 * seconds:.0f}"


def _notes(found: Terms) -> list[str]:
    lines = [
        "us per solve: time of a prepared solver's call at its fastest tolerance whose error at T "
        "is at most the target error; '-': no tolerance has one. The error is that of omega over "
        "the largest |omega| at 0 and T, or the angle between the attitudes (rad) if it is larger. "
        "prepare: time of the first prepare(), ms."
    ]
    if found.leaves:
        lines.append(f"Taylor terms of single bodies: {_counted(found.leaves)}.")
    if _has(found, HEYOKA):
        lines.append(
            "ratio: heyoka's time / ours at the same error, above 1: ours is faster. heyoka's "
            "integrator is kept, and its time and state are set anew for each call. compile: "
            "median time in which heyoka compiles one integrator, ms, not in the ratio."
        )
    if _has(found, DOP853):
        lines.append(
            f"DOP853: time of SciPy's solve_ivp over ours, both with the tolerance "
            f"{_target(ONE_TOLERANCE)}."
        )
    if _has(found, VARIATIONAL):
        lines.append(
            "derivs: the same for heyoka with the derivatives by the initial state, from which our "
            "error amplification comes too."
        )
    if found.many.rows:
        lines.append(
            f"{found.many.bodies} bodies: each way has its coarsest tolerance with which the "
            "error of omega of the first 200 bodies is at most the one named, against solve at "
            f"1e-15, on one core. Initial omegas at random, seed {found.many.seed}."
            + _batches(found.many)
        )
    refused = grouped((name, why, place) for place, name, why in found.many.refused)
    return lines + not_measured(found.single) + refused


def _batches(rates: Rates) -> str:
    counts = Counter(row.note for row in rates.rows if row.method == MANY_HEYOKA)
    return f" heyoka's fastest: {_counted(counts)}." if counts else ""


def _counted(counts: Counter[str]) -> str:
    return ", ".join(f"{name} ({n} of {counts.total()})" for name, n in counts.most_common())


def _data(found: Terms) -> Table:
    values = attrgetter("method", "setting", "seconds", "error", "preparing", "note")
    where = attrgetter("workload.label", "workload.horizon")
    rows = [[x.workload.kinds[0], *where(x), 1, *values(x)] for x in found.single.rows]
    kinds = {load.label: load.kinds[0] for load in found.single.workloads}
    rows += [
        [kinds[each.load], each.load, HORIZONS[0], each.bodies, each.method, each.setting,
         each.seconds, each.error, None, each.note]
        for each in found.many.rows
    ]  # fmt: skip
    return numbers("kind torque horizon bodies method setting seconds error preparing note", rows)


def _record(found: Terms) -> dict[str, Any]:
    table, many = _data(found), found.many
    names = [each.head for each in table.columns]
    rows = [dict(zip(names, row, strict=True)) | {"note": row[-1] or None} for row in table.rows]
    values = attrgetter("workload.label", "workload.horizon", "method", "setting", "reason")
    missed: list[tuple[Any, ...]] = [(1, *values(each)) for each in found.single.refused]
    for place, name, why in many.refused:
        missed.append((many.bodies, place or None, HORIZONS[0], name, None, why))
    refused = []
    for bodies, torque, horizon, method, setting, reason in missed:
        where = {"torque": torque, "horizon": horizon, "bodies": bodies}
        refused.append(where | {"method": method, "setting": setting, "reason": reason})
    told: dict[str, Any] = {"rows": rows, "refused": refused}
    told["means"] = list(map(asdict, summaries(found)))
    told["leaves"] = found.leaves
    told |= {"reference_error": found.single.doubt, "seed": many.seed, "bodies": many.bodies}
    return told
