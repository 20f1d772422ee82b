"""The picture `stability.png`: times between flips of all bodies, in closed form."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from docs.atlas.maps import COLORS, nearest, square_map, square_rows, values_of
from pyharness.model.report import Picture, numbers
from pyharness.model.trajectory import Array
from pyharness.sweep.store import Store

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAPS = ((1e-8, 0), (1e-4, 0), (1.0, 0), (1.0, -1))  # tilt (rad), index of the azimuth
_LEVELS = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
_LIMITS = (3.0, 1000.0)  # s
_SHARES = (0.01, 0.5, 0.99)
_LONG = 100.0  # s
_FEW = 21


def stability_picture(store: Store) -> Picture:
    """Draw times between flips over the square, their quantiles by tilt, tilts with rare flips."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.5, 8.0), dpi=90, layout="constrained")
    plots = figure.subplots(2, 3)
    tilts, azimuths = values_of(store, "tilt"), values_of(store, "azimuth")
    times = store.array("flip-time")
    places = (plots[0, 0], plots[0, 1], plots[1, 0], plots[1, 1])
    rows: list[list[Any]] = []
    drawn: Any = None
    for plot, (tilt, azimuth) in zip(places, _MAPS, strict=True):
        at = nearest(tilts, tilt)
        values = np.asarray(times[azimuth % len(azimuths), at])
        drawn = square_map(plot, store, values, norm=LogNorm(*_LIMITS), cmap="viridis")
        _contours(plot, store, values)
        toward = f"azimuth {math.degrees(azimuths[azimuth]):.0f} degrees"
        title = f"tilt {tilts[at]:.0e} rad" + ("" if tilt < 1.0 else f", {toward}")
        plot.set_title(title, fontsize=9)
        rows += square_rows(store, f"flip-time at {title}", values, _FEW)
    figure.colorbar(drawn, ax=list(plots[:, :2].ravel()), label="time between flips (s)",
                    shrink=0.6, extend="both", location="left")  # fmt: skip
    shares, last = _scanned(store)
    _curves(plots[0, 2], tilts, azimuths, shares)
    for i, azimuth in enumerate(azimuths):
        for share, curve in zip(_SHARES, shares[i], strict=True):
            what = f"{share:g} of bodies flip within, azimuth {azimuth:.4g}"
            rows += [[what, tilt, "", time] for tilt, time in zip(tilts, curve, strict=True)]
    plot = plots[1, 2]
    shown = square_map(plot, store, last, norm=LogNorm(tilts[0], tilts[-1]), cmap="magma")
    plot.set_title(f"largest tilt with {_LONG:g} s between flips; white: none", fontsize=9)
    figure.colorbar(shown, ax=plot, label="tilt (rad)", shrink=0.8)
    rows += square_rows(store, f"largest tilt with {_LONG:g} s between flips", last, _FEW)
    told = [store.sweep.name, f"{store.sweep.n_scenes:.4g} bodies, 1 rad/s"]
    return Picture(figure, numbers("what x y value", rows), told)


def _contours(plot: "Axes", store: Store, values: Array) -> None:
    across, up = values_of(store, "body.square.1"), values_of(store, "body.square.2")
    if min(len(across), len(up)) < 2:
        return
    lines = plot.contour(across, up, values, levels=_LEVELS, colors="white", linewidths=0.7)
    plot.clabel(lines, fontsize=7, fmt="%g")


def _scanned(store: Store) -> tuple[Array, Array]:
    """Return quantiles of the time between flips (s), and each body's largest tilt with rare flips.

    The quantiles have the shape (azimuth, quantile, tilt). Flips are rare if, at the first azimuth,
    the time between them exceeds `_LONG`. The tilt (rad) is NaN if flips are rare at no tilt.
    """
    tilts, azimuths = values_of(store, "tilt"), values_of(store, "azimuth")
    times = store.array("flip-time")
    shares = np.empty((len(azimuths), len(_SHARES), len(tilts)))
    last = np.full(times.shape[2:], np.nan)
    for j, tilt in enumerate(tilts):
        for i in range(len(azimuths)):
            values = np.asarray(times[i, j])
            flat = values.ravel()
            kth = [int(share * (flat.size - 1)) for share in _SHARES]
            shares[i, :, j] = np.partition(flat, kth)[kth]
            if i == 0:
                last[values > _LONG] = tilt
    return shares, last


def _curves(plot: "Axes", tilts: Array, azimuths: Array, shares: Array) -> None:
    for i, dash in zip(range(len(azimuths)), ("solid", "dashed", "dotted"), strict=False):
        for curve, share, color in zip(shares[i], _SHARES, COLORS[1:], strict=False):
            label = f"{100 * share:g} % of bodies below" if i == 0 else None
            plot.plot(tilts, curve, color=color, linestyle=dash, linewidth=1.3, label=label)
    plot.set_xscale("log")
    plot.set_yscale("log")
    plot.set_xlabel("tilt from the middle axis (rad)", fontsize=8)
    plot.set_ylabel("time between flips (s)", fontsize=8)
    plot.set_title("all bodies; dashed: the second azimuth", fontsize=9)
    plot.grid(visible=True, linewidth=0.3)
    plot.legend(fontsize=7)
