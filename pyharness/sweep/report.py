"""The report of the verb `sweep`, and its picture."""

import itertools
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyharness.model.errors import unknown
from pyharness.model.report import Column, Picture, Report, Table, digits, format_duration, words
from pyharness.model.trajectory import Array
from pyharness.sweep.axes import Axis, units_of
from pyharness.sweep.batches import leaves_of_sweep
from pyharness.sweep.reductions import REDUCTIONS
from pyharness.sweep.run import Outcome
from pyharness.sweep.store import Store
from pyharness.sweep.sweep import ReductionSpec, Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NUMBER = digits(".6g")
_AXES = (
    *words("axis dimension how"), Column("values"), Column("least", _NUMBER),
    Column("largest", _NUMBER), Column("unit", left=True),
)  # fmt: skip
_FOUND = (
    *words("reduction of"), Column("scenes"), Column("none"), Column("least", _NUMBER),
    Column("mean", _NUMBER), Column("largest", _NUMBER), Column("unit", left=True),
)  # fmt: skip
_AXIS_KEYS = ("field", "dimension", "how", "count", "least", "largest", "units")
_FLAGS = (*words("reduction value"), Column("scenes"))


class Found(NamedTuple):
    """Statistics of one component of a stored quantity, in `units`.

    `scenes` counts scenes with a value, `none` the others.
    """

    name: str
    label: str
    scenes: int
    none: int
    least: float | None
    mean: float | None
    largest: float | None
    units: str


def summary(store: Store, asked: ReductionSpec) -> tuple[list[Found], Counter[int]]:
    """Return statistics of a stored quantity's components, and counts of its outcome codes.

    One of the two results is empty.
    """
    reduction = REDUCTIONS[asked.reduction]
    labels = reduction.labels or ("",)
    count, none, total = (np.zeros(len(labels)) for _ in range(3))
    least, largest = np.full(len(labels), np.inf), np.full(len(labels), -np.inf)
    flags: Counter[int] = Counter()
    for chunk in range(store.sweep.n_chunks):
        values = store.read(asked.name, chunk).reshape(-1, len(labels))
        if reduction.flags:
            codes, counts = np.unique(values, return_counts=True)
            flags.update(dict(zip(codes.tolist(), counts.tolist(), strict=True)))
            continue
        finite = np.isfinite(values) & (values != reduction.fill)
        count += finite.sum(axis=0)
        none += (~finite).sum(axis=0)
        total += np.where(finite, values, 0.0).sum(axis=0)
        least = np.minimum(least, np.where(finite, values, np.inf).min(axis=0))
        largest = np.maximum(largest, np.where(finite, values, -np.inf).max(axis=0))
    if reduction.flags:
        return [], flags
    units = "" if reduction.units == "1" else reduction.units
    mean = total / np.maximum(count, 1)
    numbers = zip(least.tolist(), mean.tolist(), largest.tolist(), strict=True)
    return [
        Found._make([asked.name, label, int(n), int(gaps), *(three if n else [None] * 3), units])
        for label, n, gaps, three in zip(labels, count, none, numbers, strict=True)
    ], flags


def sweep_report(store: Store, outcome: Outcome, path: str) -> Report:
    sweep = store.sweep
    found: list[Found] = []
    flags: list[tuple[str, str, int]] = []
    for asked in sweep.reductions:
        numbers, counted = summary(store, asked)
        found += numbers
        named = REDUCTIONS[asked.reduction].flags
        flags += [(asked.name, named.get(code, str(code)), n) for code, n in counted.items()]
    text: list[list[Any]] = [[f"{sweep.name}: {_did(outcome)}; store {path}"]]
    if outcome.estimate is not None:
        text[0].append(f"estimated: {outcome.estimate.text}")
    leaves = leaves_of_sweep(sweep) if sweep.solver.compiled and outcome.computed else None
    if leaves is not None:
        text[0].append(f"Taylor terms of the torque: {leaves}")
    axes = [_axis_row(axis) for axis in sweep.axes]
    text.append([Table(_AXES, axes)])
    if found:
        text.append([Table(_FOUND, found)])
    if flags:
        text.append([Table(_FLAGS, flags)])
    counts = [{"reduction": name, "value": value, "scenes": n} for name, value, n in flags]
    record: dict[str, Any] = {"name": sweep.name, "store": path, "sweep_sha256": sweep.fingerprint}
    record |= {"scenes": sweep.n_scenes, "chunks": sweep.n_chunks}
    record |= {name: getattr(outcome, name) for name in ("computed", "repaired", "seconds")}
    record["leaves"] = leaves
    record["axes"] = [dict(zip(_AXIS_KEYS, row, strict=True)) for row in axes]
    record |= {"reductions": [each._asdict() for each in found], "counts": counts}
    return Report("sweep", text, lambda: record, Table(_FOUND, found), text)


def _did(outcome: Outcome) -> str:
    total = outcome.before + outcome.computed
    if not outcome.computed:
        return f"all {total} chunks were there"
    there = f", {outcome.before} were there" if outcome.before else ""
    repaired = f", {outcome.repaired} of them damaged before" if outcome.repaired else ""
    return f"{outcome.computed} chunks in {format_duration(outcome.seconds)}{repaired}{there}"


def _axis_row(axis: Axis) -> tuple[Any, ...]:
    least = largest = None
    if not axis.is_choice:
        values = axis.coordinates()
        least, largest = float(values.min()), float(values.max())
    units = units_of(axis.field)
    shown = "" if units == "1" else units
    return axis.field, axis.dimension, axis.how, axis.count, least, largest, shown


_MOST_PANELS = 6
_MOST_PLACES = 200  # values along an axis of a map; more would not be visible
_MOST_DOTS = 5000  # values in a panel with a line or dots
_COLUMNS = 3  # number of columns of panels
# A scale without negative values is logarithmic if it spans more than so many orders of magnitude.
_ORDERS = 3.0
# The ends of a scale for all panels, and whether it is logarithmic.
Scale = tuple[float, float, bool]


def chosen_quantity(sweep: Sweep, name: str | None) -> ReductionSpec:
    """Return the stored quantity `name`, by default the first whose values are numbers."""
    names = [asked.name for asked in sweep.reductions]
    if name is not None and name not in names:
        raise unknown("reduction", name, names, "--quantity")
    numbers = [each for each in sweep.reductions if not REDUCTIONS[each.reduction].flags]
    return sweep.reductions[names.index(name)] if name else (numbers or sweep.reductions)[0]


def sweep_picture(store: Store, asked: ReductionSpec) -> Picture:
    """Return a map of a stored quantity over two dimensions, or a line or dots over one."""
    from matplotlib.figure import Figure

    axis_of = {axis.dimension: axis for axis in reversed(store.sweep.axes)}
    dimensions = store.sweep.dimensions
    ordered = [d for d in dimensions if axis_of[d].count > 1 and not axis_of[d].is_choice]
    # The last two dimensions that are not random, or the last one if all are.
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
            _dots(plot, axes, values, panel, scale[-1])
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
            stored = np.asarray(store.array(asked.name)[tuple(index)])
            values = np.where(stored == REDUCTIONS[asked.reduction].fill, np.nan, stored)
            told = [_label_of(axis_of[d], i) for d, i in at.items()] + ([label] if label else [])
            found.append((", ".join(told), values[np.ix_(*places.values())]))
    return found


def _map(
    plot: "Axes", axes: Sequence[Axis], values: Sequence[Any], panel: Array, scale: Scale
) -> Any:
    from matplotlib.colors import LogNorm, Normalize

    least, largest, logarithmic = scale
    norm = (LogNorm if logarithmic else Normalize)(least, largest)
    seen = np.ma.masked_invalid(np.where(panel > 0.0, panel, np.nan) if logarithmic else panel)
    y, x = map(np.asarray, values)
    # A mesh needs ascending coordinates; listed values may have any order.
    rows, columns = np.argsort(y, kind="stable"), np.argsort(x, kind="stable")
    seen = seen[np.ix_(rows, columns)]
    drawn = plot.pcolormesh(
        x[columns], y[rows], seen, norm=norm, shading="nearest", rasterized=True
    )
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


def _scale(values: Sequence[Array]) -> Scale:
    every = np.concatenate([each.ravel() for each in values])
    every = every[np.isfinite(every)]
    above = every[every > 0.0]
    is_logarithmic = bool(
        len(above) and (every >= 0.0).all() and np.log10(above.max() / above.min()) > _ORDERS
    )
    every = above if is_logarithmic else every
    least, largest = (float(every.min()), float(every.max())) if len(every) else (0.0, 1.0)
    return least, largest if largest > least else least + 1.0, is_logarithmic


def _label_of(axis: Axis, index: int) -> str:
    value = axis.coordinates()[index]
    return f"{value}" if axis.is_choice else f"{axis.field} {value:.4g}"


def _label(name: str, units: str) -> str:
    return f"{name} ({units})" if units not in ("", "1") else name
