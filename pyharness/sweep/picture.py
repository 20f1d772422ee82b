"""The picture of a sweep: a reduction over one or two dimensions, in panels.

The panels differ in the values along the remaining dimensions.
"""

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyharness.model.errors import unknown
from pyharness.model.report import Column, Picture, Table
from pyharness.model.trajectory import Array
from pyharness.sweep.axes import Axis, units_of
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


class _Scale(NamedTuple):
    """The ends of a scale for all panels."""

    least: float
    largest: float
    is_logarithmic: bool


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

    axis_of = {axis.dimension: axis for axis in reversed(store.sweep.axes)}
    dimensions = store.sweep.dimensions
    ordered = [d for d in dimensions if axis_of[d].count > 1 and not axis_of[d].is_choice]
    # Random values have no order, and are shown as dots.
    shown = [d for d in ordered if not _is_drawn(axis_of[d])][-2:] or ordered[-1:]
    most = _MOST_PLACES if len(shown) == 2 else _MOST_DOTS
    places = {d: _thinned(axis_of[d].count, most) for d in shown}
    axes = [axis_of[d] for d in shown]
    values = [axis.coordinates()[each] for axis, each in zip(axes, places.values(), strict=True)]
    panels = _panels(store, asked, axis_of, places)
    rows = -(-len(panels) // _COLUMNS)
    figure = Figure(
        figsize=(4.0 * min(len(panels), _COLUMNS) + 1.0, 3.4 * rows + 0.8), layout="constrained"
    )
    scale = _scale([panel for _, panel in panels])
    numbers: list[tuple[Any, ...]] = []
    last = None
    plots = figure.subplots(rows, min(len(panels), _COLUMNS), squeeze=False).ravel()
    for plot, (told, panel) in zip(plots, panels, strict=False):
        plot.set_title(told, fontsize=9)
        if len(shown) == 2:
            last = _map(plot, axes, values, panel, scale)
        else:
            _dots(plot, axes, values, panel, scale.is_logarithmic)
        pairs = zip(itertools.product(*values), panel.ravel().tolist(), strict=True)
        numbers += [(told, *map(float, here), value) for here, value in pairs]
    for plot in plots[len(panels) :]:
        plot.set_axis_off()
    reduction = REDUCTIONS[asked.reduction]
    label = _label(asked.name, reduction.units)
    if last is not None:
        figure.colorbar(last, ax=list(plots), label=label)
    else:
        for plot in plots[: len(panels)]:
            plot.set_ylabel(label, fontsize=8)
    heads = [Column(axis.field, unit=units_of(axis.field)) for axis in axes]
    columns = [Column("panel", left=True), *heads, Column(asked.name, unit=reduction.units)]
    return Picture(figure, Table(columns, numbers), [store.sweep.name, reduction.title])


def _panels(
    store: Store, asked: ReductionSpec, axis_of: dict[str, Axis], places: dict[str, Array]
) -> list[tuple[str, Array]]:
    """Return title (values along other dimensions, component) and values of each panel."""
    choices: dict[str, list[int]] = {}
    room = _MOST_PANELS
    for dimension in (d for d in store.sweep.dimensions if d not in places):
        choices[dimension] = _thinned(axis_of[dimension].count, max(1, room)).tolist()
        room //= len(choices[dimension])
    components = REDUCTIONS[asked.reduction].labels
    labels: list[tuple[int | None, str]] = [*enumerate(components)] or [(None, "")]
    found = []
    for still in itertools.product(*choices.values()):
        at = dict(zip(choices, still, strict=True))
        for number, label in labels[: max(1, room)]:
            index: list[Any] = [at.get(d, slice(None)) for d in store.sweep.dimensions]
            index += [] if number is None else [number]
            values = np.asarray(store.array(asked.name)[tuple(index)], dtype=np.float64)
            told = [_label_of(axis_of[d], i) for d, i in at.items()] + ([label] if label else [])
            found.append((", ".join(told), values[np.ix_(*places.values())]))
    return found


def _map(
    plot: "Axes", axes: Sequence[Axis], values: Sequence[Any], panel: Array, scale: _Scale
) -> Any:
    from matplotlib.colors import LogNorm, Normalize

    logarithmic = scale.is_logarithmic
    norm = (LogNorm if logarithmic else Normalize)(scale.least, scale.largest)
    seen = np.ma.masked_invalid(np.where(panel > 0.0, panel, np.nan) if logarithmic else panel)
    y, x = values
    drawn = plot.pcolormesh(x, y, seen, norm=norm, shading="nearest", rasterized=True)
    down, across = axes
    for axis, set_label, set_scale in (
        (across, plot.set_xlabel, plot.set_xscale),
        (down, plot.set_ylabel, plot.set_yscale),
    ):
        set_label(_label(axis.field, units_of(axis.field)), fontsize=8)
        set_scale("log" if axis.how == "log" else "linear")
    return drawn


def _dots(
    plot: "Axes", axes: Sequence[Axis], values: Sequence[Any], panel: Array, logarithmic: bool
) -> None:
    if not axes:
        plot.plot([0.0], [float(panel)], "o", color="#1040a0")
        return
    (axis,) = axes
    style = "." if _is_drawn(axis) or axis.how == "listed" else "-"
    plot.plot(values[0], panel, style, color="#1040a0", markersize=3.0)
    plot.set_xlabel(_label(axis.field, units_of(axis.field)), fontsize=8)
    plot.set_xscale("log" if axis.how.startswith("log") else "linear")
    plot.set_yscale("log" if logarithmic else "linear")
    plot.grid(visible=True, linewidth=0.3)


def _is_drawn(axis: Axis) -> bool:
    return axis.how not in ("listed", "linear", "log")


def _thinned(count: int, most: int) -> Any:
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _scale(values: Sequence[Array]) -> _Scale:
    every = np.concatenate([each.ravel() for each in values])
    every = every[np.isfinite(every)]
    above = every[every > 0.0]
    is_logarithmic = bool(
        len(above) and (every >= 0.0).all() and np.log10(above.max() / above.min()) > _ORDERS
    )
    every = above if is_logarithmic else every
    least, largest = (float(every.min()), float(every.max())) if len(every) else (0.0, 1.0)
    return _Scale(least, largest if largest > least else least + 1.0, is_logarithmic)


def _label_of(axis: Axis, index: int) -> str:
    value = axis.coordinates()[index]
    return f"{value}" if axis.is_choice else f"{axis.field} {value:.4g}"


def _label(name: str, units: str) -> str:
    return f"{name} ({units})" if units not in ("", "1") else name
