"""The picture `stops.png`: where the stop test ends runs, and linear stability regions."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from docs.atlas.maps import region_panels, thinned, values_of
from pyharness.checks.theory.amplification import regions
from pyharness.checks.theory.rotations import rates
from pyharness.engine.methods.linearised import jacobians
from pyharness.engine.solve import solve
from pyharness.model.codes import Statuses
from pyharness.model.facts import facts
from pyharness.model.report import Picture, numbers
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.trajectory import STOP_VARIABLES, Array
from pyharness.sweep.batches import batches
from pyharness.sweep.store import Store
from pyharness.sweep.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLORS = ("#f4f4f4", "#1f77b4", "#2ca02c", "#17becf", "#9467bd", "#d08030", "#d62728", "#808080",
           "#404040", "#000000")  # fmt: skip
_OVERFLOW = 9  # a number that no stop variable has
_LIMIT = 2.0 * 2.0**0.5  # rk4's stability limit on the imaginary axis
_ROWS = 2000
_MOST_PLACES = 400
_FEW = 21


def stops_picture(store: Store) -> Picture:
    """Draw the variable that ends the run, for each listing and case, and predicted limits."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    listings, scenes = list(values_of(store, "listing")), case_scenes(store.sweep)
    figure = Figure(
        figsize=(3.6 * (len(scenes) + 1), 3.6 * max(2, len(listings)) + 0.6), dpi=80,
        layout="constrained",
    )  # fmt: skip
    plots = figure.subplots(max(2, len(listings)), len(scenes) + 1)
    steps, constants = values_of(store, "step_size"), values_of(store, "lipschitz")
    down, across = thinned(len(steps), _MOST_PLACES), thinned(len(constants), _MOST_PLACES)
    norm = BoundaryNorm(np.arange(len(_COLORS) + 1) - 0.5, len(_COLORS))
    rows: list[list[Any]] = []
    switches = np.zeros((len(listings), len(constants)))
    seen: set[int] = set()
    for i, listing in enumerate(listings):
        for j, scene in enumerate(scenes):
            values = _ended(store, i, j)
            switches[i] += (np.diff((values > 0) & (values != _OVERFLOW), axis=0) != 0).sum(axis=0)
            seen.update(np.unique(values).tolist())
            plot = plots[i, j]
            plot.pcolormesh(
                steps[down], constants[across], values[np.ix_(down, across)].T, norm=norm,
                cmap=ListedColormap(_COLORS), shading="nearest", rasterized=True,
            )  # fmt: skip
            told = listing.replace("fix:", "without ")
            _finish(plot, f"{told}\n{scene.name}: {_share(values)}", steps, constants)
            if listing == "corrected":
                _foretell(plot, scene, steps)
            for a in thinned(len(steps), _FEW):
                for b in thinned(len(constants), _FEW):
                    ended = _word(int(values[a, b]))
                    rows.append([listing, scene.name, f"{steps[a]:.6g}", f"{constants[b]:.6g}",
                                 ended])  # fmt: skip
    region_panels(plots[0, -1], plots[1, -1], regions())
    for plot in plots[2:, -1]:
        _switches(plot, constants, switches / len(scenes), listings)
    handles = [
        Patch(facecolor=color, edgecolor="#808080", label=_word(number))
        for number, color in enumerate(_COLORS) if number in seen
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8,
                  frameon=False, title="ended by", title_fontsize=8)  # fmt: skip
    seconds = scenes[0].step_size * scenes[0].steps
    told = f"{seconds:g} s; cross: the deck; dashed: predicted, by the motion and the linear region"
    title = [store.sweep.name, told]
    return Picture(figure, numbers("listing case step_size lipschitz ended", rows), title)


def case_scenes(sweep: Sweep) -> list[Scene]:
    """Return the scenes along the dimension `case`, each named after its case."""
    where = [
        np.arange(n) if name == "case" else np.zeros(sweep.dimensions["case"], dtype=np.int64)
        for name, n in sweep.dimensions.items()
    ]
    cases = {(s.moments, s.omega, s.torque): f"Case {number}" for number in case_numbers()
             if (s := case_scene(number))}  # fmt: skip
    found = []
    for _, batch in batches(sweep, where):
        for i in range(len(batch.omega0)):
            scene = batch.scene_of(i)
            name = cases.get((scene.moments, scene.omega, scene.torque), f"body {i + 1}")
            found.append(replace(scene, name=name))
    return found


def predicted(scene: Scene, t_end: float) -> tuple[float, float]:
    """Return the Lipschitz constant (1/s) and the step size (s) at which stops should begin.

    Below the constant the corrected program stops. It is the maximum of |omega''| / |omega'| from 0
    to `t_end`, to which the quotient of the stop test tends as the step size decreases. Above the
    step size, rk4's stability limit for the fastest oscillation in this time, perturbations grow.
    """
    times = [t_end * (i + 1) / _ROWS for i in range(_ROWS)]
    omega = np.vstack([scene.omega, solve(scene, times).omega])
    a, b, c = scene.euler_coefficients
    x, y, z = omega.T
    change = np.stack([a * y * z, b * z * x, c * x * y], axis=1) + scene.normalized_torque(0.0)
    second = np.einsum("nij,nj->ni", jacobians(scene, omega), change)
    quotients = np.linalg.norm(second, axis=1) / np.linalg.norm(change, axis=1)
    fastest = max(
        max(abs(q.imag) for q in rates((a, b, c), (row[0], row[1], row[2])))
        for row in omega.tolist()
    )
    return float(quotients.max()), _LIMIT / fastest


def _ended(store: Store, listing: int, case: int) -> Array:
    """Return each run's stop variable by number, 0 if complete, or `_OVERFLOW`."""
    variable = np.asarray(store.array("stop-variable")[listing, case])
    status = np.asarray(store.array("status")[listing, case])
    return np.where(status == Statuses.OVERFLOW, _OVERFLOW, variable)


def _word(number: int) -> str:
    if number == _OVERFLOW:
        return "overflow"
    if number == 0:
        return "nothing"
    name = STOP_VARIABLES[number - 1]
    return {"U": "norm of U", "UV": "norm of U and V"}.get(name, name)


def _share(values: Array) -> str:
    stopped = (values > 0) & (values != _OVERFLOW)
    return f"{100.0 * stopped.mean():.0f} % stopped"


def _foretell(plot: "Axes", scene: Scene, steps: Array) -> None:
    constant, step = predicted(scene, scene.step_size * scene.steps)
    style: dict[str, Any] = {"color": "#c02020", "linestyle": "dashed", "linewidth": 1.2}
    plot.axhline(constant, **style)
    if step < steps[-1]:
        plot.axvline(step, **style)


def _switches(plot: "Axes", constants: Array, switches: Array, listings: list[str]) -> None:
    for count, listing in zip(switches, listings, strict=True):
        plot.plot(constants, count, linewidth=1.1, label=listing)
    plot.set_xscale("log")
    plot.set_xlabel("Lipschitz constant (1/s)", fontsize=8)
    plot.set_title("stopped or not: changes along the step", fontsize=9)
    plot.grid(visible=True, linewidth=0.3)
    plot.legend(fontsize=7)


def _finish(plot: "Axes", title: str, steps: Array, constants: Array) -> None:
    plot.set_xscale("log")
    plot.set_yscale("log")
    plot.set_xlim(steps[0], steps[-1])
    plot.set_ylim(constants[0], constants[-1])
    plot.set_title(title, fontsize=8)
    plot.set_xlabel("step (s)", fontsize=8)
    plot.set_ylabel("Lipschitz constant (1/s)", fontsize=8)
    deck = facts("cases")["deck"]
    plot.plot([deck["step_size"]], [deck["lipschitz"]], "x", color="black", markersize=6)
