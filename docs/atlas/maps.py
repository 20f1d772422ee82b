"""Shared parts of the pictures of the atlas: maps of the square of all bodies, stability regions.

A body has the coordinates b/a and c/b in the square. There a >= b >= c are the integrals of x^2,
y^2 and z^2 over the mass, with x, y and z along the principal axes.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.checks.theory.amplification import Regions
from pyharness.model.scene import Triple
from pyharness.model.trajectory import Array
from pyharness.sweep.axes import Axis
from pyharness.sweep.store import Store

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLORS = ("#101010", "#1040a0", "#c02020", "#107040", "#806000", "#7030a0")
_MOST_PLACES = 200
_BODIES = {"Case 3": (41.0, 39.0, 20.0), "Cases 4, 5": (40.0, 30.0, 20.0)}
_OF_REGIONS = (
    ("two-term and four-term, original and corrected", "collocation", "#101010", "solid"),
    ("runge-kutta corrected, rk4", "runge-kutta, corrected", "#1040a0", (0, (1, 1.2))),
    ("runge-kutta original", "runge-kutta, original", "#c02020", (0, (6, 2))),
)


def axis_of(store: Store, field: str) -> Axis:
    """Return the sweep axis that varies a field."""
    return next(axis for axis in store.sweep.axes if axis.field == field)


def values_of(store: Store, field: str) -> Any:
    """Return the values along the axis of a field."""
    return axis_of(store, field).coordinates()


def thinned(count: int, most: int = _MOST_PLACES) -> Any:
    """Return at most `most` evenly spaced indices of `count` values."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def nearest(values: Array, value: float) -> int:
    """Return the index of the positive number nearest to `value` on a logarithmic scale."""
    return int(np.argmin(np.abs(np.log(values / value))))


def square_map(plot: "Axes", store: Store, values: Array, **style: Any) -> Any:
    """Draw values over the square, and mark the bodies of the thesis."""
    across, up = values_of(store, "body.square.1"), values_of(store, "body.square.2")
    rows, columns = thinned(len(up)), thinned(len(across))
    shown = values[np.ix_(rows, columns)]
    drawn = plot.pcolormesh(
        across[columns], up[rows], shown, shading="nearest", rasterized=True, **style
    )
    plot.set_xlabel("b / a: 0 long, 1 flat", fontsize=8)
    plot.set_ylabel("c / b: 0 lamina, 1 long", fontsize=8)
    plot.set_aspect("equal")
    for name, moments in _BODIES.items():
        x, y = place_of(moments)
        plot.plot(x, y, "o", markersize=4, markerfacecolor="white", markeredgecolor="black")
        plot.annotate(
            name, (x, y), (4, 3), textcoords="offset points", fontsize=7, color="black",
            bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "alpha": 0.6, "linewidth": 0},
        )  # fmt: skip
    return drawn


def square_rows(store: Store, what: str, values: Array, most: int) -> list[list[Any]]:
    """Return values at up to `most`**2 points of the square as rows: what, b/a, c/b, value."""
    across, up = values_of(store, "body.square.1"), values_of(store, "body.square.2")
    return [
        [what, float(across[j]), float(up[i]), float(f"{values[i, j]:.6g}")]
        for i in thinned(len(up), most)
        for j in thinned(len(across), most)
    ]


def place_of(moments: Triple) -> tuple[float, float]:
    """Return the coordinates b/a and c/b of a body in the square."""
    low, middle, high = sorted(moments)
    # Twice the integrals of x^2, y^2, z^2 over the mass.
    a, b, c = middle + high - low, low + high - middle, low + middle - high
    return b / a, c / b


def region_panels(plane: "Axes", growth: "Axes", found: Regions) -> None:
    """Draw stability regions in the plot `plane`, growth on the imaginary axis in `growth`."""
    regions = {each.name: each for each in found.regions}
    plane.axvspan(found.real[0], 0.0, color="#ededed", zorder=0)
    for name, label, color, dash in _OF_REGIONS:
        style: dict[str, Any] = {"linewidth": 1.6, "color": color, "linestyle": dash}
        region = regions[name]
        plane.contour(
            found.real, found.imaginary, region.radius, levels=[1.0], colors=color,
            linestyles=[dash], linewidths=1.6,
        )  # fmt: skip
        shown = np.where(region.growth > 0.0, region.growth, np.nan)
        growth.plot(found.distances, shown, label=label, **style)
    for line in (plane.axhline, plane.axvline):
        line(0.0, color="#808080", linewidth=0.6)
    plane.set_aspect("equal")
    plane.set_title("linear: does not grow within", fontsize=9)
    plane.set_xlabel("real part of z = h lambda", fontsize=8)
    plane.set_ylabel("imaginary part", fontsize=8)
    growth.set_xscale("log")
    growth.set_yscale("log")
    growth.set_ylim(1e-13, 10.0)
    growth.set_title("linear: growth of a wobble in a step", fontsize=9)
    growth.set_xlabel("its angle in a step, |z| (rad)", fontsize=8)
    growth.legend(fontsize=7, loc="upper left", handlelength=3.5)
    growth.grid(visible=True, linewidth=0.3)
