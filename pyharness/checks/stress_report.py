"""The report of `stress`: a description, a table and a picture for each trial."""

import re
import textwrap
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyharness.checks.check import Check, severity
from pyharness.checks.report import basis_note, checks_report, listed_singly, marks, verdict
from pyharness.checks.stress import Trial
from pyharness.model.errors import InputError
from pyharness.model.report import Column, Picture, Report, Table, digits, numbers, short, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pyharness.checks.theory.amplification import Regions
    from pyharness.checks.trials.length import Drift

_HEADS = (
    *words("method"), Column("checks"), Column("failed"), Column("bounded"),
    Column("ratio", short, name="share"), Column("value", short), Column("limit", short),
    *words("basis"), Column("worst at", left=True, fit="cut"),
)  # fmt: skip
_NOTE = (
    "bounded: number of checks with a bound; the others only describe. ratio: value over limit of "
    "the worst check, with its value, limit and basis (without a bound: the largest value)."
)
_FLOOR = 1e-18  # smaller values, and 0, are drawn here
_TOP = 3.0
_COLORS = {"fine": "#1040a0", "coarse": "#c02020", "steps": "#107040", "original": "#806000"}
_MARKERS = {"error": "o", "drift": "v"}
_COLUMNS = 2
_PLACES_PER_LETTER = 0.6
_COARSE = 1e-6


def stress_report(trials: Sequence[Trial], checks: Sequence[Check]) -> Report:
    text: list[Any] = [listed_singly(checks), [_NOTE, *basis_note(checks)]]
    for each in trials:
        own = [check for check in checks if check.suite == each.name]
        if own:
            text.append([f"{each.name}: {each.title}", f"  bound: {each.bound}"])
            text.append([_table(own)])
    report = checks_report("stress", checks, [*text, [verdict(checks)]])
    pictures = {each.name: partial(_picture, each, checks) for each in trials}
    return report._replace(pictures=pictures)


def _table(checks: Sequence[Check]) -> Table:
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault(check.name.subject, []).append(check)
    rows = []
    for name, members in groups.items():
        judged = [check for check in members if check.limit is not None]
        failed = sum(not check.passed for check in members)
        worst = max(judged, key=severity) if judged else max(members, key=_size)
        share = severity(worst)[1] if judged else None
        numbers = [len(members), failed, len(judged), share, worst.value, worst.limit]
        rows.append([name, *numbers, marks([worst]), worst.name.place or None])
    return Table(_HEADS, rows)


def _picture(trial: Trial, checks: Sequence[Check]) -> Picture:
    if trial.name == "regions":
        from pyharness.checks.theory.amplification import regions

        return regions_picture(regions())
    if trial.name == "length":
        from pyharness.checks.trials.length import curves

        return length_picture(list(curves()))
    return stress_picture(trial, checks)


def _size(check: Check) -> float:
    value = check.value
    return -1.0 if value is None else value if value == value else float("inf")


class _Mark(NamedTuple):
    method: str
    kind: str  # the circumstance up to its first number
    circumstance: str
    # Marks with equal `rank` (tolerance or listing) and `what` (quantity) are one series.
    rank: str
    what: str
    check: Check

    @property
    def style(self) -> dict[str, Any]:
        marker = _MARKERS.get(self.what, "s" if self.rank else "D")
        return {"marker": marker, "color": _COLORS.get(self.rank, "black"), "linestyle": "none"}


def _mark(check: Check) -> _Mark:
    name = check.name
    kind = re.split(r"[-^]?\d", name.circumstance, maxsplit=1)[0].rstrip("-")
    rank = name.setting or name.quantity
    with suppress(ValueError):
        # One series has all coarse tolerances, another all fine ones.
        rank = "coarse" if float(rank) >= _COARSE else "fine"
    what = name.quantity if name.quantity in _MARKERS else ""
    return _Mark(name.subject, kind, name.circumstance, rank, what, check)


def stress_picture(trial: Trial, checks: Sequence[Check]) -> Picture:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    drawn = [check for check in checks if check.name.circumstance and check.value is not None]
    if not drawn:
        raise InputError(
            "--plot: none of the chosen checks has a number to draw; choose others with --only"
        )
    marks = list(map(_mark, drawn))
    places = _places(marks)
    methods = list(dict.fromkeys(mark.method for mark in marks))
    columns = min(_COLUMNS, len(methods))
    rows = -(-len(methods) // columns)
    width = max(5.0, 2.0 + 0.11 * max(places.values(), default=0.0))
    figure = Figure(figsize=(width * columns, 2.6 * rows + 1.6), dpi=110, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, name in zip(grid.flat, methods, strict=False):
        _panel(axes, name, [mark for mark in marks if mark.method == name], places)
    for axes in grid.flat[len(methods) :]:
        axes.set_visible(False)
    # Without the kind, whose name is above its problems.
    labels = [name[len(kind) :].lstrip("-") or name for kind, name in places]
    for axes in grid[-1]:
        axes.set_xticks(list(places.values()), labels, rotation=90)
        axes.tick_params(axis="x", labelsize=6)
    grid[0, 0].set_ylim(_FLOOR / 2.0, _TOP * 2.0)
    series: dict[str, _Mark] = {}
    for mark in marks:
        series.setdefault(f"{mark.rank} {mark.what}".strip() or "no setting", mark)
    handles = [Line2D([], [], **x.style, markersize=4.0, label=k) for k, x in series.items()]
    inches = width * columns
    told = (
        f"{trial.name}: {trial.title}",
        "Drift: of energy and momentum. Lines: limits. Open: described, no limit. "
        f"Coarse: tolerances of {_COARSE:g} and more, fine: below.",
    )
    lines = [line for each in told for line in textwrap.wrap(each, int(13.0 * inches))]
    # A separate title would overlap the legend.
    figure.legend(
        handles=handles, loc="outside upper center", ncols=min(len(handles), int(inches)),
        frameon=False, fontsize=8, title="\n".join(lines), title_fontsize=9,
    )  # fmt: skip
    found = [[check.id, repr(check.value), repr(check.limit), check.note] for check in drawn]
    return Picture(figure, numbers("id value limit note", found))


def _places(marks: Sequence[_Mark]) -> dict[tuple[str, str], float]:
    names = dict.fromkeys((mark.kind, mark.circumstance) for mark in marks)
    places, place = {}, 0.0
    for kind in dict.fromkeys(kind for kind, _ in names):
        members = [each for each in names if each[0] == kind]
        spare = max(0.0, _PLACES_PER_LETTER * len(kind) - len(members))
        place += 0.5 * spare
        for each in members:
            places[each] = place
            place += 1.0
        place += 1.0 + 0.5 * spare
    return places


def _panel(
    axes: "Axes", name: str, marks: Sequence[_Mark], places: dict[tuple[str, str], float]
) -> None:
    for rank, what in dict.fromkeys((mark.rank, mark.what) for mark in marks):
        members = [mark for mark in marks if (mark.rank, mark.what) == (rank, what)]
        style = members[0].style
        small: dict[str, Any] = {"markersize": 3.0, "markeredgewidth": 0.6}
        line: dict[str, Any] = {"color": style["color"], "linewidth": 0.8}
        line["linestyle"] = (0, (1, 1.2)) if what == "drift" else "-"
        judged = [mark for mark in members if mark.check.limit is not None]
        described = [mark for mark in members if mark.check.limit is None]
        for own, face in ((judged, style["color"]), (described, "none")):
            at = [places[mark.kind, mark.circumstance] for mark in own]
            values = [_inside(mark.check.value) for mark in own]
            axes.plot(at, values, **style, **small, markerfacecolor=face)
        for kind in dict.fromkeys(mark.kind for mark in members):
            own = [mark for mark in judged if mark.kind == kind]
            at = [places[kind, mark.circumstance] for mark in own]
            axes.plot(at, [_inside(mark.check.limit) for mark in own], **line)
    axes.set_yscale("log")
    # Leave space for the names of the kinds.
    axes.set_title(name, fontsize=9, loc="left", fontweight="bold", pad=14)
    axes.grid(visible=True, axis="y", linewidth=0.3)
    axes.tick_params(labelsize=7)
    for kind in dict.fromkeys(kind for kind, _ in places):
        own_places = [place for (each, _), place in places.items() if each == kind]
        middle = 0.5 * (min(own_places) + max(own_places))
        axes.text(middle, 1.01, kind, fontsize=7, ha="center", transform=axes.get_xaxis_transform())


def _inside(value: float | None) -> float:
    if value is None or value != value:
        return _TOP
    return min(_TOP, max(_FLOOR, abs(value)))


_SHOWN = ("energy", "phase")
_OF_METHODS: dict[str, dict[str, Any]] = {
    "taylor": {"linestyle": "-", "marker": "o", "color": "#1040a0"},
    "gauss-8": {"linestyle": (0, (6, 1.5)), "marker": "s", "color": "#3a86c8"},
    "gauss-4": {"linestyle": (0, (1, 1.5)), "marker": "^", "color": "#b02018"},
}


def length_picture(found: Sequence["Drift"]) -> Picture:
    from matplotlib.figure import Figure

    from pyharness.checks.theory.brouwer import LAWS

    motions = list(dict.fromkeys(each.motion for each in found))
    figure = Figure(figsize=(10.0, 8.0), dpi=100, layout="constrained")
    axes = figure.subplots(len(_SHOWN), len(motions), squeeze=False, sharex=True, sharey="row")
    for row, what in enumerate(_SHOWN):
        for column, motion in enumerate(motions):
            one = axes[row, column]
            own = [each for each in found if (each.motion, each.what) == (motion, what)]
            for each in own:
                style, many = _OF_METHODS[each.method], each.starts > 1
                marked = {"label": each.method, "markersize": 4, **style}
                # Open markers, not joined, for errors of a single start.
                alone = style | {"markersize": 5, "linestyle": "", "markerfacecolor": "none"}
                for shown, look in ((many, marked), (~many, alone)):
                    one.loglog(each.steps[shown], each.error[shown], **look)
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
    told = "Errors over many starts of one motion; open: of one start. Thin: the bounds."
    figure.suptitle(told, fontsize=10)
    rows = []
    for each in found:
        names = [each.motion, each.method, each.what]
        columns = zip(each.steps, each.error, each.limits, each.starts, strict=True)
        rows += [[*names, f"{n:.0f}", *row] for n, *row in columns]
    return Picture(figure, numbers("motion method what steps error limit starts", rows))


# The line styles differ even without colour.
_OF_REGIONS: tuple[dict[str, Any], ...] = (
    {"color": "#000000", "linestyle": "solid", "linewidth": 2.2},
    {"color": "#1040a0", "linestyle": (0, (1, 1.2)), "linewidth": 2.2},
    {"color": "#c02020", "linestyle": (0, (6, 2)), "linewidth": 1.8},
    {"color": "#107040", "linestyle": (0, (5, 1.5, 1, 1.5)), "linewidth": 1.1},
    {"color": "#806000", "linestyle": (0, (2, 3)), "linewidth": 1.1},
)
_LEAST = 1e-13


def regions_picture(found: "Regions") -> Picture:
    """Return a picture of the stability regions in the plane of z, step size times eigenvalue."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.8), dpi=100, layout="constrained")
    plane, axis = figure.subplots(1, 2)
    plane.axvspan(found.real[0], 0.0, color="#ededed", zorder=0)
    told = "grey: Gauss collocation, the whole left half-plane"
    plane.text(-4.5, 3.25, told, fontsize=8, color="#505050")
    handles: list[Any] = []
    for each, style in zip(found.regions, _OF_REGIONS, strict=True):
        lines = {f"{name}s": [value] for name, value in style.items()}
        plane.contour(found.real, found.imaginary, each.radius, levels=[1.0], **lines)
        for sign, alpha in ((1.0, 1.0), (-1.0, 0.35)):
            values = np.where(sign * each.growth > _LEAST, sign * each.growth, np.nan)
            drawn = axis.plot(found.distances, values, alpha=alpha, label=each.name, **style)
            handles += drawn if sign > 0.0 else []
    plane.axhline(0.0, color="#808080", linewidth=0.6)
    plane.axvline(0.0, color="#808080", linewidth=0.6)
    plane.set(aspect="equal", xlabel="real part of z = h lambda", ylabel="imaginary part")
    plane.set_title("Where a disturbance does not grow", fontsize=10)
    axis.set(xscale="log", yscale="log", ylim=(_LEAST, 10.0))
    axis.axvline(0.05, color="#808080", linewidth=0.8)
    axis.text(0.053, 2e-13, "Case 2 at .01 s", fontsize=8, color="#505050")
    axis.set_xlabel("z / i: angle of the wobble in a step (rad)")
    axis.set_ylabel("growth of a wobble in a step; faint: decay")
    axis.set_title("Along the imaginary axis: spinning about a stable axis", fontsize=10)
    axis.grid(visible=True, linewidth=0.3)
    look = {"ncols": 3, "handlelength": 5.0, "frameon": False, "fontsize": 9}
    figure.legend(handles=handles, loc="outside lower center", **look)
    columns = [Column("distance", full=digits(".6g"), unit="rad")]
    columns += [Column(each.name, full=digits(".3g")) for each in found.regions]
    rows = np.column_stack([found.distances, *(each.growth for each in found.regions)])
    return Picture(figure, Table(columns, rows))
