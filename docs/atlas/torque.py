"""The picture `torque.png`: flips and tilts under a torque fixed in the body."""

from typing import TYPE_CHECKING, Any

import numpy as np

from docs.atlas.maps import COLORS, nearest, square_map, square_rows, values_of
from pyharness.model.report import Picture, numbers
from pyharness.model.trajectory import Array
from pyharness.sweep.store import Store

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TILT = 1e-4  # rad, in the maps
_AXES = {1: "least", 2: "middle", 3: "largest"}
_MOST_MAPS = 6
_MOST_FLIPS = 8
_FEW = 16


def torque_picture(store: Store) -> Picture:
    """Draw flips over the square; by initial tilt, the part that flips, and mean largest tilts."""
    from matplotlib.colors import BoundaryNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 7.4), dpi=85, layout="constrained")
    plots = figure.subplots(2, 4)
    tilts = values_of(store, "tilt")
    at = nearest(tilts, _TILT)
    flips, largest = store.array("flips"), store.array("largest-tilt")
    told = _told(store)[:_MOST_MAPS]
    norm = BoundaryNorm([n - 0.5 for n in range(_MOST_FLIPS + 2)], 256, extend="max")
    drawn: Any = None
    rows: list[list[Any]] = []
    for i, (plot, name) in enumerate(zip(plots[:, :3].ravel(), told, strict=False)):
        values = np.asarray(flips[i, at], dtype=float)
        drawn = square_map(plot, store, values, norm=norm, cmap="viridis")
        plot.set_title(name, fontsize=9)
        rows += square_rows(store, f"flips: {name}, tilt {tilts[at]:.0e}", values, _FEW)
    figure.colorbar(drawn, ax=list(plots[:, :3].ravel()), label=f"flips, tilt {tilts[at]:.0e} rad",
                    shrink=0.6, ticks=range(_MOST_FLIPS + 1), location="left")  # fmt: skip
    shares = np.array([np.mean(np.asarray(flips[i]) > 0, axis=(1, 2)) for i in range(len(told))])
    mean = np.array([np.mean(np.asarray(largest[i]), axis=(1, 2)) for i in range(len(told))])
    _lines(plots[0, 3], tilts, shares, told, "part of the bodies that flip")
    _lines(plots[1, 3], tilts, mean, told, "mean of the largest tilt (rad)")
    for name, share, angle in zip(told, shares, mean, strict=True):
        rows += [[f"flip: {name}", x, "", y] for x, y in zip(tilts, share, strict=True)]
        rows += [[f"largest tilt: {name}", x, "", y] for x, y in zip(tilts, angle, strict=True)]
    plots[0, 3].legend(fontsize=7)
    title = [store.sweep.name, f"{store.sweep.n_scenes:.4g} bodies, {store.sweep.solver.t_end:g} s"]
    return Picture(figure, numbers("what x y value", rows), title)


def _told(store: Store) -> list[str]:
    count = store.sweep.dimensions["torque"]
    found = [""] * count
    for axis in store.sweep.axes:
        if axis.dimension == "torque":
            number = int(axis.field[-1])
            for i, value in enumerate(axis.coordinates()):
                if value:
                    found[i] += f"{value:+g} N m, {_AXES[number]} moment's axis "
    return [each.strip() or "no torque" for each in found]


def _lines(plot: "Axes", tilts: Array, values: Array, told: list[str], label: str) -> None:
    for curve, name, color in zip(values, told, COLORS, strict=False):
        plot.plot(tilts, curve, color=color, linewidth=1.3, label=name)
    plot.set_xscale("log")
    plot.set_xlabel("tilt from the middle axis (rad)", fontsize=8)
    plot.set_ylabel(label, fontsize=8)
    plot.set_ylim(0.0)
    plot.grid(visible=True, linewidth=0.3)
