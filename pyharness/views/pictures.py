"""Pictures: findings in, picture and its numbers out; nothing is computed here."""

import io
import textwrap
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.cli.output import numbers_beside
from pyharness.compare.comparison import Comparison
from pyharness.model.errors import InputError
from pyharness.model.trajectory import Trajectory
from pyharness.views.text import csv_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
# Told apart without colour: by dash and width.
_STYLES: dict[str, dict[str, Any]] = {
    "original": {"color": "#c02020", "linestyle": (0, (5, 2)), "linewidth": 1.4},
    "custom": {"color": "#107040", "linestyle": (0, (6, 1, 1, 1)), "linewidth": 1.4},
    "corrected": {"color": "#1040a0", "linestyle": (0, (1, 1.2)), "linewidth": 2.0},
}
_REFERENCE: dict[str, Any] = {"color": "#b8b8b8", "linestyle": "-", "linewidth": 3.5}
# Of what has one row, which no line shows; those of one place can all be seen.
_MARKERS: dict[str, dict[str, Any]] = {
    "reference": {"marker": "s", "markersize": 11.0},
    "original": {"marker": "o", "markersize": 8.0, "markerfacecolor": "none"},
    "custom": {"marker": "D", "markersize": 5.0, "markerfacecolor": "none"},
    "corrected": {"marker": ".", "markersize": 5.0},
}
_END: dict[str, Any] = {
    "color": "black", "marker": "x", "linestyle": "none", "clip_on": False, "zorder": 5,
}  # fmt: skip
# Of a title in letters of size 10.
_LETTERS_PER_INCH = 12.5
_MOST_LINES = 4


def check_picture(path: str) -> None:
    """Refuse a picture that can't be made, before anything is computed for it."""
    suffix = Path(path).suffix.lstrip(".").lower()
    if suffix not in FORMATS:
        raise InputError(f"--plot '{path}': unknown picture format; allowed: {', '.join(FORMATS)}")
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise InputError("--plot needs matplotlib: 'pip install matplotlib'") from None


def comparison_picture(comparison: Comparison, path: str) -> dict[str, bytes]:
    """Draw components over time above the error, a column for each program.

    Returns
    -------
    dict
        Content by path: the picture, and beside it the plotted numbers as CSV.
    """
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(each.listing.program for each in comparison.programs))
    figure = Figure(figsize=(4.2 * max(len(names), 1.4), 9.0), layout="constrained")
    axes = figure.subplots(4, len(names), sharex=True, sharey="row", squeeze=False)
    truth = comparison.reference
    for column, name in enumerate(names):
        axes[0, column].set_title(name)
        axes[3, column].set_xlabel("time (s)")
        for row in range(3):
            _line(axes[row, column], truth.time, truth.omega[:, row], "reference")
        for each in comparison.programs:
            if each.listing.program != name:
                continue
            run, label = each.trajectory, each.listing.label
            for row in range(3):
                _line(axes[row, column], run.time, run.omega[:, row], label)
            error = each.accuracy.error
            shown = np.isfinite(error) & (error > 0.0)
            _line(axes[3, column], run.time[: len(error)][shown], error[shown], label)
    ended = [each for each in comparison.programs if each.trajectory.ended != "complete"]
    for row in range(3):
        axes[row, 0].set_ylabel(f"$\\omega_{row + 1}$ (rad/s)")
        _frame(axes[row, 0], truth.omega[:, row])
        for each in ended:
            _end(axes[row, names.index(each.listing.program)], each.trajectory, row)
    axes[3, 0].set_yscale("log")
    axes[3, 0].set_ylabel("error of any $\\omega$ (rad/s)")
    for column in range(len(names)):
        axes[3, column].axhline(truth.error, color="black", linewidth=0.8)
        axes[3, column].grid(visible=True, linewidth=0.3)
    _limit_errors(axes[3, 0])
    axes[0, 0].legend(loc="best", handlelength=4)
    scene = comparison.scene
    title = f"Case {scene.case}: {scene.name}" if scene.case else scene.name
    note = "x: the program stopped or overflowed; at the edge: out of view" if ended else ""
    _title(figure, f"{title}; thin line: error of the reference", note)
    return {path: _saved(figure, path), numbers_beside(path): _numbers(comparison).encode()}


def trajectory_picture(title: str, trajectory: Trajectory, path: str) -> dict[str, bytes]:
    """Draw the components of one trajectory over time; return content by path, with the CSV."""
    from matplotlib.figure import Figure

    from pyharness.views.text import ending, trajectory_rows

    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    for row in range(3):
        marker = "o" if len(trajectory.time) == 1 else ""
        style: dict[str, Any] = {"color": "black", "linewidth": 1.2, "marker": marker}
        axes[row].plot(trajectory.time, trajectory.omega[:, row], **style)
        if trajectory.ended != "complete":
            _end(axes[row], trajectory, row)
        axes[row].set_ylabel(f"$\\omega_{row + 1}$ (rad/s)")
        axes[row].grid(visible=True, linewidth=0.3)
    axes[2].set_xlabel("time (s)")
    _title(figure, title, f"x: {ending(trajectory)}" if trajectory.ended != "complete" else "")
    numbers = csv_text(*trajectory_rows(trajectory))
    return {path: _saved(figure, path), numbers_beside(path): numbers.encode()}


def _line(axes: "Axes", time: np.ndarray, values: np.ndarray, label: str) -> None:
    style = _REFERENCE if label == "reference" else _STYLES[label]
    marker = _MARKERS[label] if len(time) == 1 else {}
    axes.plot(time, values, label=label, **style, **marker)


def _end(axes: "Axes", trajectory: Trajectory, row: int) -> None:
    """Mark where a program ended, at the edge where it has left the frame."""
    bottom, top = axes.get_ylim()
    axes.plot(trajectory.time[-1:], np.clip(trajectory.omega[-1:, row], bottom, top), **_END)
    axes.set_ylim(bottom, top)


def _title(figure: "Figure", *paragraphs: str) -> None:
    room = int(_LETTERS_PER_INCH * figure.get_figwidth())
    lines = [
        line
        for each in paragraphs
        for line in textwrap.wrap(
            each, room, max_lines=_MOST_LINES, placeholder=" ...", break_on_hyphens=False
        )
    ]
    figure.suptitle("\n".join(lines), fontsize=10, parse_math=False)


def _saved(figure: "Figure", path: str) -> bytes:
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # A box stands for a letter that the font lacks, as everywhere.
        warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
        figure.savefig(buffer, format=Path(path).suffix.lstrip(".").lower(), dpi=110)
    return buffer.getvalue()


def _frame(axes: "Axes", truth: np.ndarray) -> None:
    """Keep the frame near the truth: a program that diverges leaves the picture."""
    if not len(truth):
        return
    low, high = float(truth.min()), float(truth.max())
    margin = max(0.6 * (high - low), 0.05 * max(abs(low), abs(high)), 1e-12)
    bottom, top = axes.get_ylim()
    axes.set_ylim(max(bottom, low - margin), min(top, high + margin))


def _limit_errors(axes: "Axes") -> None:
    bottom, top = axes.get_ylim()
    axes.set_ylim(max(bottom, 1e-17), min(top, 1e4))


def _numbers(comparison: Comparison) -> str:
    head = ["method", "listing", "time", "omega1", "omega2", "omega3", "error"]
    truth = comparison.reference
    rows = [
        ["reference", "", *map(repr, (t, *omega)), repr(truth.error)]
        for t, omega in zip(truth.time.tolist(), truth.omega.tolist(), strict=True)
    ]
    for each in comparison.programs:
        run = each.trajectory
        errors = each.accuracy.error.tolist()
        for t, omega, error in zip(run.time.tolist(), run.omega.tolist(), errors, strict=False):
            rows.append([each.listing.program, each.listing.label])
            rows[-1] += map(repr, (t, *omega, error))
    return csv_text(head, rows)
