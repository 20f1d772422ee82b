"""The picture of one trial: for each method what was found, and its limit, by circumstance."""

import re
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pyharness.compare.checks import Check
from pyharness.model.report import Picture, numbers
from pyharness.stress.run import Trial

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

_FLOOR = 1e-18  # what is less, or exactly 0, lies here
_TOP = 3.0
_COLORS = {"fine": "#1040a0", "coarse": "#c02020", "steps": "#107040", "original": "#806000"}
_MARKERS = {"error": "o", "drift": "v"}
_COLUMNS = 2
_PLACES_PER_LETTER = 0.6
_COARSE = 1e-6


def stress_picture(trial: Trial, checks: Sequence[Check]) -> Picture:
    """Draw a panel for each method.

    Circumstances whose names begin alike stand together, in the order in which they were tried.
    """
    from matplotlib.figure import Figure

    drawn = [check for check in checks if len(check.id.split("/")) > 2 and check.value is not None]
    places = _places([check.id.split("/")[2] for check in drawn])
    methods = list(dict.fromkeys(check.id.split("/")[1] for check in drawn))
    columns = min(_COLUMNS, len(methods))
    rows = -(-len(methods) // columns)
    width = max(5.0, 2.0 + 0.11 * max(places.values(), default=0.0))
    figure = Figure(figsize=(width * columns, 2.6 * rows + 1.6), dpi=110, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, name in zip(grid.flat, methods, strict=False):
        _panel(axes, name, [check for check in drawn if check.id.split("/")[1] == name], places)
    for axes in grid.flat[len(methods) :]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xticks(list(places.values()), [_label(name) for name in places], rotation=90)
        axes.tick_params(axis="x", labelsize=6)
    grid[0, 0].set_ylim(_FLOOR / 2.0, _TOP * 2.0)
    handles = _key(drawn)
    inches = width * columns
    told = (
        f"{trial.name}: {trial.title}",
        "Drift: of energy and momentum. Lines: limits. Open: described, no limit. "
        f"Coarse: tolerances of {_COARSE:g} and more, fine: below.",
    )
    lines = [line for each in told for line in textwrap.wrap(each, int(13.0 * inches))]
    # The title is the key's: they would not make room for each other.
    figure.legend(
        handles=handles, loc="outside upper center", ncols=min(len(handles), int(inches)),
        frameon=False, fontsize=8, title="\n".join(lines), title_fontsize=9,
    )  # fmt: skip
    found = [[check.id, repr(check.value), repr(check.limit), check.note] for check in drawn]
    return Picture(figure, numbers("id value limit note", found))


def _places(names: Sequence[str]) -> dict[str, float]:
    """Return where each circumstance stands: kinds side by side, with room for their names."""
    kinds: dict[str, list[str]] = {}
    for name in dict.fromkeys(names):
        kinds.setdefault(_kind(name), []).append(name)
    places: dict[str, float] = {}
    place = 0.0
    for kind, members in kinds.items():
        spare = max(0.0, _PLACES_PER_LETTER * len(kind) - len(members))
        place += 0.5 * spare
        for name in members:
            places[name] = place
            place += 1.0
        place += 1.0 + 0.5 * spare
    return places


def _kind(name: str) -> str:
    return re.split(r"[-^]?\d", name, maxsplit=1)[0].rstrip("-")


def _label(name: str) -> str:
    """Return what tells a circumstance from others of its kind."""
    return name[len(_kind(name)) :].lstrip("-") or name


def _panel(axes: "Axes", name: str, checks: Sequence[Check], places: dict[str, float]) -> None:
    series: dict[tuple[str, str], list[Check]] = {}
    for check in checks:
        series.setdefault(_series(check), []).append(check)
    for (rank, what), members in series.items():
        color = _COLORS.get(rank, "black")
        for judged in (True, False):
            own = [check for check in members if (check.limit is not None) == judged]
            axes.plot(
                [places[check.id.split("/")[2]] for check in own],
                [_inside(check.value) for check in own],
                _marker(rank, what), markersize=3.0, color=color, linestyle="none",
                markerfacecolor=color if judged else "none", markeredgewidth=0.6,
            )  # fmt: skip
        for kind in dict.fromkeys(_kind(check.id.split("/")[2]) for check in members):
            limited = [
                check
                for check in members
                if check.limit is not None and _kind(check.id.split("/")[2]) == kind
            ]
            axes.plot(
                [places[check.id.split("/")[2]] for check in limited],
                [_inside(check.limit) for check in limited],
                color=color, linewidth=0.8, linestyle=(0, (1, 1.2)) if what == "drift" else "-",
            )  # fmt: skip
    axes.set_yscale("log")
    # Above the names of the kinds.
    axes.set_title(name, fontsize=9, loc="left", fontweight="bold", pad=14)
    axes.grid(visible=True, axis="y", linewidth=0.3)
    axes.tick_params(labelsize=7)
    for kind in dict.fromkeys(map(_kind, places)):
        own_places = [place for each, place in places.items() if _kind(each) == kind]
        middle = 0.5 * (min(own_places) + max(own_places))
        axes.text(middle, 1.01, kind, fontsize=7, ha="center", transform=axes.get_xaxis_transform())


def _key(checks: Sequence[Check]) -> "list[Line2D]":
    """Return a handle for every series of any panel."""
    from matplotlib.lines import Line2D

    return [
        Line2D(
            [], [], marker=_marker(rank, what), color=_COLORS.get(rank, "black"),
            linestyle="none", markersize=4.0, label=f"{rank} {what}".strip() or "no setting",
        )
        for rank, what in dict.fromkeys(map(_series, checks))
    ]  # fmt: skip


def _marker(rank: str, what: str) -> str:
    return _MARKERS[what] if what else "s" if rank else "D"


def _series(check: Check) -> tuple[str, str]:
    """Return what sets a mark apart: the kind of setting, and error or drift where it is either."""
    what = check.id.split("/")[-1]
    return _rank(_setting(check)), what if what in _MARKERS else ""


def _setting(check: Check) -> str:
    parts = check.id.split("/")
    return parts[3] if len(parts) > 3 else ""


def _rank(setting: str) -> str:
    """Return what a setting is called in the key: tolerances that vary are one series."""
    try:
        tolerance = float(setting)
    except ValueError:
        return setting
    return "coarse" if tolerance >= _COARSE else "fine"


def _inside(value: float | None) -> float:
    if value is None or value != value:
        return _TOP
    return min(_TOP, max(_FLOOR, abs(value)))
