"""The picture `collocation.png`: where the collocation programs diverge."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from docs.atlas.maps import region_panels, thinned, values_of
from pyharness.checks.theory.amplification import regions
from pyharness.checks.theory.rotations import rates
from pyharness.model.facts import facts
from pyharness.model.report import Picture, numbers
from pyharness.model.trajectory import Array
from pyharness.sweep.store import Store

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TENFOLD = 10.0
_FEW = 21


def collocation_picture(store: Store) -> Picture:
    """Draw overflow times, energy changes, and the steps at which a wobble grows tenfold."""
    from matplotlib.figure import Figure

    sweep = store.sweep
    programs, listings = list(values_of(store, "program")), list(values_of(store, "listing"))
    steps, sizes = values_of(store, "step_size"), values_of(store, "omega.magnitude")
    columns = len(programs) * len(listings)
    figure = Figure(figsize=(3.5 * columns + 3.8, 7.2), dpi=80, layout="constrained")
    plots = figure.subplots(2, columns + 1, squeeze=False)
    seconds = float(steps[0] * values_of(store, "steps")[0])
    predicted = tenfold(sweep.scene.euler_coefficients, sweep.scene.omega, sizes, seconds)
    rows: list[list[Any]] = []
    drawn: list[Any] = [None, None]
    for number in range(columns):
        i, j = divmod(number, len(listings))
        times = np.asarray(store.array("overflow-time")[i, j])
        drift = np.asarray(store.array("drift")[i, j])[..., 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            digits = np.log10(drift)
        for row, (values, limits, cmap) in enumerate(
            ((times, (0.0, seconds), "plasma"), (digits, (-8.0, 2.0), "viridis"))
        ):
            plot = plots[row, number]
            down, across = thinned(len(steps)), thinned(len(sizes))
            drawn[row] = plot.pcolormesh(
                sizes[across], steps[down], values[np.ix_(down, across)], cmap=cmap,
                vmin=limits[0], vmax=limits[1], shading="nearest", rasterized=True,
            )  # fmt: skip
            plot.plot(sizes, predicted, color="#c02020", linestyle="dashed", linewidth=1.2)
            _finish(plot, steps, sizes, float(np.linalg.norm(sweep.scene.omega)))
        over = 100.0 * np.isfinite(times).mean()
        plots[0, number].set_title(
            f"{programs[i]}, {listings[j]}: {over:.0f} % overflow", fontsize=9
        )
        for a in thinned(len(steps), _FEW):
            for b in thinned(len(sizes), _FEW):
                rows.append([programs[i], listings[j], f"{steps[a]:.6g}", f"{sizes[b]:.6g}",
                             f"{times[a, b]:.6g}", f"{drift[a, b]:.3g}"])  # fmt: skip
    for row, label in enumerate(("time of overflow (s)", "log10 of the energy's change")):
        figure.colorbar(drawn[row], ax=list(plots[row, :columns]), label=label, location="left",
                        extend="neither" if row == 0 else "both")  # fmt: skip
    region_panels(plots[0, -1], plots[1, -1], regions())
    title = [sweep.name, f"{seconds:g} s; dashed: a wobble grows tenfold, by the linear region"]
    heads = "program listing step_size omega overflow-time energy-drift"
    return Picture(figure, numbers(heads, rows), title)


def tenfold(
    coefficients: tuple[float, float, float], omega: tuple[float, float, float], sizes: Array,
    seconds: float,
) -> Array:  # fmt: skip
    """Return for each |omega| in `sizes` the step (s) above which a wobble grows tenfold.

    A wobble is an oscillating perturbation of a steady rotation; let z be i times its frequency
    times the step. A step multiplies it by 1 + z + z^2/2, whose magnitude is about 1 + |z|^4/8.
    """
    fastest = max(abs(q.imag) for q in rates(coefficients, omega)) / float(np.linalg.norm(omega))
    wobbles = fastest * sizes
    steps: Array = np.cbrt(8.0 * math.log(_TENFOLD) / (seconds * wobbles**4))
    return steps


def _finish(plot: "Axes", steps: Array, sizes: Array, size: float) -> None:
    plot.set_xscale("log")
    plot.set_yscale("log")
    plot.set_xlim(sizes[0], sizes[-1])
    plot.set_ylim(steps[0], steps[-1])
    plot.set_xlabel("length of omega (rad/s)", fontsize=8)
    plot.set_ylabel("step (s)", fontsize=8)
    plot.plot([size], [facts("cases")["deck"]["step_size"]], "x", color="black", markersize=6)
