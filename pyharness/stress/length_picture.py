"""The picture of Brouwer's law: `stress --only length --plot FILE`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.report import Picture, numbers
from pyharness.theory.brouwer import LAWS

if TYPE_CHECKING:
    from pyharness.stress.trials.length import Drift

_SHOWN = ("energy", "phase")
_STYLES: dict[str, dict[str, Any]] = {
    "taylor": {"linestyle": "-", "marker": "o", "color": "#1040a0"},
    "gauss-8": {"linestyle": (0, (6, 1.5)), "marker": "s", "color": "#3a86c8"},
    "gauss-4": {"linestyle": (0, (1, 1.5)), "marker": "^", "color": "#b02018"},
}


def length_picture(found: Sequence["Drift"]) -> Picture:
    """Draw energy and phase of each motion."""
    from matplotlib.figure import Figure

    motions = list(dict.fromkeys(each.motion for each in found))
    figure = Figure(figsize=(10.0, 8.0), dpi=100, layout="constrained")
    axes = figure.subplots(len(_SHOWN), len(motions), squeeze=False, sharex=True, sharey="row")
    for row, what in enumerate(_SHOWN):
        for column, motion in enumerate(motions):
            one = axes[row, column]
            own = [each for each in found if (each.motion, each.what) == (motion, what)]
            for each in own:
                style = _STYLES[each.method]
                many = each.starts > 1
                one.loglog(
                    each.steps[many], each.error[many], label=each.method, markersize=4, **style
                )
                # One start alone: open, and not joined to what twelve came to.
                alone = style | {"linestyle": "", "markerfacecolor": "none"}
                one.loglog(each.steps[~many], each.error[~many], markersize=5, **alone)
                one.loglog(each.steps, each.limits, color=style["color"], linewidth=0.5)
            ends = np.array([1e2, 1e7])
            begin = min(each.error[0] for each in own)
            for power, line in ((LAWS[what], "--"), (LAWS[what] + 0.5, ":")):
                law = begin * (ends / ends[0]) ** power
                label = f"power {power:g}: " + ("chance" if line == "--" else "a preference")
                one.loglog(ends, law, line, color="#707070", linewidth=1.0, label=label)
            one.grid(visible=True, linewidth=0.3)
            one.set_title(f"{motion}: {what}", fontsize=10)
            one.legend(fontsize=8, loc="upper left")
            if row == len(_SHOWN) - 1:
                one.set_xlabel("steps")
        axes[row, 0].set_ylabel("error of phase (rad)" if what == "phase" else "relative error")
    figure.suptitle(
        "Errors over many starts of one motion; open: of one start. Thin: the bounds.", fontsize=10
    )
    rows = [
        [each.motion, each.method, each.what, f"{n:.0f}", error, limit, count]
        for each in found
        for n, error, limit, count in zip(
            each.steps, each.error, each.limits, each.starts, strict=True
        )
    ]
    return Picture(figure, numbers("motion method what steps error limit starts", rows))
