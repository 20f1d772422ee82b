"""Charts and numbers of the home page's story, from runs of the Python ports."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from pyharness.checks.port_protocol import requested_scene
from pyharness.edition.decks import TITLES
from pyharness.history.ablation import case_truth
from pyharness.history.claims.laboratory import starts
from pyharness.history.claims.stories import power_of_ten
from pyharness.history.figures import TERMS
from pyharness.history.limits import limit_solution
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, switches
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.thesis.programs import run_program

# Letters that hide the programs' names in the first scene of the story.
LETTERS = {"A": "two-term", "B": "runge-kutta", "C": "four-term"}
BLIND_CASES = (1, 2, 5)
RACE_CASES = (2, 3, 4, 5, 6, 7)
# Plot area of a chart, in its units: left, top, right, bottom.
BOX = (40, 10, 350, 196)
# The step shown first, in which the two-term program overflows.
POINTS_STEP = 57
STEP_SIZES = (0.01, 0.005, 0.0025, 0.00125)  # s
_LOG_STEP = 2  # number of powers of ten between labels
Range = tuple[float, float]
Names = tuple[str, ...]


class Curve(NamedTuple):
    """A curve as SVG points; `name` selects colour and dashes."""

    name: str
    points: str


class Chart(NamedTuple):
    """A chart with fixed axes."""

    name: str
    axes: tuple[str, str]
    x: Range
    y: Range  # exponents of ten if logarithmic
    x_ticks: list[tuple[str, str]]  # positions and labels
    y_ticks: list[tuple[str, str]]
    curves: list[Curve]
    is_logarithmic: bool = False
    is_marked: bool = False  # whether curves are points without lines
    marks: Sequence[Curve] = ()  # points that distinguish coincident curves


def data() -> dict[str, Any]:
    cases = sorted({*BLIND_CASES, *RACE_CASES})
    scenes = {number: requested_scene(case_scene(number)) for number in cases}
    original = {name: list(switches(name)) for name in PROGRAMS}
    fractions = {name: _fractions(name) for name in TERMS}
    told = {"scenes": scenes, "original": original, "letters": LETTERS, "fractions": fractions}
    return told | {"lipschitz": facts("cases")["deck"]["lipschitz"]}


@cache
def context() -> dict[str, Any]:
    stopped = _run(2, "runge-kutta")
    assert stopped.velocity is not None
    velocity = [0.0, *stopped.velocity[:, 1].tolist()]
    velocity_chart = _chart("velocity", ("step", "V2, m/s"), (0, 100), (-0.03, 0.03))
    velocity_curve = _curve(velocity_chart, "runge-kutta", range(len(velocity)), velocity)
    endless = _run(2, "runge-kutta", may_stop=False)
    scene = case_scene(2)
    limit, *_ = limit_solution("runge-kutta", scene, scene.times(), case_truth(2))
    half_speed = _chart_of_case("half-speed", 2, {"runge-kutta": endless}, (-1.6, 2.2))
    curve = _curve(half_speed, "limit", scene.times(), limit[:, 0])
    by_letter = {name: _run(2, name) for name in LETTERS.values()}
    claim = _chart_of_case("claim", 2, by_letter, (-1.2, 1.5))
    charts = [
        claim._replace(marks=_marks(claim, by_letter)),
        _chart_of_case("stop", 2, {"runge-kutta": stopped}, (-1.2, 1.5), in_steps=True),
        velocity_chart._replace(curves=[velocity_curve]),
        _chart("quotient", ("step", "quotient, 1/s"), (0, 100), (0, 5), is_log=True),
        half_speed._replace(curves=[*half_speed.curves, curve]),
        *(
            _chart_of_case(f"blind-{n}", n, {"runge-kutta": _run(n, "runge-kutta")}, _span(n))
            for n in BLIND_CASES
        ),
        _points_chart(scene.step_size),
        _chart_of_case("points-run", 6, {"two-term": _run(6, "two-term")}, _span(6)),
        *(_race_chart(listing) for listing in ("original", "corrected")),
    ]
    point_at = POINTS_STEP * scene.step_size  # the value of DT in this step (s)
    ratios = {case: _ratios(case) for case in RACE_CASES}
    others = [ratio for case in RACE_CASES if case != 7 for ratio in ratios[case].values()]
    corrected = {name: _run(2, name, "corrected") for name in PROGRAMS}
    first, original = case_scene(1), Listing.original("runge-kutta")
    others_of_case_1 = [replace(first, omega=x) for x in starts() if x != first.omega]
    told: dict[str, Any] = {"box": BOX, "titles": TITLES, "letters": LETTERS, "data": data()}
    told |= {"step_sizes": STEP_SIZES, "points_step": POINTS_STEP, "stopped": stopped}
    told |= {"peak": velocity[-2], "after": velocity[-1], "case_7": ratios[7]}
    return told | {
        "charts": {each.name: each for each in charts},
        "collocation_error": _first_error(2, "two-term"),
        "stop_error": _first_error(2, "runge-kutta"),
        "corrected_error": _first_error(2, "runge-kutta", "corrected"),
        "from_solution": _distance(endless, case_truth(2).omega),
        "from_limit": _distance(endless, limit),
        "alone": _run(2, "runge-kutta", without=("lipschitz-tests-velocity",)),
        "right": _run(2, "runge-kutta", without=tuple(facts("account")["mechanism"]["alone"])),
        "in_48_bits": run_program(scene, original, "python", word="cdc48"),
        "shown_starts": [run_program(each, original).steps for each in others_of_case_1],
        "points_at": [each * point_at for each in _fractions("two-term")],
        "points_run": (_run(6, "two-term"), _first_error(6, "two-term")),
        "blind": {n: (_run(n, "runge-kutta"), _first_error(n, "runge-kutta")) for n in BLIND_CASES},
        "evaluations": {name: run.evaluations // run.steps for name, run in corrected.items()},
        "ratio": min(ratios[2].values()),
        "ratios": (min(others), max(others)),
    }


@cache
def _run(
    case: int, program: str, listing: str = "original", without: Names = (), may_stop: bool = True
) -> Trajectory:
    """Return a run in Python, corrected or original, the latter without the defects `without`."""
    active = set(switches(program)) - set(without) if listing == "original" else set()
    return run_program(case_scene(case), Listing(program, active), "python", may_stop=may_stop)


def _distance(run: Trajectory, goal: Array) -> float:
    return float(np.abs(run.omega - goal[: run.steps])[:, 0].max())


def _first_error(case: int, program: str, listing: str = "original") -> float:
    return _distance(_run(case, program, listing), case_truth(case).omega)


def _largest_error(case: int, program: str, listing: str) -> float:
    run = _run(case, program, listing)
    return float(np.abs(run.omega - case_truth(case).omega[: run.steps]).max())


def _ratios(case: int) -> dict[str, float]:
    errors = {name: _largest_error(case, name, "corrected") for name in PROGRAMS}
    least = errors.pop("runge-kutta")
    return {name: error / least for name, error in errors.items()}


def _span(case: int) -> Range:
    values = [case_scene(case).omega[0], *case_truth(case).omega[:, 0]]
    low, high = min(values), max(values)
    margin = 0.25 * (high - low)
    return low - margin, high + margin


def _chart_of_case(
    name: str, case: int, runs: Mapping[str, Trajectory], y: Range, in_steps: bool = False
) -> Chart:
    scene = case_scene(case)
    times = [0.0, *scene.times()]
    x = list(range(len(times))) if in_steps else times
    axis = "step" if in_steps else "time, s"
    found = _chart(name, (axis, "ω₁, rad/s"), (0.0, float(x[-1])), y)
    curves = [_curve(found, "solution", x, [scene.omega[0], *case_truth(case).omega[:, 0]])]
    for program, run in runs.items():
        omega = [scene.omega[0], *run.omega[:, 0]]
        curves.append(_curve(found, program, x[: len(omega)], omega))
    return found._replace(curves=curves)


def _marks(chart: Chart, runs: Mapping[str, Trajectory]) -> list[Curve]:
    return [
        _curve(chart, name, run.time[first::15].tolist(), run.omega[first::15, 0].tolist())
        for first, (name, run) in zip((7, 4, 12), runs.items(), strict=True)
    ]


def _race_chart(listing: str) -> Chart:
    axes = ("case", "largest error, rad/s")
    found = _chart(f"race-{listing}", axes, (1.5, 7.5), (-8, 2), is_log=True)
    curves = [
        _curve(found, name, RACE_CASES, [_largest_error(n, name, listing) for n in RACE_CASES])
        for name in PROGRAMS
    ]
    ticks = [(f"{_across(found, n):.1f}", str(n)) for n in RACE_CASES]
    return found._replace(x_ticks=ticks, curves=curves, is_marked=True)


def _fractions(program: str) -> list[float]:
    return [n / (TERMS[program] + 1) for n in range(1, TERMS[program] + 1)]


def _points_chart(step_size: float) -> Chart:
    axes = ("step", "time after the beginning of the step, s")
    found = _chart("points", axes, (0, 100), (-3, 0), is_log=True)
    steps = range(1, 101)
    curves = [
        _curve(found, f"point-{n}", steps, [each * step_size * step for step in steps])
        for n, each in enumerate(_fractions("two-term"), 1)
    ]
    end = _curve(found, "threshold", (0, 100), (step_size, step_size))
    return found._replace(curves=[*curves, end])


def _chart(name: str, axes: tuple[str, str], x: Range, y: Range, is_log: bool = False) -> Chart:
    empty = Chart(name, axes, x, y, [], [], [], is_log)
    x_ticks = [(f"{_across(empty, value):.1f}", label) for value, label in _even(*x)]
    ticks = _powers(*y) if is_log else _even(*y)
    y_ticks = [(f"{_up(empty, value):.1f}", label) for value, label in ticks]
    return empty._replace(x_ticks=x_ticks, y_ticks=y_ticks)


def _even(low: float, high: float) -> list[tuple[float, str]]:
    raw = (high - low) / 5.0
    unit = 10.0 ** math.floor(math.log10(raw))
    step = next(unit * m for m in (1, 2, 5, 10) if unit * m >= raw)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [(n * step, f"{n * step:.6g}") for n in range(first, last + 1)]


def _powers(low: float, high: float) -> list[tuple[float, str]]:
    exponents = range(math.ceil(low / _LOG_STEP) * _LOG_STEP, math.floor(high) + 1, _LOG_STEP)
    return [(10.0**n, power_of_ten(n) if n else "1") for n in exponents]


def _across(chart: Chart, x: float) -> float:
    left, _, right, _ = BOX
    return left + (x - chart.x[0]) / (chart.x[1] - chart.x[0]) * (right - left)


def _up(chart: Chart, y: float) -> float:
    _, top, _, bottom = BOX
    value = math.log10(y) if chart.is_logarithmic else y
    share = (value - chart.y[0]) / (chart.y[1] - chart.y[0])
    # Keep the point near the plot area.
    return bottom - min(max(share, -1.0), 2.0) * (bottom - top)


def _curve(chart: Chart, name: str, x: Iterable[float], y: Iterable[float]) -> Curve:
    """Return a curve as SVG points, as the page's script chart.js does."""
    pairs = zip(x, y, strict=True)
    shown = ((a, b) for a, b in pairs if not chart.is_logarithmic or b > 0.0)
    points = (f"{_across(chart, a):.1f},{_up(chart, b):.1f}" for a, b in shown)
    return Curve(name, " ".join(points))
