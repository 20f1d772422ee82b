"""The report of `compare`: tables, verdict and data."""

from typing import Any

from pyharness.checks.compare.agreement import Accuracy
from pyharness.checks.compare.findings import Comparison, MethodFinding, ProgramFinding
from pyharness.checks.compare.picture import comparison_picture
from pyharness.model.assumptions import assumption_records, mark
from pyharness.model.records import (
    build_record,
    ending_record,
    estimate_record,
    listing_record,
    scene_record,
)
from pyharness.model.report import Column, Report, Section, Table, digits, numbers, short, words
from pyharness.model.scene_report import heading, sensitive
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.programs import BINARY64

_OMEGA = tuple(Column(name, short, unit="rad/s") for name in ("w1", "w2", "w3"))
_PROGRAMS_LEGEND = (
    "stop: variable that ended the run, its Lipschitz quotient and the limit. w1 to w3, V: largest "
    "error of the angular velocity (rad/s) and of the velocity (m/s), up to the end of the run."
)
_METHODS_LEGEND = "w1 to w3: largest error of the angular velocity (rad/s). ms: time of one call."
_DRIFTS_LEGEND = (
    " energy, mom.sq: largest relative drift of the energy and of the squared angular momentum."
)
_ULP_LEGEND = " ulp: largest distance between Fortran and Python, in units in the last place."
_MORE = (
    "--numerics adds drifts, units in the last place, error amplification, solve_ivp and run times"
)
_DRIFTS = (Column("energy", short), Column("mom.sq", short))


def comparison_report(comparison: Comparison, numerics: bool = False) -> Report:
    """Return the report; without `numerics`, only the programs' steps, stops and errors."""
    has_programs = bool(comparison.programs)
    numerics = numerics or not has_programs
    scene = heading(comparison.scene, [each.listing for each in comparison.programs])
    truth, bound = comparison.reference, comparison.bound
    reference = [f"reference: {truth.source}, error of any w at most {bound.text()}"]
    rows, due = len(truth.time), len(comparison.scene.times())
    if rows < due:
        reference = [f"reference: {truth.source}; only {rows} of {due} rows have a finite omega"]
        reference += [f"error of any w at most {bound.text()}"] if rows else []
    reference += [f"WARNING: {bound.warning}"] if bound.warning else []
    legend = _PROGRAMS_LEGEND if has_programs else _METHODS_LEGEND
    motion = []
    if numerics:
        legend += _DRIFTS_LEGEND
        if has_programs:
            has_fortran = all(each.ulps is not None for each in comparison.programs)
            timed = f"{'Fortran' if has_fortran else 'the twin'} in {comparison.word}"
            timed = "Fortran, with the call" if comparison.word == BINARY64 else timed
            legend += f"{_ULP_LEGEND} us/step: time per step of {timed}."
        if comparison.digits is not None:
            amplified = f"error amplification {short(comparison.growth)}"
            motion.append(f"{amplified}: rounding leaves {comparison.digits:.1f} digits")
    attitudes = _attitudes(comparison, numerics)
    if attitudes:
        legend += " angle: largest error of the attitude (rad)"
        if has_programs:
            legend += "; a program's attitude is integrated from row to row by a method of order 4"
        legend += ". L in space: largest relative drift of the angular momentum."
    failures = [f"failed: {x.method}: {x.failure}" for x in comparison.methods if x.failure]
    told = verdict(comparison)
    tables: list[Section] = []
    if has_programs:
        steps, end = comparison.scene.steps, "its errors are the largest up to there"
        ended = [(each.who, each.trajectory.steps) for each in comparison.programs]
        short_runs = [f"{x} ended at step {n} of {steps}: {end}" for x, n in ended if n < steps]
        tables.append([_programs(comparison, numerics), *short_runs])
    if numerics:
        runs = [(x.method, x.trajectory) for x in comparison.methods if x.trajectory]
        endings = [
            f"{name} ended after {len(run.time)} of {due} rows: {run.ended}"
            for name, run in runs
            if not run.has_all_rows
        ]
        tables.append([_methods(comparison), *endings])
    last = [*(failures if numerics else [_MORE]), *told]
    return Report(
        "compare",
        text=[[*scene, *reference, *motion], [legend], *tables, *attitudes, last],
        record=lambda: _record(comparison),
        data=_data(comparison),
        page=[scene, *tables, *attitudes, told],
        pictures={"omega": lambda: comparison_picture(comparison)},
    )


def verdict(comparison: Comparison) -> list[str]:
    """Return a sentence for each unexpected or undecided result, and for a sensitive motion."""
    told = [f"UNEXPECTED: {each}" for each in comparison.unexpected] or [_as_expected(comparison)]
    if comparison.is_sensitive:
        told.append(sensitive(comparison.growth, comparison.digits))
    return told + [f"not judged: {each}" for each in comparison.not_judged]


def _as_expected(comparison: Comparison) -> str:
    if not comparison.programs:
        if comparison.growth is None:
            return "the error amplification is unknown: tolerances are not judged"
        return "as expected: no error exceeds the limit that follows from the method's tolerance"
    same = sum(not each.differences for each in comparison.programs)
    if any(each.ulps is None for each in comparison.programs):
        return (
            f"programs in {comparison.word}: only the twins run, so neither bits of two languages "
            "nor orders are compared"
        )
    text = f"as expected: Fortran = Python bit for bit in {same} of {len(comparison.programs)}"
    orders = [each.order for each in comparison.programs if each.order is not None]
    if not orders:
        return text
    unknown = ["rounding" if each.is_judged else "-" for each in orders]
    pairs = zip(orders, unknown, strict=True)
    seen = ", ".join(x if each.value is None else f"{each.value:.1f}" for each, x in pairs)
    due = ", ".join(str(each.due) for each in orders)
    return f"{text}; orders {seen} (expected {due})"


def _programs(comparison: Comparison, numerics: bool) -> Table:
    columns = [
        *words("program listing"), Column("steps"), Column("stop"), *_OMEGA,
        Column("V", short, unit="m/s"),
    ]  # fmt: skip
    if numerics:
        time = Column("us/step", digits(".2f", 1e6), unit="s")
        columns += [*_DRIFTS, Column("ulp", _count), time]
    rows = []
    for each in comparison.programs:
        run, good, listing = each.trajectory, each.accuracy, each.listing
        end = _end(run, comparison.lipschitz)
        label = f"{listing.label}{mark(comparison.scene, listing)}"
        row = [listing.program, label, run.steps, end, *good.omega, good.velocity]
        row += [good.energy, good.momentum, each.ulps, each.seconds_per_step]
        rows.append(row[: len(columns)])
    return Table(columns, rows)


def _methods(comparison: Comparison) -> Table:
    columns = (
        *words("solve_ivp" if comparison.programs else "method"),
        Column("tolerance", short), *_OMEGA, *_DRIFTS,
        Column("evaluations"), Column("ms", digits(".1f", 1e3), unit="s"),
    )  # fmt: skip
    rows = []
    for each in comparison.methods:
        judged: list[Any] = [None] * 7
        if each.trajectory is not None and each.accuracy is not None:
            judged = [*each.accuracy.omega, each.accuracy.energy, each.accuracy.momentum]
            judged += [each.trajectory.evaluations, each.seconds]
        rows.append([each.method, each.tolerance, *judged])
    return Table(columns, rows)


def _attitudes(comparison: Comparison, numerics: bool) -> list[list[Table]]:
    if comparison.reference.attitude is None:
        return []
    columns = (
        *words("attitude listing"), Column("angle", short, unit="rad"), Column("L in space", short),
    )  # fmt: skip
    found: list[tuple[str, str | None, Accuracy | None]]
    found = [(x.listing.program, x.listing.label, x.accuracy) for x in comparison.programs]
    found += [(x.method, None, x.accuracy) for x in comparison.methods if numerics]
    rows = [[*names, good.angle, good.momentum_in_space] for *names, good in found if good]
    return [[Table(columns, rows)]]


def _data(comparison: Comparison) -> Table:
    names = (
        "method listing active steps ended stop_variable stop_quotient error_w1 error_w2 error_w3 "
        "error_v energy_drift momentum_drift ulps order order_state evaluations seconds"
    )
    if comparison.reference.attitude is not None:
        names += " angle_error momentum_in_space"
    rows: list[dict[str, Any]] = []
    for each in map(_program, comparison.programs):
        listing, stop = each["listing"], each["stop"] or {}
        row = {
            "method": each["program"],
            "listing": listing["label"],
            "active": " ".join(sorted(listing["defects"] + listing["readings"])),
            "stop_variable": stop.get("variable"),
            "stop_quotient": stop.get("quotient"),
            "seconds": each["seconds_per_step"] * each["steps"],
        }
        rows.append(each | row)
    for each in map(_method, comparison.methods):
        # A method chooses its own steps: their number is not comparable. A failure is its ending.
        row = {"steps": None, "ended": each["failure"] or each.get("ended", "")}
        rows.append(each | row | ({"seconds": None} if each["failure"] else {}))
    for each in rows:
        errors = each.get("error", [None] * 3)
        each |= dict(zip(("error_w1", "error_w2", "error_w3"), errors, strict=True))
        each["error_v"] = each.get("velocity_error")
    return numbers(names, [list(map(each.get, names.split())) for each in rows])


def _end(run: Trajectory, limit: float | None) -> str:
    if run.stop is None:
        return "overflow" if run.ended == "overflow" else "-"
    quotient = f"{run.stop.quotient:.0f}"
    shown = quotient if len(quotient) <= 5 else short(run.stop.quotient)
    return f"{run.stop.variable} {shown}>{limit:g}"


def _count(ulps: float | None) -> str:
    return short(ulps) if ulps is None or ulps >= 1000 else f"{ulps:.0f}"


def _record(comparison: Comparison) -> dict[str, Any]:
    truth = comparison.reference
    return {
        "scene": scene_record(comparison.scene),
        "lipschitz": comparison.lipschitz,
        "word": comparison.word,
        "reference": {name: getattr(truth, name) for name in ("source", "estimate", "error")}
        | ({} if truth.attitude is None else {"angle_error": truth.angle_error}),
        "reference_bound": comparison.bound.record(),
        "programs": list(map(_program, comparison.programs)),
        "methods": list(map(_method, comparison.methods)),
        "growth": comparison.growth,
        "digits": comparison.digits,
        "sensitive": comparison.is_sensitive,
        "unexpected": list(comparison.unexpected),
        "not_judged": list(comparison.not_judged),
        "build": build_record(),
        "assumptions": assumption_records(
            [(comparison.scene, [each.listing for each in comparison.programs])]
        ),
    }


def _program(each: ProgramFinding) -> dict[str, Any]:
    return {
        "program": each.listing.program,
        "listing": listing_record(each.listing),
        **_run(each.trajectory, each.accuracy),
        "ulps": each.ulps,
        "differences": list(each.differences),
        "order": each.order.value if each.order else None,
        "order_state": each.order.state if each.order else None,
        "seconds_per_step": each.seconds_per_step,
    }


def _method(each: MethodFinding) -> dict[str, Any]:
    return {
        "method": each.method,
        "tolerance": each.tolerance,
        "failure": each.failure or None,
        **(_run(each.trajectory, each.accuracy) if each.trajectory and each.accuracy else {}),
        "seconds": each.seconds,
    }


def _run(run: Trajectory, accuracy: Accuracy) -> dict[str, Any]:
    estimated = estimate_record(run)
    return {
        **ending_record(run),
        "estimated_error": estimated.pop("error"),
        **estimated,
        "error": list(accuracy.omega),
        "velocity_error": accuracy.velocity,
        "energy_drift": accuracy.energy,
        "momentum_drift": accuracy.momentum,
        "angle_error": accuracy.angle,
        "momentum_in_space": accuracy.momentum_in_space,
    }
