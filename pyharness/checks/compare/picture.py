"""The picture of a comparison: omega over time, and its errors below."""

from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.checks.compare.agreement import Accuracy
from pyharness.checks.compare.findings import Comparison, MethodFinding, ProgramFinding
from pyharness.engine.plan.report import mark_end
from pyharness.model.report import Picture, Table, numbers
from pyharness.model.scene_report import heading
from pyharness.model.trajectory import WITH_ALL_ROWS, Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# The line styles differ even without colour.
_STYLES: dict[str, dict[str, Any]] = {
    "original": {"color": "#c02020", "linestyle": (0, (5, 2)), "linewidth": 1.4},
    "custom": {"color": "#107040", "linestyle": (0, (6, 1, 1, 1)), "linewidth": 1.4},
    "corrected": {"color": "#1040a0", "linestyle": (0, (1, 1.2)), "linewidth": 2.0},
}
_REFERENCE: dict[str, Any] = {"color": "#b8b8b8", "linestyle": "-", "linewidth": 3.5}
# Markers for trajectories of a single time, which have no line; distinct even at the same point.
_MARKERS: dict[str, dict[str, Any]] = {
    "reference": {"marker": "s", "markersize": 11.0},
    "original": {"marker": "o", "markersize": 8.0, "markerfacecolor": "none"},
    "custom": {"marker": "D", "markersize": 5.0, "markerfacecolor": "none"},
    "corrected": {"marker": ".", "markersize": 5.0},
}


def _curves(comparison: Comparison) -> list[tuple[str, str, Trajectory, Accuracy]]:
    found: list[tuple[str, str, ProgramFinding | MethodFinding]]
    found = [(each.listing.program, each.listing.label, each) for each in comparison.programs]
    found += [(each.method, "", each) for each in comparison.methods if not comparison.programs]
    solved = ((name, label, each.trajectory, each.accuracy) for name, label, each in found)
    return [(name, label, run, good) for name, label, run, good in solved if run and good]


def comparison_picture(comparison: Comparison) -> Picture:
    """Return a picture of omega and the errors, with a column for each program or method."""
    from matplotlib.figure import Figure

    curves = _curves(comparison)
    names = list(dict.fromkeys(name for name, *_ in curves))
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
        for _, label, run, good in (each for each in curves if each[0] == name):
            for row in range(3):
                _line(axes[row, column], run.time, run.omega[:, row], label)
            for row, error in enumerate((good.error, good.turned), 3):
                if error is not None:
                    shown = np.isfinite(error) & (error > 0.0)
                    _line(axes[row, column], run.time[: len(error)][shown], error[shown], label)
    ended = [(name, run) for name, _, run, _ in curves if run.ended not in WITH_ALL_ROWS]
    for row in range(3):
        axes[row, 0].set_ylabel(f"$\\omega_{row + 1}$ (rad/s)")
        _frame(axes[row, 0], truth.omega[:, row])
        for name, run in ended:
            mark_end(axes[row, names.index(name)], run, row)
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
    exact = np.column_stack([truth.time, truth.omega]).tolist()
    rows = [["reference", "", *row, *bounds] for row in exact]
    for name, label, run, good in _curves(comparison):
        n, angles = len(good.error), [] if good.turned is None else [good.turned]
        found = np.column_stack([run.time[:n], run.omega[:n], good.error, *angles])
        rows += [[name, label, *row] for row in found.tolist()]
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
