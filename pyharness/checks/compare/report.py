"""The report of `compare`: tables, verdict and data, and a picture of omega and its errors."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyharness.checks.compare.agreement import Accuracy
from pyharness.checks.compare.comparison import Comparison, MethodFinding, ProgramFinding
from pyharness.engine.report import mark_end
from pyharness.model.records import (
    build_record,
    ending_record,
    estimate_record,
    listing_record,
    scene_record,
)
from pyharness.model.report import Column, Picture, Report, Table, digits, numbers, short, words
from pyharness.model.scene_report import heading, sensitive
from pyharness.model.trajectory import WITH_ALL_ROWS, Trajectory
from pyharness.thesis.programs import BINARY64

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_OMEGA = tuple(Column(name, short, unit="rad/s") for name in ("w1", "w2", "w3"))
_PROGRAMS_LEGEND = (
    "w1 to w3, V: largest error of the angular velocity (rad/s) and of the velocity (m/s). "
    "energy, mom.sq: largest relative drift of the energy and of the squared angular momentum. "
    "ulp: largest distance between Fortran and Python, in units in the last place. stop: "
    "variable that ended the run, its Lipschitz quotient and the limit."
)
_METHODS_LEGEND = (
    "w1 to w3: largest error of the angular velocity (rad/s). energy, mom.sq: largest relative "
    "drift of the energy and of the squared angular momentum. ms: time of one call."
)
_DRIFTS = (Column("energy", short), Column("mom.sq", short))


def comparison_report(comparison: Comparison) -> Report:
    """Return the report of a comparison."""
    scene, truth, bound = heading(comparison.scene), comparison.reference, comparison.bound
    reference = [f"reference: {truth.source}, error of any w at most {bound.text()}"]
    reference += [f"WARNING: {bound.warning}"] if bound.warning else []
    legend = _PROGRAMS_LEGEND if comparison.programs else _METHODS_LEGEND
    if comparison.programs:
        has_fortran = all(each.ulps is not None for each in comparison.programs)
        timed = f"{'Fortran' if has_fortran else 'the twin'} in {comparison.word}"
        if comparison.word == BINARY64:
            timed = "Fortran, with the call"
        legend += f" us/step: time per step of {timed}."
    motion = []
    if comparison.digits is not None:
        amplified = f"error amplification {short(comparison.growth)}"
        motion.append(f"{amplified}: rounding leaves {comparison.digits:.1f} digits")
    attitudes = _attitudes(comparison)
    if attitudes:
        legend += " angle: largest error of the attitude (rad)"
        if comparison.programs:
            legend += "; a program's attitude is integrated from row to row by a method of order 4"
        legend += ". L in space: largest relative drift of the angular momentum."
    failures = [f"failed: {x.method}: {x.failure}" for x in comparison.methods if x.failure]
    told = verdict(comparison)
    tables = [[_programs(comparison)]] if comparison.programs else []
    tables.append([_methods(comparison)])

    return Report(
        "compare",
        text=[[*scene, *reference, *motion], [legend], *tables, *attitudes, [*failures, *told]],
        record=lambda: _record(comparison),
        data=_data(comparison),
        page=[scene, *tables, *attitudes, told],
        pictures={"omega": lambda: comparison_picture(comparison)},
    )


def verdict(comparison: Comparison) -> list[str]:
    """Return sentences on which results are as expected, unexpected, sensitive or not judged."""
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
    seen = ", ".join(
        f"{each.value:.1f}" if each.value is not None else "rounding" if each.is_judged else "-"
        for each in orders
    )
    due = ", ".join(str(each.due) for each in orders)
    return f"{text}; orders {seen} (expected {due})"


def _programs(comparison: Comparison) -> Table:
    columns = (
        *words("program listing"), Column("steps"), Column("stop"), *_OMEGA,
        Column("V", short, unit="m/s"), *_DRIFTS, Column("ulp", _count),
        Column("us/step", digits(".2f", 1e6), unit="s"),
    )  # fmt: skip
    rows = []
    for each in comparison.programs:
        run, good, listing = each.trajectory, each.accuracy, each.listing
        end = _end(run, comparison.lipschitz)
        row = [listing.program, listing.label, run.steps, end, *good.omega, good.velocity]
        rows.append([*row, good.energy, good.momentum, each.ulps, each.seconds_per_step])
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


def _attitudes(comparison: Comparison) -> list[list[Table]]:
    if comparison.reference.attitude is None:
        return []
    columns = (
        *words("attitude listing"), Column("angle", short, unit="rad"), Column("L in space", short),
    )  # fmt: skip
    found: list[tuple[str, str | None, Accuracy]] = [
        (each.listing.program, each.listing.label, each.accuracy) for each in comparison.programs
    ]
    found += [(each.method, None, each.accuracy) for each in comparison.methods if each.accuracy]
    rows = [[*names, good.angle, good.momentum_in_space] for *names, good in found]
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
        # A method of `solve_ivp` chooses its own steps, whose number is not written. If the method
        # failed, the reason is written as its ending.
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


# Dashes and widths distinguish the lines without colour.
_STYLES: dict[str, dict[str, Any]] = {
    "original": {"color": "#c02020", "linestyle": (0, (5, 2)), "linewidth": 1.4},
    "custom": {"color": "#107040", "linestyle": (0, (6, 1, 1, 1)), "linewidth": 1.4},
    "corrected": {"color": "#1040a0", "linestyle": (0, (1, 1.2)), "linewidth": 2.0},
}
_REFERENCE: dict[str, Any] = {"color": "#b8b8b8", "linestyle": "-", "linewidth": 3.5}
# A line does not show a trajectory of a single row, so that it is drawn as a marker. The markers
# can be distinguished even at the same point.
_MARKERS: dict[str, dict[str, Any]] = {
    "reference": {"marker": "s", "markersize": 11.0},
    "original": {"marker": "o", "markersize": 8.0, "markerfacecolor": "none"},
    "custom": {"marker": "D", "markersize": 5.0, "markerfacecolor": "none"},
    "corrected": {"marker": ".", "markersize": 5.0},
}


class _Curve(NamedTuple):
    name: str  # program or method, which has a column of panels
    label: str  # version of the program; empty for a method
    trajectory: Trajectory
    accuracy: Accuracy


def _curves(comparison: Comparison) -> list[_Curve]:
    return [
        _Curve(each.listing.program, each.listing.label, each.trajectory, each.accuracy)
        for each in comparison.programs
    ] or [
        _Curve(each.method, "", each.trajectory, each.accuracy)
        for each in comparison.methods
        if each.trajectory is not None and each.accuracy is not None
    ]


def comparison_picture(comparison: Comparison) -> Picture:
    """Return a picture with one column per program or method.

    Its panels show the components of omega and their largest error (rad/s), and the error of the
    attitude (rad) if it is compared.
    """
    from matplotlib.figure import Figure

    curves = _curves(comparison)
    names = list(dict.fromkeys(each.name for each in curves))
    figure = Figure(figsize=(4.2 * max(len(names), 1.4), 9.0), dpi=110, layout="constrained")
    truth = comparison.reference
    bounds = [truth.error] if truth.attitude is None else [truth.error, truth.angle_error]
    shape = 3 + len(bounds), len(names)
    axes = figure.subplots(*shape, sharex=True, sharey="row", squeeze=False)
    for column, name in enumerate(names):
        axes[0, column].set_title(name)
        axes[-1, column].set_xlabel("time (s)")
        for row in range(3):
            _line(axes[row, column], truth.time, truth.omega[:, row], "reference")
        for each in curves:
            if each.name != name:
                continue
            run, label = each.trajectory, each.label
            for row in range(3):
                _line(axes[row, column], run.time, run.omega[:, row], label)
            for row, error in enumerate((each.accuracy.error, each.accuracy.turned), 3):
                if error is not None:
                    shown = np.isfinite(error) & (error > 0.0)
                    _line(axes[row, column], run.time[: len(error)][shown], error[shown], label)
    ended = [each for each in curves if each.trajectory.ended not in WITH_ALL_ROWS]
    for row in range(3):
        axes[row, 0].set_ylabel(f"$\\omega_{row + 1}$ (rad/s)")
        _frame(axes[row, 0], truth.omega[:, row])
        for each in ended:
            mark_end(axes[row, names.index(each.name)], each.trajectory, row)
    labels = ("error of any $\\omega$ (rad/s)", "error of attitude (rad)")
    for row, (bound, label) in enumerate(zip(bounds, labels, strict=False), 3):
        axes[row, 0].set_yscale("log")
        axes[row, 0].set_ylabel(label)
        for column in range(len(names)):
            axes[row, column].axhline(bound, color="black", linewidth=0.8)
            axes[row, column].grid(visible=True, linewidth=0.3)
        bottom, top = axes[row, 0].get_ylim()
        axes[row, 0].set_ylim(max(bottom, 1e-17), min(top, 1e4))
    axes[0, 0].legend(loc="best", handlelength=4)
    note = "x: the integration stopped or overflowed; at the edge: out of view" if ended else ""
    title = (f"{heading(comparison.scene)[0]}; thin line: error of the reference", note)
    return Picture(figure, _numbers(comparison), title)


def _numbers(comparison: Comparison) -> Table:
    truth, names = comparison.reference, "method listing time omega1 omega2 omega3 error"
    bounds = [truth.error]
    if truth.attitude is not None:
        names += " angle_error"
        bounds.append(truth.angle_error)
    rows = [
        ["reference", "", t, *omega, *bounds]
        for t, omega in zip(truth.time.tolist(), truth.omega.tolist(), strict=True)
    ]
    for each in _curves(comparison):
        run, name = each.trajectory, [each.name, each.label]
        errors = each.accuracy.error[:, None]
        if each.accuracy.turned is not None:
            errors = np.column_stack([errors, each.accuracy.turned])
        n = len(errors)
        found = np.column_stack([run.time[:n], run.omega[:n], errors])
        rows += [[*name, *row] for row in found.tolist()]
    return numbers(names, rows)


def _line(axes: "Axes", time: np.ndarray, values: np.ndarray, label: str) -> None:
    style = _REFERENCE if label == "reference" else _STYLES[label or "corrected"]
    marker = _MARKERS[label or "corrected"] if len(time) == 1 else {}
    axes.plot(time, values, label=label or "method", **style, **marker)


def _frame(axes: "Axes", truth: np.ndarray) -> None:
    if not len(truth):
        return
    low, high = float(truth.min()), float(truth.max())
    margin = max(0.6 * (high - low), 0.05 * max(abs(low), abs(high)), 1e-12)
    bottom, top = axes.get_ylim()
    axes.set_ylim(max(bottom, low - margin), min(top, high + margin))
