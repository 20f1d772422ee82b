"""The picture of a sweep: a reduction over one or two dimensions, in panels.

The panels differ in the values along the remaining dimensions.
"""

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.errors import unknown
from pyharness.model.report import Column, Picture, Table
from pyharness.model.trajectory import Array
from pyharness.sweep.axes import Axis
from pyharness.sweep.fields import units_of
from pyharness.sweep.reductions import REDUCTIONS
from pyharness.sweep.store import Store
from pyharness.sweep.sweep import ReductionSpec, Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_PANELS = 6
_MOST_PLACES = 200  # values along an axis of a map; more would not be visible
_MOST_DOTS = 5000  # values in a panel with a line or dots
_COLUMNS = 3  # of panels
# A logarithmic scale is used if no value is negative, and the positive values extend over more than
# this number of orders of magnitude.
_ORDERS = 3.0


def chosen_quantity(sweep: Sweep, name: str | None) -> ReductionSpec:
    """Return the reduction `name`, by default the first without codes of outcomes, else the first.

    Raise InputError for an unknown name.
    """
    names = [asked.name for asked in sweep.reductions]
    if name is not None and name not in names:
        raise unknown("reduction", name, names, "--quantity")
    numbers = [each for each in sweep.reductions if not REDUCTIONS[each.reduction].flags]
    return sweep.reductions[names.index(name)] if name else (numbers or sweep.reductions)[0]


def sweep_picture(store: Store, asked: ReductionSpec) -> Picture:
    """Return the picture of a reduction.

    It is a map over the last two dimensions with several values that are numbers and not random;
    with fewer such dimensions it is a line or dots.
    """
    from matplotlib.figure import Figure

    sweep = store.sweep
    axis_of = {axis.dimension: axis for axis in reversed(sweep.axes)}
    long = [d for d, axis in axis_of.items() if axis.count > 1 and not axis.is_choice]
    ordered = [d for d in sweep.dimensions if d in long]
    # Random values have no order, and are shown as dots.
    shown = [d for d in ordered if not _is_drawn(axis_of[d])][-2:] or ordered[-1:]
    panels = _panels(store, asked, axis_of, shown)
    rows = -(-len(panels) // _COLUMNS)
    figure = Figure(
        figsize=(4.0 * min(len(panels), _COLUMNS) + 1.0, 3.4 * rows + 0.8), layout="constrained"
    )
    values = [panel for _, _, panel in panels]
    logarithmic = _spans_orders(values)
    numbers: list[tuple[Any, ...]] = []
    last = None
    plots = figure.subplots(rows, min(len(panels), _COLUMNS), squeeze=False).ravel()
    for plot, (told, places, panel) in zip(plots, panels, strict=False):
        plot.set_title(told, fontsize=9)
        if len(shown) == 2:
            last = _map(plot, axis_of, shown, places, panel, _limits(values), logarithmic)
        else:
            _dots(plot, axis_of, shown, places, panel, logarithmic)
        for at in itertools.product(*(range(len(each)) for each in places)):
            here = [_as_number(axis_of[d].coordinates()[p[i]]) for d, p, i in
                    zip(shown, places, at, strict=True)]  # fmt: skip
            numbers.append((told, *here, _as_number(panel[at])))
    for plot in plots[len(panels) :]:
        plot.set_axis_off()
    reduction = REDUCTIONS[asked.reduction]
    label = _label(asked.name, reduction.units)
    if last is not None:
        figure.colorbar(last, ax=list(plots), label=label)
    else:
        for plot in plots[: len(panels)]:
            plot.set_ylabel(label, fontsize=8)
    heads = [Column(axis_of[d].field, unit=units_of(axis_of[d].field)) for d in shown]
    columns = [Column("panel", left=True), *heads, Column(asked.name, unit=reduction.units)]
    return Picture(figure, Table(columns, numbers), [sweep.name, reduction.title])


Panel = tuple[str, list[Array], Array]


def _panels(
    store: Store, asked: ReductionSpec, axis_of: dict[str, Axis], shown: list[str]
) -> list[Panel]:
    """Return title (values along other dimensions, component), indices and values of each panel."""
    reduction = REDUCTIONS[asked.reduction]
    most = _MOST_PLACES if len(shown) == 2 else _MOST_DOTS
    places = [_thinned(axis_of[d].count, most) for d in shown]
    others = [d for d in store.sweep.dimensions if d not in shown]
    choices: list[list[int]] = []
    room = _MOST_PANELS
    for dimension in others:
        few = _thinned(axis_of[dimension].count, max(1, room)).tolist()
        room //= len(few)
        choices.append(few)
    labels: list[tuple[int | None, str]] = [*enumerate(reduction.labels)] or [(None, "")]
    labels = labels[: max(1, room)]
    found = []
    for still in itertools.product(*choices):
        at = dict(zip(others, still, strict=True))
        for number, label in labels:
            index: list[Any] = [at.get(d, slice(None)) for d in store.sweep.dimensions]
            index += [] if number is None else [number]
            values = np.asarray(store.array(asked.name)[tuple(index)], dtype=np.float64)
            for position, each in enumerate(places):
                values = np.take(values, each, axis=position)
            order = [d for d in store.sweep.dimensions if d in shown]
            assert order == shown
            told = [_label_of(axis_of[d], i) for d, i in at.items()] + ([label] if label else [])
            found.append((", ".join(told), places, values))
    return found


def _map(
    plot: "Axes", axis_of: dict[str, Axis], shown: list[str], places: list[Array], values: Array,
    limits: tuple[float, float], logarithmic: bool,
) -> Any:  # fmt: skip
    from matplotlib.colors import LogNorm, Normalize

    down, across = (axis_of[d] for d in shown)
    x, y = across.coordinates()[places[1]], down.coordinates()[places[0]]
    norm = LogNorm(*limits) if logarithmic else Normalize(*limits)
    seen = np.ma.masked_invalid(np.where(values > 0.0, values, np.nan) if logarithmic else values)
    drawn = plot.pcolormesh(x, y, seen, norm=norm, shading="nearest", rasterized=True)
    for axis, set_label, set_scale in (
        (across, plot.set_xlabel, plot.set_xscale),
        (down, plot.set_ylabel, plot.set_yscale),
    ):
        set_label(_label(axis.field, units_of(axis.field)), fontsize=8)
        set_scale("log" if axis.how == "log" else "linear")
    return drawn


def _dots(
    plot: "Axes", axis_of: dict[str, Axis], shown: list[str], places: list[Array], values: Array,
    logarithmic: bool,
) -> None:  # fmt: skip
    if not shown:
        plot.plot([0.0], [float(values)], "o", color="#1040a0")
        return
    axis = axis_of[shown[0]]
    style = "." if _is_drawn(axis) or axis.how == "listed" else "-"
    plot.plot(axis.coordinates()[places[0]], values, style, color="#1040a0", markersize=3.0)
    plot.set_xlabel(_label(axis.field, units_of(axis.field)), fontsize=8)
    plot.set_xscale("log" if axis.how.startswith("log") else "linear")
    plot.set_yscale("log" if logarithmic else "linear")
    plot.grid(visible=True, linewidth=0.3)


def _is_drawn(axis: Axis) -> bool:
    return axis.how not in ("listed", "linear", "log")


def _thinned(count: int, most: int) -> Any:
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _spans_orders(values: list[Array]) -> bool:
    every = np.concatenate([each.ravel() for each in values])
    every = every[np.isfinite(every)]
    above = every[every > 0.0]
    if not len(above) or (every < 0.0).any():
        return False
    return bool(np.log10(above.max() / above.min()) > _ORDERS)


def _limits(values: list[Array]) -> tuple[float, float]:
    every = np.concatenate([each.ravel() for each in values])
    every = every[np.isfinite(every)]
    if _spans_orders(values):
        every = every[every > 0.0]
    if not len(every):
        return 0.0, 1.0
    least, largest = float(every.min()), float(every.max())
    return least, largest if largest > least else least + 1.0


def _label_of(axis: Axis, index: int) -> str:
    value = axis.coordinates()[index]
    return f"{value}" if axis.is_choice else f"{axis.field} {value:.4g}"


def _label(name: str, units: str) -> str:
    return f"{name} ({units})" if units not in ("", "1") else name


def _as_number(value: Any) -> Any:
    return value if isinstance(value, str) else float(value)
