"""The views of `compare`: a table of at most 100 columns, CSV, Markdown; nothing is computed."""

import math
from collections.abc import Sequence

from pyharness.compare.agreement import Accuracy
from pyharness.compare.comparison import Comparison
from pyharness.compare.orders import Order
from pyharness.model.trajectory import Stop, Trajectory
from pyharness.views.text import aligned, heading, markdown_text, short, wrapped

_PROGRAM_HEAD = (
    "program", "listing", "steps", "stop", "w1", "w2", "w3", "V", "energy", "mom.sq", "ulp",
    "us/step",
)  # fmt: skip
_METHOD_HEAD = (
    "solve_ivp", "tolerance", "w1", "w2", "w3", "energy", "mom.sq", "evaluations", "ms",
)  # fmt: skip


def comparison_table(comparison: Comparison) -> str:
    """Return the default view of `compare`."""
    lines = heading(comparison.scene)
    lines += wrapped(
        f"reference: {comparison.reference.source}, error of any w below "
        f"{short(comparison.reference.error)} rad/s "
        f"(estimated {short(comparison.reference.estimate)} before rounding to binary64)"
    )
    lines.append("")
    lines += aligned(_PROGRAM_HEAD, _program_rows(comparison), left=2)
    lines.append("")
    lines += aligned(
        _METHOD_HEAD,
        _method_rows(comparison),
        left=1,
    )
    lines.append("")
    lines += wrapped(
        "w1-w3, V: largest error against the reference (rad/s, m/s). energy, mom.sq: largest "
        "relative drift. ulp: distance between Fortran and Python in units in the last place. "
        "stop: variable and its Lipschitz quotient against the limit. us/step: Fortran, the call "
        "included."
    )
    for each in comparison.methods:
        if each.failure:
            lines += wrapped(f"failed: {each.method}: {each.failure}")
    lines += verdict(comparison)
    return "\n".join(lines) + "\n"


def verdict(comparison: Comparison) -> list[str]:
    """Return the verdict: one sentence, or one for each thing that is not as it should be."""
    told = [f"UNEXPECTED: {each}" for each in comparison.unexpected] or [_as_expected(comparison)]
    told += [f"not judged: {each}" for each in comparison.not_judged]
    return [line for each in told for line in wrapped(each)]


def _as_expected(comparison: Comparison) -> str:
    same = sum(not each.differences for each in comparison.programs)
    text = f"as expected: Fortran = Python bit for bit in {same} of {len(comparison.programs)}"
    orders = [each.order for each in comparison.programs if each.order is not None]
    if not orders:
        return text
    seen = ", ".join(map(_seen, orders))
    return f"{text}; orders mended {seen} (due: {', '.join(str(each.due) for each in orders)})"


def _seen(order: Order) -> str:
    if order.value is None:
        return "rounding" if order.is_judged else "-"
    return f"{order.value:.1f}"


def comparison_rows(comparison: Comparison) -> tuple[Sequence[str], list[list[str]]]:
    """Return head and rows of the comparison for CSV: full numbers, empty where there is none."""
    head = (
        "method", "listing", "active", "steps", "ended", "stop_variable", "stop_quotient",
        "error_w1", "error_w2", "error_w3", "error_v", "energy_drift", "momentum_drift", "ulps",
        "order", "order_state", "evaluations", "seconds",
    )  # fmt: skip
    rows = []
    for each in comparison.programs:
        run, good = each.trajectory, each.accuracy
        cells = {
            "method": each.listing.program,
            "listing": each.listing.label,
            "active": " ".join(sorted(each.listing.defects | each.listing.readings)),
            "steps": str(run.steps),
            "ended": run.ended,
            "stop_variable": run.stop.variable if run.stop else "",
            "stop_quotient": repr(run.stop.quotient) if run.stop else "",
            **_accuracy_cells(good),
            "ulps": _cell(each.ulps),
            "order": _cell(each.order.value if each.order else None),
            "order_state": each.order.state if each.order else "",
            "evaluations": str(run.evaluations),
            "seconds": _cell(each.seconds_per_step * run.steps),
        }
        rows.append([cells.get(name, "") for name in head])
    for method in comparison.methods:
        cells = {"method": method.method, "ended": method.failure}
        if method.trajectory is not None and method.accuracy is not None:
            cells |= {
                "ended": method.trajectory.ended,
                **_accuracy_cells(method.accuracy),
                "evaluations": str(method.trajectory.evaluations),
                "seconds": _cell(method.seconds),
            }
        rows.append([cells.get(name, "") for name in head])
    return head, rows


def comparison_markdown(comparison: Comparison) -> str:
    """Return the two tables of the comparison in Markdown, with heading and verdict."""
    parts = [
        "\n".join(heading(comparison.scene)) + "\n",
        markdown_text(_PROGRAM_HEAD, _program_rows(comparison)),
        markdown_text(_METHOD_HEAD, _method_rows(comparison)),
        "\n".join(verdict(comparison)) + "\n",
    ]
    return "\n".join(parts)


def _program_rows(comparison: Comparison) -> list[list[str]]:
    rows = []
    for each in comparison.programs:
        run, good = each.trajectory, each.accuracy
        row = [each.listing.program, each.listing.label, str(run.steps)]
        row.append(_stop(run.stop, comparison.lipschitz) if run.stop else _ended(run))
        row += [short(x) for x in (*good.omega, good.velocity, good.energy, good.momentum)]
        row += [_count(each.ulps), f"{1e6 * each.seconds_per_step:.2f}"]
        rows.append(row)
    return rows


def _method_rows(comparison: Comparison) -> list[list[str]]:
    rows = []
    for each in comparison.methods:
        if each.trajectory is None or each.accuracy is None:
            rows.append([each.method, short(each.tolerance), *["-"] * 6, "-"])
            continue
        good = each.accuracy
        row = [each.method, short(each.tolerance)]
        row += [short(x) for x in (*good.omega, good.energy, good.momentum)]
        row += [str(each.trajectory.evaluations), f"{1e3 * each.seconds:.1f}"]
        rows.append(row)
    return rows


def _stop(stop: Stop, limit: float) -> str:
    quotient = "inf" if math.isinf(stop.quotient) else f"{stop.quotient:.0f}"
    if len(quotient) > 5:
        quotient = short(stop.quotient)
    return f"{stop.variable} {quotient}>{limit:g}"


def _ended(run: Trajectory) -> str:
    return "overflow" if run.ended == "overflow" else "-"


def _count(ulps: float) -> str:
    return f"{ulps:.0f}" if ulps < 1000 else short(ulps)


def _accuracy_cells(good: Accuracy) -> dict[str, str]:
    return {
        "error_w1": _cell(good.omega[0]),
        "error_w2": _cell(good.omega[1]),
        "error_w3": _cell(good.omega[2]),
        "error_v": _cell(good.velocity),
        "energy_drift": _cell(good.energy),
        "momentum_drift": _cell(good.momentum),
    }


def _cell(x: float | None) -> str:
    return "" if x is None else repr(x)
