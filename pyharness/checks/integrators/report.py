"""The report of `verify --integrator`."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.checks.integrators.coverage import with_coverage
from pyharness.checks.integrators.judging import Verdict
from pyharness.checks.integrators.problem import PARTS, growth_power
from pyharness.checks.report import checks_report, listed_singly, references, summary_page, verdict
from pyharness.model.report import (
    Column,
    Line,
    Picture,
    Report,
    Section,
    Table,
    digits,
    numbers,
    short,
    words,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ORDERS = (
    *words("problem"), Column("order of omega", digits(".2f")), Column("error", short),
    Column("order of attitude", digits(".2f")), Column("error (rad)", short),
)  # fmt: skip
_DRIFTS = (
    *words("quantity"), Column("largest drift", short), Column("power of time", digits(".1f")),
)  # fmt: skip
_MEANINGS = {
    "energy": "energy, relative",
    "momentum": "|L|, relative",
    "direction": "direction of L in space, rad",
}
_STYLES: dict[str, dict[str, Any]] = {
    "free": {"color": "#1040a0", "linestyle": "-"},
    "constant": {"color": "#c02020", "linestyle": (0, (5, 2))},
    "wave": {"color": "#107040", "linestyle": (0, (1, 1.2))},
    "mixed": {"color": "#806000", "linestyle": (0, (7, 1, 1, 1))},
    "fast": {"color": "#7020a0", "linestyle": (0, (3, 1))},
    "slow": {"color": "#505050", "linestyle": (0, (1, 3))},
}
_MARKERS = "os^Dv"
_FLOOR = 1e-17  # smaller errors, and 0, are drawn here


def integrator_report(found: Verdict, seed: str) -> Report:
    told = f"{found.command}: against the true solution of random scenes (seed: {seed})"
    title = [told, *map(str, references(found.checks))]
    tables = [_orders(found), _drifts(found), _findings(found)]
    failed = listed_singly([check for check in found.checks if not check.passed])
    text: list[Section] = [title, failed, *tables, [verdict(found.checks)]]
    page = summary_page("verify --integrator", found.checks, title, depth=2, more=tables)
    orders = [
        (judged.problem.name, each) for judged in found.judged for each in judged.convergences
    ]
    convergence = [
        {"problem": name, "part": each.part, "control": found.control} | asdict(each)
        for name, each in orders
    ]
    report = checks_report(
        "verify", found.checks, text, page, integrator=found.command, seed=seed,
        findings=list(map(asdict, found.findings)), convergence=convergence,
    )  # fmt: skip
    report = report._replace(pictures={"integrator": lambda: integrator_picture(found)})
    return with_coverage(report, found.tried)


def _orders(found: Verdict) -> Section:
    rows = []
    for judged in found.judged:
        row: list[Any] = [judged.problem.name]
        for each in map(judged.order_of, PARTS):
            row += [None, None] if each is None else [each.order, each.errors[-1]]
        rows.append(row)
    by_tolerance = found.control == "tolerance"
    told = (
        f"order: power of the {'tolerance' if by_tolerance else 'step size'} with which the error "
        f"falls{' (1: in proportion)' if by_tolerance else ''}; a dash: rounding only. error: with "
        f"the smallest {'tolerance' if by_tolerance else 'step'}, of omega relative to the largest"
    )
    return [told, Table(_ORDERS, rows)] if rows else []


def _drifts(found: Verdict) -> Section:
    if found.drift is None:
        return []
    times, named = found.drift.times, found.drift.named.items()
    rows = [[_MEANINGS[x], float(np.abs(y).max()), growth_power(times, y)] for x, y in named]
    return [f"without torque, up to {times[-1]:g} s; L: angular momentum", Table(_DRIFTS, rows)]


def _findings(found: Verdict) -> Section:
    if found.judged and not found.findings:
        return [Line("no known fault was recognised")]
    return [
        f"FOUND {each.name}: {each.text} (in {', '.join(each.problems)})" for each in found.findings
    ]


def _inside(values: Any) -> Any:
    return np.clip(values, _FLOOR, 1e3)


def integrator_picture(found: Verdict) -> Picture:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2), dpi=110, layout="constrained")
    panels: list[Axes] = list(figure.subplots(1, 3))
    rows: list[list[Any]] = []
    for part, axes in zip(PARTS, panels, strict=False):
        for judged in found.judged:
            each, name = judged.order_of(part), judged.problem.name
            if each is None:
                continue
            marker = _MARKERS[int(name.rpartition("-")[2]) % len(_MARKERS)]
            style = {"markersize": 4.5, "markerfacecolor": "none", **_STYLES[judged.problem.kind]}
            axes.loglog(each.settings, _inside(each.errors), marker=marker, label=name, **style)
            pairs = zip(each.settings, each.errors, strict=True)
            rows += [[name, part, x, error] for x, error in pairs]
        unit = "relative" if part == "omega" else "rad"
        axes.set_title(f"error of {part}, {unit}", fontsize=10)
        axes.set_xlabel("tolerance" if found.control == "tolerance" else "step size, s")
        axes.grid(True, alpha=0.3)
        if axes.lines:
            axes.legend(fontsize=7)
    if found.drift is not None:
        drawn = zip(found.drift.named.items(), _STYLES.values(), strict=False)
        for (name, values), style in drawn:
            shown = _inside(np.abs(values))
            panels[2].semilogy(found.drift.times, shown, label=_MEANINGS[name], **style)
            pairs = zip(found.drift.times.tolist(), values.tolist(), strict=True)
            rows += [["long", name, t, value] for t, value in pairs]
        panels[2].legend(fontsize=7)
    panels[2].set_title("drift without torque", fontsize=10)
    panels[2].set_xlabel("time, s")
    panels[2].grid(True, alpha=0.3)
    table = numbers("problem quantity setting_or_time value", rows)
    return Picture(figure, table, [f"{found.command}: errors and drifts"])
