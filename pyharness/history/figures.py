"""Figures 6 to 12 of the thesis, redrawn for the original and for the corrected programs."""

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.history.ablation import case_truth
from pyharness.history.limits import limit_solution
from pyharness.model.assumptions import assumption_records, case_mark, legend, mark
from pyharness.model.facts import facts
from pyharness.model.listing import Listing
from pyharness.model.records import build_record
from pyharness.model.report import Picture, Report, Table, numbers, words
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.thesis.programs import run_program
from pyharness.truth.reference import Reference

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SETS = {"original": Listing.original, "corrected": Listing.corrected}
ENDINGS = ("svg", "png", "csv")
# Number of terms after x(0) in the trial functions.
TERMS = {"two-term": 2, "four-term": 4}
_POINTS_STEPS = 10
_NUMBERS = "curve listing time recorded_time omega1 omega2 omega3"
# The styles differ even without colour.
_REFERENCE: dict[str, Any] = {"color": "#bdbdbd", "linestyle": "-", "linewidth": 5.0}
_LIMIT: dict[str, Any] = {"color": "#107040", "linestyle": (0, (3, 1.5)), "linewidth": 1.0}
_STYLES = {
    "two-term": ("#1040a0", (0, (6, 2)), 1.3, "o", (2, 15)),
    "four-term": ("#000000", (0, (1, 1.3)), 1.9, "s", (7, 15)),
    "runge-kutta": ("#b02018", "-", 0.9, "^", (12, 15)),
}
_STYLE = ("color", "linestyle", "linewidth", "marker", "markevery")
_MARKERS: dict[str, Any] = {"markersize": 5.5, "markerfacecolor": "white", "markeredgewidth": 1.1}
_CORRECTED: dict[str, Any] = {"color": "#b06000", "marker": "v", "markevery": (4, 15)}
_END: dict[str, Any] = {
    "color": "black", "marker": "X", "markersize": 9, "markeredgecolor": "white",
    "linestyle": "none", "zorder": 5, "clip_on": False,
}  # fmt: skip


@dataclass(frozen=True)
class FigurePlan:
    """The plan of a redrawn figure, with our `caption`.

    `source` is the passage of the thesis that supports the choice of programs.
    """

    number: int
    part: str
    set: str
    case: int
    programs: tuple[str, ...]
    caption: str
    source: str
    limit_of: str  # program whose limit (step size to 0) is drawn, or ""

    @property
    def stem(self) -> str:
        of_set = "-corrected" if self.set == "corrected" else ""
        return f"figure-{self.number:02d}{self.part.lower()}{of_set}"

    @property
    def files(self) -> list[str]:
        return [f"{self.stem}.{ending}" for ending in ENDINGS]

    @property
    def title(self) -> str:
        return f"Figure {self.number}" + (f", part {self.part}" if self.part else "")


@dataclass(frozen=True, eq=False)
class Curve:
    listing: Listing
    trajectory: Trajectory

    @property
    def ending(self) -> str:
        run = self.trajectory
        if run.stop is not None:
            return f"stopped at step {run.stop.step} by {run.stop.variable}"
        return f"overflow after step {run.steps}" if run.ended != "complete" else ""

    @property
    def label(self) -> str:
        return self.listing.program + (f" ({self.ending})" if self.ending else "")


@dataclass(frozen=True, eq=False)
class FigureFinding:
    plan: FigurePlan
    scene: Scene
    reference: Reference
    curves: tuple[Curve, ...]
    limit: tuple[str, Array] | None = None  # label and omega (rad/s) of a program's limit

    @property
    def known(self) -> list[tuple[str, Array]]:
        """The label and omega (rad/s) of the reference and, if drawn, of the limit."""
        return [("reference", self.reference.omega), *([self.limit] if self.limit else [])]


def plans() -> list[FigurePlan]:
    found = []
    for each, entry in product(SETS, facts("figures")["figure"]):
        number, part, programs = entry["number"], entry.get("part", ""), tuple(entry[each])
        limit_of = entry.get("limit_of", "") if each == "original" else ""
        texts = entry["caption" if each == "original" else "corrected_caption"], entry["source"]
        found.append(FigurePlan(number, part, each, entry["case"], programs, *texts, limit_of))
    return found


def findings() -> Iterator[FigureFinding]:
    for plan in plans():
        scene = case_scene(plan.case)
        truth = case_truth(plan.case)
        listings = map(SETS[plan.set], plan.programs)
        curves = tuple(Curve(listing, run_program(scene, listing)) for listing in listings)
        limit = None
        if plan.limit_of:
            omega, *_ = limit_solution(plan.limit_of, scene, scene.times(), truth)
            limit = f"limit of {plan.limit_of}", omega
        yield FigureFinding(plan, scene, truth, curves, limit)


def figures_report(findings: Sequence[FigureFinding]) -> Report:
    rows = []
    for each in findings:
        curves = ", ".join(curve.label for curve in each.curves)
        on_cards = (mark(each.scene, curve.listing) for curve in each.curves)
        case = f"{each.plan.case}{max(case_mark(each.plan.case), *on_cards)}"
        rows.append([f"{each.plan.stem}.{{{','.join(ENDINGS)}}}", case, curves])
    runs = [(each.scene, [curve.listing for curve in each.curves]) for each in findings]

    def record() -> dict[str, Any]:
        told = {"figures": list(map(_record, findings)), "build": build_record()}
        return told | {"assumptions": assumption_records(runs)}

    return Report("figures", [[Table(words("files case curves"), rows)], legend(runs)], record)


def _record(finding: FigureFinding) -> dict[str, Any]:
    plan, curves = finding.plan, []
    for each in finding.curves:
        listing, run = each.listing, each.trajectory
        names = {"program": listing.program, "listing": listing.label}
        curves.append(names | {"steps": run.steps, "ended": run.ended})
    told = {name: getattr(plan, name) for name in ("case", "set", "caption", "source", "files")}
    return {"figure": plan.title, **told, "curves": curves}


def curve_numbers(finding: FigureFinding) -> Table:
    """Return a table of the plotted omega (rad/s) by curve and time (s)."""
    truth, start = finding.reference, np.array(finding.scene.omega)
    rows = [
        [curve, "", t, None, *omega]
        for curve, (_, values) in zip(("reference", "limit"), finding.known, strict=False)
        for t, omega in zip(_from_zero(truth.time), _from_zero(values, start), strict=True)
    ]
    for curve in finding.curves:
        run, name = curve.trajectory, [curve.listing.program, curve.listing.label]
        table = np.column_stack(
            [*map(_from_zero, (run.time, run.recorded_time)), _from_zero(run.omega, start)]
        )
        rows += [[*name, *row] for row in table.tolist()]
    return numbers(_NUMBERS, rows)


def _from_zero(values: Array, start: Array | float = 0.0) -> Array:
    return np.concatenate([np.array(start, ndmin=values.ndim), values])


def figure_picture(finding: FigureFinding) -> Picture:
    """Return a picture of each component of omega over time, with the reference."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 8.6), dpi=110, layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    for row in range(3):
        _draw_panel(axes[row], finding, row, [(curve, {}) for curve in finding.curves])
        axes[row].ticklabel_format(useOffset=False)
    axes[2].set_xlabel("time (s)")
    axes[2].set_xlim(0.0, finding.scene.steps * finding.scene.step_size)
    figure.align_ylabels()
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=2, handlelength=5.0, frameon=False
    )
    plan, scene = finding.plan, finding.scene
    title = f"{plan.title}. Case {scene.case}: {scene.name}; {plan.set} programs"
    ends = any(curve.ending for curve in finding.curves)
    note = f"Reference: {finding.reference.source}." + " Cross: the program ends." * ends
    lines = [title, *textwrap.wrap(plan.caption, 98), note]
    figure.suptitle("\n".join(lines), fontsize=10)
    return Picture(figure, curve_numbers(finding))


def together_picture(first: FigureFinding, second: FigureFinding) -> Picture:
    """Return a picture of omega1 from an original and a corrected figure."""
    from matplotlib.figure import Figure

    # One of the corrected programs' curves is enough, because all coincide.
    second = replace(second, curves=second.curves[-1:])
    figure = Figure(figsize=(7.2, 4.2), dpi=110, layout="constrained")
    axes = figure.subplots()
    curves = [
        (curve, other | {"label": f"{curve.label}, {finding.plan.set}"})
        for finding, other in ((first, {}), (second, _CORRECTED))
        for curve in finding.curves
    ]
    _draw_panel(axes, first, 0, curves)
    axes.set(xlim=(0.0, first.reference.time[-1]), xlabel="time (s)")
    figure.legend(loc="outside lower center", ncols=2, handlelength=5.0, frameon=False)
    own = [row for row in curve_numbers(second).rows if row[1]]
    return Picture(figure, numbers(_NUMBERS, [*curve_numbers(first).rows, *own]))


def points_picture() -> Picture:
    """Return a picture of the original programs' collocation points in the first steps."""
    from matplotlib.figure import Figure

    scene = case_scene(2)  # the points are the same in all cases
    # Each row is a step; the grey band has the length of a step.
    figure = Figure(figsize=(7.2, 3.2), dpi=110, layout="constrained")
    both = figure.subplots(1, len(TERMS), sharex=True, sharey=True)
    rows: list[list[Any]] = []
    for axes, (program, terms) in zip(both, TERMS.items(), strict=True):
        run = run_program(scene, Listing.original(program))
        # TIME increases by DT in each step.
        dt = np.diff(_from_zero(run.recorded_time[:_POINTS_STEPS]))
        color, _, _, marker, _ = _STYLES[program]
        axes.axvspan(0.0, scene.step_size, color="#d8d8d8", linewidth=0.0)
        for step, length in enumerate(dt.tolist(), 1):
            points = [n * length / (terms + 1) for n in range(1, terms + 1)]
            axes.plot(points, [step] * terms, color=color, marker=marker, linewidth=0.5, **_MARKERS)
            rows += [[program, step, n, point] for n, point in enumerate(points, 1)]
        axes.set_title(program, fontsize=10)
        axes.set_xlabel("time after the beginning of the step (s)")
        axes.set_yticks(range(1, _POINTS_STEPS + 1))
    both[0].set_xlim(0.0, 1.03 * max(point for *_, point in rows))
    both[0].set_ylabel("step")
    both[0].invert_yaxis()
    return Picture(figure, numbers("program step point time", rows))


def _draw_panel(
    axes: "Axes", finding: FigureFinding, row: int, curves: Iterable[tuple[Curve, dict[str, Any]]]
) -> None:
    time, start = _from_zero(finding.reference.time), np.array(finding.scene.omega)
    for (label, omega), style in zip(finding.known, (_REFERENCE, _LIMIT), strict=False):
        axes.plot(time, _from_zero(omega, start)[:, row], label=label, **style)
    bottom, top = _frame(finding, row)
    height = top - bottom
    for curve, other in curves:
        run = curve.trajectory
        style = dict(zip(_STYLE, _STYLES[curve.listing.program], strict=True))
        omega = _from_zero(run.omega, start)[:, row]
        # Clipped, because renderers fail on very large coordinates.
        shown = np.clip(omega, bottom - 50.0 * height, top + 50.0 * height)
        style |= {"label": curve.label, "zorder": 3} | _MARKERS | other
        axes.plot(_from_zero(run.time), shown, **style)
        if curve.ending and len(run.time):
            axes.plot(run.time[-1:], np.clip(shown[-1:], bottom, top), **_END)
    axes.set_ylim(bottom, top)
    axes.set_ylabel(f"$\\omega_{row + 1}$ (rad/s)")
    axes.grid(visible=True, linewidth=0.3)


def _frame(finding: FigureFinding, row: int) -> tuple[float, float]:
    # Curves more than max |omega| outside the reference's range are cut off.
    truth = finding.reference.omega
    least, largest = float(truth[:, row].min()), float(truth[:, row].max())
    far = float(np.abs(truth).max())
    near = max(0.6 * (largest - least), 0.01 * far)
    low, high = least, largest
    omegas = [each.trajectory.omega for each in finding.curves]
    omegas += [omega for _, omega in finding.known[1:]]
    for omega in (each[:, row] for each in omegas):
        bottom, top = float(omega.min(initial=least)), float(omega.max(initial=largest))
        low = min(low, bottom if bottom > least - far else least - near)
        high = max(high, top if top < largest + far else largest + near)
    margin = max(0.06 * (high - low), 0.001 * far, 1e-12)
    return low - margin, high + margin
