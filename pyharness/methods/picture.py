"""The picture of one trajectory: its components over time."""

from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.report import Picture, Table
from pyharness.model.scene_report import ending
from pyharness.model.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_END: dict[str, Any] = {
    "color": "black", "marker": "x", "linestyle": "none", "clip_on": False, "zorder": 5,
}  # fmt: skip


def trajectory_picture(title: str, trajectory: Trajectory, numbers: Table) -> Picture:
    """Draw the components of one trajectory; say where it ended, if not with its last step."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 7.0), dpi=110, layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    for row in range(3):
        marker = "o" if len(trajectory.time) == 1 else ""
        style: dict[str, Any] = {"color": "black", "linewidth": 1.2, "marker": marker}
        axes[row].plot(trajectory.time, trajectory.omega[:, row], **style)
        if trajectory.ended != "complete":
            mark_end(axes[row], trajectory, row)
        axes[row].set_ylabel(f"$\\omega_{row + 1}$ (rad/s)")
        axes[row].grid(visible=True, linewidth=0.3)
    axes[2].set_xlabel("time (s)")
    note = f"x: {ending(trajectory)}" if trajectory.ended != "complete" else ""
    return Picture(figure, numbers, (title, note))


def mark_end(axes: "Axes", trajectory: Trajectory, row: int) -> None:
    """Mark where a program ended, at the edge where it has left the frame."""
    bottom, top = axes.get_ylim()
    axes.plot(trajectory.time[-1:], np.clip(trajectory.omega[-1:, row], bottom, top), **_END)
    axes.set_ylim(bottom, top)
