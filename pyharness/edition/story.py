"""The data of the story, the home page of the web site: its charts and its numbers.

The page tells in six scenes what the thesis reports and what was found. Its charts and numbers come
from runs of the programs' Python twins. In the browser, the page's script runs the programs again
and replaces them when a visitor changes something.
"""

import math
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from pyharness.checks.port_protocol import requested_scene
from pyharness.history.limits import limit_solution
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, switches
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.original.programs import run_program
from pyharness.truth.reference import Reference, reference

NAMES = {
    "two-term": "two-term collocation",
    "four-term": "four-term collocation",
    "runge-kutta": "Runge-Kutta",
}
# The programs under the letters of the first scene, which does not tell their names at once.
LETTERS = {"A": "two-term", "B": "runge-kutta", "C": "four-term"}
BLIND_CASES = (1, 2, 5)
RACE_CASES = (2, 3, 4, 5, 6, 7)
# The plot area of every chart in the units of its picture: left, top, right, bottom.
BOX = (40, 10, 350, 196)
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_DOUBLED = (0.01, 0.005, 0.0025, 0.00125)  # s
_LOG_STEP = 2  # powers of ten from one label to the next


class Curve(NamedTuple):
    """A curve of a chart. `name` selects its colour and dashes; `points` are in the chart's box."""

    name: str
    points: str


class Chart(NamedTuple):
    """A chart with fixed axes, as numbers for an SVG picture.

    `x` and `y` are the ranges of the axes. On a logarithmic axis `y` has powers of ten: the
    exponents of its ends. `x_ticks` and `y_ticks` are pairs of a position in the picture and a
    label. `axes` names both axes with their units. If `is_marked` is true, each point is drawn as a
    mark, and no line joins the points.
    """

    name: str
    axes: tuple[str, str]
    x: tuple[float, float]
    y: tuple[float, float]
    x_ticks: list[tuple[str, str]]
    y_ticks: list[tuple[str, str]]
    curves: list[Curve]
    is_logarithmic: bool = False
    is_marked: bool = False


def data() -> dict[str, Any]:
    """Return the JSON values with which the story's script runs the programs in the browser."""
    return {
        "scenes": {number: requested_scene(case_scene(number)) for number in _cases()},
        "original": {name: list(switches(name)) for name in PROGRAMS},
        "letters": LETTERS,
        "lipschitz": facts("cases")["deck"]["lipschitz"],
    }


@cache
def context() -> dict[str, Any]:
    """Return the values for the template of the story: the charts by name, and the numbers.

    The numbers are those of the programs as printed and as corrected, each in 100 steps of 0.01 s.
    """
    stopped = _run(2, "runge-kutta")
    limit = _chart_of_case("half-speed", 2, ["runge-kutta"], (-1.6, 2.2), may_stop=False)
    scene = case_scene(2)
    towards = limit_solution("runge-kutta", scene, scene.times(), _truth(2))[:, 0]
    limit = limit._replace(curves=[*limit.curves, _curve(limit, "limit", scene.times(), towards)])
    errors = {case: {name: _largest_error(case, name) for name in PROGRAMS} for case in RACE_CASES}
    charts = [
        _chart_of_case("claim", 2, LETTERS.values(), (-1.2, 1.5)),
        _chart_of_case("stop", 2, ["runge-kutta"], (-1.2, 1.5))._replace(
            axes=("step", "ω₁, rad/s"), x=(0.0, 100.0), x_ticks=_step_ticks()
        ),
        _velocity_chart(stopped),
        _chart("quotient", ("step", "quotient, 1/s"), (0, 100), (0, 5), _powers(0, 5), is_log=True),
        limit,
        *(_chart_of_case(f"blind-{n}", n, ["runge-kutta"], _span(n)) for n in BLIND_CASES),
        *(_race_chart(listing) for listing in ("original", "corrected")),
    ]
    ratios = _ratios(errors)
    return {
        "charts": {each.name: each for each in charts},
        "box": BOX,
        "names": NAMES,
        "letters": LETTERS,
        "step_sizes": _DOUBLED,
        "stopped": stopped,
        "stop_error": _first_error(2, "runge-kutta", "original"),
        "peak": _second_velocity(stopped)[-2],
        "after": _second_velocity(stopped)[-1],
        "limits": _distances(),
        "alone": _run(2, "runge-kutta", without=["lipschitz-tests-velocity"]),
        "right": _run(2, "runge-kutta", without=facts("account")["mechanism"]["alone"]),
        "in_48_bits": run_program(scene, Listing.original("runge-kutta"), "python", word="cdc48"),
        "sine": {
            listing: {name: _first_error(2, name, listing) for name in PROGRAMS}
            for listing in ("original", "corrected")
        },
        "blind": {n: {p: _first_error(n, p, "original") for p in PROGRAMS} for n in BLIND_CASES},
        "blind_runs": {n: {p: _run(n, p) for p in PROGRAMS} for n in BLIND_CASES},
        "evaluations": {name: _run(2, name, "corrected").evaluations // 100 for name in PROGRAMS},
        "ratios": ratios,
        "seven": {p: errors[7][p] / errors[7]["runge-kutta"] for p in PROGRAMS},
        "data": data(),
    }


def _cases() -> list[int]:
    return sorted({*BLIND_CASES, *RACE_CASES})


@cache
def _truth(case: int) -> Reference:
    scene = case_scene(case)
    return reference(scene, scene.times())


def _run(
    case: int,
    program: str,
    listing: str = "original",
    without: Iterable[str] = (),
    may_stop: bool = True,
) -> Trajectory:
    """Run the twin of a program in a case: as printed, less some defects, or as corrected."""
    active = set(switches(program)) - set(without) if listing == "original" else set()
    return run_program(case_scene(case), Listing(program, active), "python", may_stop=may_stop)


def _errors(case: int, program: str, listing: str = "corrected") -> Array:
    run = _run(case, program, listing)
    return np.abs(run.omega - _truth(case).omega[: run.steps])


def _largest_error(case: int, program: str, listing: str = "corrected") -> float:
    """Return the largest error of any component of omega (rad/s) at the steps that were run."""
    return float(_errors(case, program, listing).max())


def _first_error(case: int, program: str, listing: str) -> float:
    """Return the largest error of omega1 (rad/s) at the steps that were run."""
    return float(_errors(case, program, listing)[:, 0].max())


def _ratios(errors: dict[int, dict[str, float]]) -> dict[int, tuple[float, float]]:
    """Return, by case, the smaller and the larger ratio of collocation's error to Runge-Kutta's."""
    found = {}
    for case, of_program in errors.items():
        both = sorted(of_program[name] / of_program["runge-kutta"] for name in NAMES
                      if name != "runge-kutta")  # fmt: skip
        found[case] = (both[0], both[1])
    return found


def _distances() -> dict[str, float]:
    """Return the largest distances of the printed program from the solution and from its limit.

    The distances are those of omega1 (rad/s) in Case 2, without the stop test.
    """
    scene = case_scene(2)
    run = _run(2, "runge-kutta", may_stop=False)
    towards = limit_solution("runge-kutta", scene, scene.times(), _truth(2))
    return {
        name: float(np.abs(run.omega - goal)[:, 0].max())
        for name, goal in (("solution", _truth(2).omega), ("limit", towards))
    }


def _span(case: int) -> tuple[float, float]:
    """Return a range that holds the true omega1 of a case and a margin."""
    values = [case_scene(case).omega[0], *_truth(case).omega[:, 0]]
    low, high = min(values), max(values)
    margin = 0.25 * (high - low)
    return low - margin, high + margin


def _chart_of_case(
    name: str, case: int, programs: Iterable[str], y: tuple[float, float], may_stop: bool = True
) -> Chart:
    """Return a chart of the true omega1 of a case over time, and of programs as printed."""
    scene = case_scene(case)
    times = [0.0, *scene.times()]
    found = _chart(name, ("time, s", "ω₁, rad/s"), (0.0, times[-1]), y, _even(*y))
    curves = [_curve(found, "solution", times, [scene.omega[0], *_truth(case).omega[:, 0]])]
    for program in programs:
        omega = [scene.omega[0], *_run(case, program, may_stop=may_stop).omega[:, 0]]
        curves.append(_curve(found, program, times[: len(omega)], omega))
    return found._replace(curves=curves)


def _step_ticks() -> list[tuple[str, str]]:
    steps = _chart("stop", ("", ""), (0.0, 100.0), (0.0, 1.0), ())
    return steps.x_ticks


def _velocity_chart(run: Trajectory) -> Chart:
    velocity = [0.0, *_second_velocity(run)]
    found = _chart("velocity", ("step", "V2, m/s"), (0, 100), (-0.03, 0.03), _even(-0.03, 0.03))
    return found._replace(curves=[_curve(found, "runge-kutta", range(len(velocity)), velocity)])


def _second_velocity(run: Trajectory) -> list[float]:
    """Return the velocity V2 (m/s) after each step of a run."""
    assert run.velocity is not None
    return [float(row[1]) for row in run.velocity]


def _race_chart(listing: str) -> Chart:
    """Return the largest error of each program by case, on a scale of powers of ten."""
    axes = ("case", "largest error, rad/s")
    found = _chart(f"race-{listing}", axes, (1.5, 7.5), (-8, 2), _powers(-8, 2), is_log=True)
    curves = [
        _curve(found, name, RACE_CASES, [_largest_error(n, name, listing) for n in RACE_CASES])
        for name in PROGRAMS
    ]
    ticks = [(_written(_across(found, n)), str(n)) for n in RACE_CASES]
    return found._replace(x_ticks=ticks, curves=curves, is_marked=True)


def _chart(
    name: str,
    axes: tuple[str, str],
    x: tuple[float, float],
    y: tuple[float, float],
    y_ticks: Sequence[tuple[float, str]],
    is_log: bool = False,
) -> Chart:
    empty = Chart(name, axes, x, y, [], [], [], is_log)
    x_ticks = [(_written(_across(empty, value)), label) for value, label in _even(*x)]
    at = [(_written(_up(empty, 10.0**tick if is_log else tick)), label) for tick, label in y_ticks]
    return empty._replace(x_ticks=x_ticks, y_ticks=at)


def _even(low: float, high: float) -> list[tuple[float, str]]:
    """Return some round numbers of a range, with their labels."""
    raw = (high - low) / 5.0
    unit = 10.0 ** math.floor(math.log10(raw))
    step = next(unit * m for m in (1, 2, 5, 10) if unit * m >= raw)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [(n * step, f"{n * step:.6g}") for n in range(first, last + 1)]


def _powers(low: int, high: int) -> list[tuple[float, str]]:
    """Return some powers of ten of a range, by their exponents, with their labels."""
    return [
        (n, f"10{str(n).translate(_SUPERSCRIPTS)}" if n else "1")
        for n in range(low, high + 1)
        if n % _LOG_STEP == 0
    ]


def _across(chart: Chart, x: float) -> float:
    left, _, right, _ = BOX
    return left + (x - chart.x[0]) / (chart.x[1] - chart.x[0]) * (right - left)


def _up(chart: Chart, y: float) -> float:
    """Return the height of a value in the picture; what is outside by far is just outside."""
    _, top, _, bottom = BOX
    value = math.log10(y) if chart.is_logarithmic else y
    share = (value - chart.y[0]) / (chart.y[1] - chart.y[0])
    return bottom - min(max(share, -1.0), 2.0) * (bottom - top)


def _curve(chart: Chart, name: str, x: Iterable[float], y: Iterable[float]) -> Curve:
    """Return a curve as the points of an SVG polyline; chart.js does the same."""
    points = (
        f"{_written(_across(chart, a))},{_written(_up(chart, b))}"
        for a, b in zip(x, y, strict=True)
        if not chart.is_logarithmic or b > 0.0
    )
    return Curve(name, " ".join(points))


def _written(place: float) -> str:
    return f"{place:.1f}"
