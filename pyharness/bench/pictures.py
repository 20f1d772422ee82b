"""The pictures of `bench`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pyharness.bench.measure import Finding, Workload
from pyharness.engine.plan.registry import FIXED_STEP
from pyharness.model.report import Picture, Table, numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pyharness.bench.growth import Growth

_FLOOR = 2.0**-53  # relative error of one rounding in double precision
# Distinct without colours: dashes and line width show a solver's group, markers the solver.
_FAMILIES: dict[str, dict[str, Any]] = {
    "ours": {"linestyle": "-", "linewidth": 1.5, "color": "#1040a0"},
    "gauss": {"linestyle": (0, (6, 1.5)), "linewidth": 0.9, "color": "#3a86c8"},
    "program": {"linestyle": (0, (1, 1.5)), "linewidth": 1.3, "color": "#806000"},
    "peer": {"linestyle": (0, (5, 1.5, 1, 1.5)), "linewidth": 1.1, "color": "#b02018"},
}
_MARKERS = "osD^v<>pP*Xhd8"
_PROGRAMS = ("two-term", "four-term", "runge-kutta")
_OURS = ("auto", "taylor", "closed-form", *FIXED_STEP)
_SLOPES = (2, 4, 8)


def bench_picture(finding: Finding, data: Table) -> Picture:
    from matplotlib.figure import Figure

    count = len(finding.workloads)
    figure = Figure(figsize=(14.0, 4.6 * count + 2.2), dpi=100, layout="constrained")
    axes = figure.subplots(count, 2, squeeze=False, sharey="row")
    names = list(dict.fromkeys(row.method for row in finding.rows))
    styles = _styles(names)
    for (left, right), load in zip(axes, finding.workloads, strict=True):
        rows = [
            (row.method, 1e6 * row.seconds, row.evaluations, max(row.error, _FLOOR / 8.0))
            for row in finding.rows
            if row.workload == load and row.seconds is not None
            if row.error is not None and row.error < 1.0
        ]
        for name in names:
            own = [row[1:] for row in rows if row[0] == name]
            timed = [(time, error) for time, _, error in own]
            counted = [(float(count), error) for _, count, error in own if count]
            for axis, points in ((left, timed), (right, counted)):
                if points:
                    axis.plot(*zip(*points, strict=True), label=name, **styles[name])
        _frame(left, load, "microseconds per solve")
        _frame(right, load, "right-hand sides per solve")
        if any(count for _, _, count, _ in rows):
            draw_slopes(right)
    handles: dict[str, Any] = {}
    for each in axes.flat:
        found, labels = each.get_legend_handles_labels()
        handles |= dict(zip(labels, found, strict=True))
    ordered = [name for name in [*names, "rounding"] if name in handles]
    figure.legend(
        [handles[name] for name in ordered], ordered, loc="outside lower center", ncols=5,
        handlelength=5.0, frameon=False, fontsize=9,
    )  # fmt: skip
    figure.suptitle(
        "Error at T over the largest omega there. Grey: rounding (2**-53), slopes of the orders "
        f"{', '.join(map(str, _SLOPES))}.\n"
        "A Taylor series evaluates no right-hand side, and a closed form none: "
        "they stand on the left only.",
        fontsize=10,
    )
    return Picture(figure, data)


def _styles(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    used: Counter[str] = Counter()
    styles = {}
    for name in names:
        if name in _OURS:
            family = "ours"
        elif name.startswith("gauss-"):
            family = "gauss"
        else:
            family = "program" if name.startswith(_PROGRAMS) else "peer"
        marker = _MARKERS[used[family] % len(_MARKERS)]
        used[family] += 1
        face = _FAMILIES[family]["color"] if family in ("ours", "program") else "white"
        styles[name] = _FAMILIES[family] | {
            "marker": marker, "markersize": 5.0, "markerfacecolor": face, "markeredgewidth": 0.8,
        }  # fmt: skip
    return styles


def _frame(axes: "Axes", load: Workload, label: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(_FLOOR / 10.0, 1.0)
    axes.axhline(_FLOOR, color="#909090", linewidth=2.5, label="rounding", zorder=0)
    axes.set_xlabel(label)
    axes.set_ylabel("error")
    axes.grid(visible=True, linewidth=0.3)
    axes.set_title(f"Case {load.label}: {load.scene.name}, T = {load.horizon:g} s", fontsize=9)


def draw_slopes(axes: "Axes") -> None:
    low, high = axes.get_xlim()
    begin = high * (low / high) ** 0.3
    for order in _SLOPES:
        end = min(begin * (high / begin) ** 0.7, begin * 10.0 ** (6.0 / order))
        last = 0.5 * (end / begin) ** -order
        axes.plot([begin, end], [0.5, last], color="#909090", linewidth=1.0, zorder=0)
        axes.annotate(
            f"order {order}", (end, last), (0, -2), textcoords="offset points", color="#505050",
            fontsize=8, ha="center", va="top", zorder=5,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )  # fmt: skip
    axes.set_xlim(low, high)


def growth_picture(found: "Mapping[int, Sequence[Growth]]") -> Picture:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.5 * len(found), 4.0), dpi=110, layout="constrained")
    axes = figure.subplots(1, len(found), sharey=True, squeeze=False)
    rows = []
    for place, (case, growths) in enumerate(found.items()):
        times = [each.time for each in growths]
        one = axes[0, place]
        one.loglog(times, [each.error for each in growths], "k-o", label="Taylor, tolerance 1e-15")
        yardstick = [each.conditioning for each in growths]
        one.loglog(times, yardstick, "k--", label="one rounding of time")
        one.set_title(f"Case {case}", fontsize=10)
        one.set_xlabel("time (s)")
        one.grid(visible=True, linewidth=0.3)
        rows += [[case, each.time, each.error, each.conditioning] for each in growths]
    axes[0, 0].set_ylabel("error over the largest omega")
    axes[0, 0].legend(loc="best")
    return Picture(figure, numbers("case time error one_rounding", rows))
