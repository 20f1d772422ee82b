"""The figures of the thesis: findings in, pictures and their numbers out."""

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.history.figures import Curve, FigureFinding
from pyharness.model.report import Picture, Table, numbers
from pyharness.model.trajectory import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Told apart without colour: by dash, width and marker, and by where the markers stand.
_REFERENCE: dict[str, Any] = {"color": "#bdbdbd", "linestyle": "-", "linewidth": 5.0}
_STYLES: dict[str, dict[str, Any]] = {
    "two-term": {
        "color": "#1040a0", "linestyle": (0, (6, 2)), "linewidth": 1.3,
        "marker": "o", "markevery": (2, 15),
    },
    "four-term": {
        "color": "#000000", "linestyle": (0, (1, 1.3)), "linewidth": 1.9,
        "marker": "s", "markevery": (7, 15),
    },
    "runge-kutta": {
        "color": "#b02018", "linestyle": "-", "linewidth": 0.9,
        "marker": "^", "markevery": (12, 15),
    },
}  # fmt: skip
_MARKERS: dict[str, Any] = {"markersize": 5.5, "markerfacecolor": "white", "markeredgewidth": 1.1}
_END: dict[str, Any] = {
    "color": "black", "marker": "X", "markersize": 9, "markeredgecolor": "white",
    "linestyle": "none", "zorder": 5, "clip_on": False,
}  # fmt: skip
_SETS = {"original": "original programs", "corrected": "corrected programs"}


def figure_picture(finding: FigureFinding) -> Picture:
    """Draw a figure: its curves over the reference."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 8.6), dpi=110, layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    truth = finding.reference
    for row in range(3):
        axes[row].plot(truth.time, truth.omega[:, row], label="reference", **_REFERENCE)
        bottom, top = _frame(finding, row)
        axes[row].set_ylim(bottom, top)
        for curve in finding.curves:
            _draw(axes[row], curve, row, bottom, top)
        axes[row].set_ylabel(f"$\\omega_{row + 1}$ (rad/s)")
        axes[row].grid(visible=True, linewidth=0.3)
        axes[row].ticklabel_format(useOffset=False)
    axes[2].set_xlabel("time (s)")
    axes[2].set_xlim(0.0, finding.scene.steps * finding.scene.step_size)
    figure.align_ylabels()
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=2, handlelength=5.0, frameon=False
    )
    figure.suptitle(_heading(finding), fontsize=10)
    return Picture(figure, curve_numbers(finding))


def curve_numbers(finding: FigureFinding) -> Table:
    """Return the plotted numbers: omega (rad/s) by curve and time (s)."""
    truth = finding.reference
    rows = [
        ["reference", "", t, None, *omega]
        for t, omega in zip(truth.time.tolist(), truth.omega.tolist(), strict=True)
    ]
    for curve in finding.curves:
        run, name = curve.trajectory, [curve.listing.program, curve.listing.label]
        times = zip(run.time.tolist(), run.recorded_time.tolist(), strict=True)
        for pair, omega in zip(times, run.omega.tolist(), strict=True):
            rows.append([*name, *pair, *omega])
    return numbers("curve listing time recorded_time omega1 omega2 omega3", rows)


def ending(curve: Curve) -> str:
    """Say in a few words where a curve ends before the last step; empty where it does not."""
    run = curve.trajectory
    if run.stop is not None:
        return f"stopped at step {run.stop.step} by {run.stop.variable}"
    return f"overflow after step {run.steps}" if run.ended != "complete" else ""


def label(curve: Curve) -> str:
    """Name a curve, and where it ends."""
    name, end = curve.listing.program, ending(curve)
    return f"{name} ({end})" if end else name


def _heading(finding: FigureFinding) -> str:
    plan, scene = finding.plan, finding.scene
    title = f"{plan.title}. Case {scene.case}: {scene.name}; {_SETS[plan.set]}"
    note = f"Reference: {finding.reference.source}."
    if any(ending(curve) for curve in finding.curves):
        note += " Cross: the program ends."
    return "\n".join([title, *textwrap.wrap(plan.caption, 98), note])


def _draw(axes: "Axes", curve: Curve, row: int, bottom: float, top: float) -> None:
    run = curve.trajectory
    name = curve.listing.program
    height = top - bottom
    # Far outside the frame a renderer loses its way: there the curve may be anywhere.
    shown = np.clip(run.omega[:, row], bottom - 50.0 * height, top + 50.0 * height)
    axes.plot(run.time, shown, label=label(curve), zorder=3, **_STYLES[name], **_MARKERS)
    if ending(curve) and len(run.time):
        axes.plot(run.time[-1:], np.clip(shown[-1:], bottom, top), **_END)


def _frame(finding: FigureFinding, row: int) -> tuple[float, float]:
    """Return the frame: all of what stays near the reference; what diverges leaves it."""
    truth: Array = finding.reference.omega
    least, largest = float(truth[:, row].min()), float(truth[:, row].max())
    # A curve further off than the fastest turn of the body is on its way out of every picture.
    far = float(np.abs(truth).max())
    near = max(0.6 * (largest - least), 0.01 * far)
    low, high = least, largest
    for curve in finding.curves:
        omega = curve.trajectory.omega[:, row]
        bottom, top = float(omega.min(initial=least)), float(omega.max(initial=largest))
        low = min(low, bottom if bottom > least - far else least - near)
        high = max(high, top if top < largest + far else largest + near)
    margin = max(0.06 * (high - low), 0.001 * far, 1e-12)
    return low - margin, high + margin
