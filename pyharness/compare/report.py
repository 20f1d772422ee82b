"""The report of `compare`."""

import math
from typing import Any

from pyharness.compare.agreement import Accuracy
from pyharness.compare.comparison import Comparison
from pyharness.compare.orders import Order
from pyharness.model.report import (
    Column,
    Picture,
    Report,
    Table,
    digits,
    numbers,
    short,
    words,
)
from pyharness.model.scene_report import heading
from pyharness.model.trajectory import Stop, Trajectory

_OMEGA = tuple(Column(name, short, unit="rad/s") for name in ("w1", "w2", "w3"))
_DRIFTS = (Column("energy", short), Column("mom.sq", short))


def comparison_report(comparison: Comparison) -> Report:
    """Report what `compare` found: programs, then methods of `solve_ivp`, then the verdict."""
    scene, truth = heading(comparison.scene), comparison.reference
    reference = (
        f"reference: {truth.source}, error of any w below {short(truth.error)} rad/s "
        f"(estimated {short(truth.estimate)} before rounding to binary64)"
    )
    legend = (
        "w1-w3, V: largest error against the reference (rad/s, m/s). energy, mom.sq: largest "
        "relative drift. ulp: distance between Fortran and Python in units in the last place. "
        "stop: variable and its Lipschitz quotient against the limit. us/step: Fortran, the call "
        "included."
    )
    failures = [f"failed: {x.method}: {x.failure}" for x in comparison.methods if x.failure]
    told, programs, methods = verdict(comparison), _programs(comparison), _methods(comparison)

    def draw() -> Picture:
        from pyharness.compare.picture import comparison_picture

        return comparison_picture(comparison)

    return Report(
        "compare",
        text=[[*scene, reference], [programs], [methods], [legend, *failures, *told]],
        record=lambda: _record(comparison),
        data=_data(comparison),
        page=[scene, [programs], [methods], told],
        pictures={"omega": draw},
    )


def verdict(comparison: Comparison) -> list[str]:
    """Return the verdict: one sentence, or one for each thing that is not as it should be."""
    told = [f"UNEXPECTED: {each}" for each in comparison.unexpected] or [_as_expected(comparison)]
    return told + [f"not judged: {each}" for each in comparison.not_judged]


def _as_expected(comparison: Comparison) -> str:
    same = sum(not each.differences for each in comparison.programs)
    text = f"as expected: Fortran = Python bit for bit in {same} of {len(comparison.programs)}"
    orders = [each.order for each in comparison.programs if each.order is not None]
    if not orders:
        return text
    seen = ", ".join(map(_seen, orders))
    return f"{text}; orders corrected {seen} (due: {', '.join(str(each.due) for each in orders)})"


def _seen(order: Order) -> str:
    if order.value is None:
        return "rounding" if order.is_judged else "-"
    return f"{order.value:.1f}"


def _programs(comparison: Comparison) -> Table:
    columns = (
        *words("program listing"), Column("steps"), Column("stop"), *_OMEGA,
        Column("V", short, unit="m/s"), *_DRIFTS, Column("ulp", _count),
        Column("us/step", digits(".2f", 1e6), unit="s"),
    )  # fmt: skip
    rows = []
    for each in comparison.programs:
        run, good, listing = each.trajectory, each.accuracy, each.listing
        end = _stop(run.stop, comparison.lipschitz) if run.stop else _ended(run)
        row = [listing.program, listing.label, run.steps, end, *good.omega, good.velocity]
        rows.append([*row, good.energy, good.momentum, each.ulps, each.seconds_per_step])
    return Table(columns, rows)


def _methods(comparison: Comparison) -> Table:
    columns = (
        *words("solve_ivp"), Column("tolerance", short), *_OMEGA, *_DRIFTS,
        Column("evaluations"), Column("ms", digits(".1f", 1e3), unit="s"),
    )  # fmt: skip
    rows: list[list[Any]] = []
    for each in comparison.methods:
        row = [each.method, each.tolerance]
        if each.trajectory is None or each.accuracy is None:
            rows.append([*row, *[None] * 7])
            continue
        row += [*each.accuracy.omega, each.accuracy.energy, each.accuracy.momentum]
        rows.append([*row, each.trajectory.evaluations, each.seconds])
    return Table(columns, rows)


def _data(comparison: Comparison) -> Table:
    """Return programs and methods in one table."""
    names = (
        "method listing active steps ended stop_variable stop_quotient error_w1 error_w2 error_w3 "
        "error_v energy_drift momentum_drift ulps order order_state evaluations seconds"
    )
    rows: list[dict[str, Any]] = []
    for each in comparison.programs:
        run = each.trajectory
        row = {
            "method": each.listing.program,
            "listing": each.listing.label,
            "active": " ".join(sorted(each.listing.defects | each.listing.readings)),
            "ulps": each.ulps,
            "steps": run.steps,
            "seconds": each.seconds_per_step * run.steps,
            **_found(run, each.accuracy),
        }
        if run.stop:
            row |= {"stop_variable": run.stop.variable, "stop_quotient": run.stop.quotient}
        if each.order:
            row |= {"order": each.order.value, "order_state": each.order.state}
        rows.append(row)
    for method in comparison.methods:
        row = {"method": method.method, "ended": method.failure}
        if method.trajectory is not None and method.accuracy is not None:
            row |= {"seconds": method.seconds, **_found(method.trajectory, method.accuracy)}
        rows.append(row)
    return numbers(names, [list(map(row.get, names.split())) for row in rows])


def _found(run: Trajectory, good: Accuracy) -> dict[str, Any]:
    return {
        **dict(zip(("error_w1", "error_w2", "error_w3"), good.omega, strict=True)),
        "error_v": good.velocity,
        "energy_drift": good.energy,
        "momentum_drift": good.momentum,
        "ended": run.ended,
        "evaluations": run.evaluations,
    }


def _stop(stop: Stop, limit: float) -> str:
    quotient = "inf" if math.isinf(stop.quotient) else f"{stop.quotient:.0f}"
    if len(quotient) > 5:
        quotient = short(stop.quotient)
    return f"{stop.variable} {quotient}>{limit:g}"


def _ended(run: Trajectory) -> str:
    return "overflow" if run.ended == "overflow" else "-"


def _count(ulps: float) -> str:
    return f"{ulps:.0f}" if ulps < 1000 else short(ulps)


def _record(comparison: Comparison) -> dict[str, Any]:
    from pyharness.model.records import build_record, ending_record, listing_record, scene_record

    return {
        "scene": scene_record(comparison.scene),
        "lipschitz": comparison.lipschitz,
        "reference": {
            "source": comparison.reference.source,
            "estimate": comparison.reference.estimate,
            "error": comparison.reference.error,
        },
        "programs": [
            {
                "program": each.listing.program,
                "listing": listing_record(each.listing),
                **ending_record(each.trajectory),
                **_accuracy_record(each.accuracy),
                "ulps": each.ulps,
                "differences": list(each.differences),
                "order": each.order.value if each.order else None,
                "order_state": each.order.state if each.order else None,
                "seconds_per_step": each.seconds_per_step,
            }
            for each in comparison.programs
        ],
        "methods": [
            {
                "method": each.method,
                "tolerance": each.tolerance,
                "failure": each.failure or None,
                **({} if each.trajectory is None else ending_record(each.trajectory)),
                **({} if each.accuracy is None else _accuracy_record(each.accuracy)),
                "seconds": each.seconds,
            }
            for each in comparison.methods
        ],
        "unexpected": list(comparison.unexpected),
        "not_judged": list(comparison.not_judged),
        "build": build_record(),
    }


def _accuracy_record(accuracy: Accuracy) -> dict[str, Any]:
    return {
        "error": list(accuracy.omega),
        "velocity_error": accuracy.velocity,
        "energy_drift": accuracy.energy,
        "momentum_drift": accuracy.momentum,
    }
