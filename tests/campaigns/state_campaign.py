"""A campaign of random scenes whose torque depends on the state, solved by every entry point.

The command is ``python -m tests.campaigns.state_campaign COUNT SEED [FIRST]``. Scenes FIRST to
FIRST + COUNT - 1 are solved, by default from 0. Even numbers have one or two ready terms, and odd
numbers random expressions, of which every fourth changes suddenly. A scene is solved with eleven
tolerances from 1e-3 to 1e-13, with the attitude, and without it if the torque does not depend on
it. Every result is compared with a reference of 30 digits. A result exceeds the limit if its error
is larger than the tolerance plus 4e-15 K, where the error amplification K is below 1e6. The command
prints a line for each such result, then a summary. It returns exit status 1 if there is such a
result. 10 000 scenes take half an hour of one core.
"""

import decimal
import math
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from random import Random
from time import process_time
from typing import Any

import numpy as np

from pyharness import InputError, Scene, prepare, solve, solve_many
from pyharness.model.attitude import angle_between
from pyharness.model.trajectory import Array, Trajectory
from pyharness.scenes.state_scenes import (
    READY,
    STEADY,
    SUDDEN,
    TIMED,
    TURNING,
    draw,
    draw_ready,
)
from pyharness.truth.decimal_series import taylor_series
from pyharness.truth.reference import exact_coefficients

TOLERANCES = tuple(10.0**-digits for digits in range(3, 14))
MOST_GROWTH = 1e6
# Fractions of the last time at which there are results. The reference has more times, from which
# the largest |omega| is known.
_TIMES = (0.23, 0.61, 1.0)
_MORE_TIMES = np.linspace(0.0, 1.0, 26)[1:-1].tolist()
# Digits, order and local tolerance of the reference. A test compares it with `reference`.
_DIGITS, _ORDER, _LOCAL = 30, 26, Decimal("1e-18")
# Factor on the work limit of the reference. Where it is exceeded, as by an omega that grows without
# bound, the time becomes shorter by the factor _SHORTER.
_EFFORT, _SHORTER = 0.2, 0.3
# An integration by SciPy takes longer than all others together, so that few scenes have one.
_SCIPY = {"dop853": 1e-10, "rk45": 1e-7, "radau": 1e-5, "lsoda": 1e-7}  # finest tolerances
_EVERY, _SCIPY_EFFORT = 25, 0.1
_FLOOR = 1e-15  # error that rounding of the result alone may cause


@dataclass(frozen=True, eq=False)
class Truth:
    """The true motion of a scene at requested times, up to the first singularity of the torque."""

    times: list[float]  # requested times, s
    omega: Array  # shape (n, 3), rad/s; n is smaller than the number of times after a singularity
    attitude: Array | None  # shape (n, 4)
    scale: float  # largest |omega| of any component, from time 0 to the last of the n times

    def error(self, omega: Array, attitude: Array | None, last_only: bool) -> float:
        """Return the error of results: the relative one of omega, or the angle (rad) if larger.

        The results are at the first times of the reference, or at its last time if `last_only`.
        """
        rows = slice(-1, None) if last_only else slice(0, len(omega))
        error = float(np.abs(omega - self.omega[rows]).max(initial=0.0)) / self.scale
        if attitude is None:
            return error
        assert self.attitude is not None
        return max(error, float(angle_between(attitude, self.attitude[rows]).max(initial=0.0)))


def truth_of(scene: Scene, times: Sequence[float]) -> Truth:
    """Return the true motion of a scene at `times` (s), from one decimal Taylor series.

    Raise InputError if the work limit of the reference is exceeded.
    """
    every = sorted({*times, *(part * times[-1] for part in _MORE_TIMES)}, key=abs)
    with decimal.localcontext() as context:
        context.prec = _DIGITS
        context.Emax, context.Emin = decimal.MAX_EMAX, decimal.MIN_EMIN
        exact, coefficients = list(map(Decimal, every)), exact_coefficients(scene)
        rows = taylor_series(scene, coefficients, exact, False, _ORDER, _LOCAL, _EFFORT)
    width = 3 if scene.attitude is None else 7
    state = np.array([[float(x) for x in row] for row in rows]).reshape(-1, width)
    state = state[np.isfinite(state).all(axis=1)]
    wanted = [row for time, row in zip(every, state, strict=False) if time in times]
    found = np.array(wanted).reshape(-1, width)
    attitude = None
    if scene.attitude is not None:
        attitude = found[:, 3:] / np.linalg.norm(found[:, 3:], axis=1)[:, None]
    largest = max(map(abs, [*scene.omega, *state[:, :3].flat]))
    return Truth(list(times), found[:, :3], attitude, largest)


@dataclass(frozen=True, eq=False)
class Result:
    """The result of one entry point for a scene, at all requested times or at the last one."""

    entry: str
    omega: Array  # shape (n, 3), rad/s
    attitude: Array | None  # shape (n, 4)
    ended: str
    estimate: float | None  # reported error; None if the entry point reports none
    growth: float | None  # reported error amplification K
    last_only: bool


def results(scene: Scene, times: list[float], tolerance: float) -> Iterator[Result]:
    """Yield the results of every entry point of the compiled series for a scene."""
    turning = scene.attitude is not None

    def of(entry: str, found: Trajectory, last_only: bool = False) -> Result:
        values = found.omega, found.attitude, found.ended, found.error, found.growth
        return Result(entry, *values, last_only)

    yield of("solve", solve(scene, times, tolerance=tolerance, attitude=turning))
    end = solve(scene, times[-1], "taylor", tolerance, attitude=turning)
    yield of("solve taylor", end, True)
    if turning:
        both: Any = prepare(scene, tolerance=tolerance, attitude=True)
        omega, attitude = both(scene.omega, times[-1], scene.attitude)
        yield _row("prepare", omega, attitude, both.status, both.error, both.growth)
        yield of("prepare, trajectory", both.trajectory(scene.omega, times))
    else:
        one = prepare(scene, tolerance=tolerance)
        omega = one(scene.omega, times[-1])
        yield _row("prepare", omega, None, one.status, one.error, one.growth)
        yield of("prepare, trajectory", one.trajectory(scene.omega, times))
    starts = [scene.omega, tuple(0.5 * w for w in scene.omega)]
    many = solve_many(scene, times[-1], omega0=starts, tolerance=tolerance)
    several = solve_many([scene, scene], times[-1], tolerance=tolerance)
    for entry, each in (("solve_many", many), ("solve_many of scenes", several)):
        turned = None if each.attitude is None else each.attitude[0]
        yield _row(entry, each.omega[0], turned, str(each.ended[0]), None, end.growth)


def _row(
    entry: str,
    omega: Array,
    attitude: Array | None,
    ended: str,
    estimate: float | None,
    growth: float | None,
) -> Result:
    """Return the result of an entry point that has no rows, at the last time."""
    count = 1 if np.isfinite(omega).all() else 0
    turned = None if attitude is None else attitude[None][:count]
    return Result(entry, omega[None][:count], turned, ended, estimate, growth, True)


@dataclass
class Tally:
    """The counts of a campaign, and a line for each result that exceeds the limit."""

    violations: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    largest: float = 0.0  # largest ratio of an error to its limit
    truth_seconds: float = 0.0
    seconds: float = 0.0

    def judge(self, place: str, truth: Truth, result: Result, tolerance: float) -> None:
        """Compare a result with the reference, and count it."""
        if result.ended in ("gave up", "refused"):
            self.counts["refused"] += 1
            return
        complete = len(truth.omega) == len(truth.times)
        wanted = int(complete) if result.last_only else len(truth.omega)
        growth = math.inf if result.growth is None else result.growth
        if len(result.omega) != wanted:
            if growth < MOST_GROWTH or complete:
                self._exceeds(place, f"{len(result.omega)} rows instead of {wanted}, tolerance "
                              f"{tolerance:g}, ended {result.ended}")  # fmt: skip
            else:
                self.counts["singular, with other rows"] += 1
            return
        if not wanted:
            self.counts["singular"] += 1
            return
        error = truth.error(result.omega, result.attitude, result.last_only)
        self.counts["results"] += 1
        if result.estimate is not None:
            self.counts["estimates"] += 1
            for name, factor in (("tenth", 10.0), ("hundredth", 100.0)):
                self.counts[name] += error > factor * result.estimate + _FLOOR
        if not growth < MOST_GROWTH:
            self.counts["large amplification"] += 1
            return
        limit = tolerance + 4e-15 * growth
        self.largest = max(self.largest, error / limit)
        if not error <= limit:
            self._exceeds(place, f"error {error:.3g} above {limit:.3g}, tolerance {tolerance:g}, "
                          f"K = {growth:.3g}, estimate {result.estimate}")  # fmt: skip

    def _exceeds(self, place: str, text: str) -> None:
        self.violations.append(f"{place}: {text}")
        print(self.violations[-1], flush=True)

    def summary(self) -> str:
        """Return the counts as text."""
        names = ("results", "large amplification", "singular", "singular, with other rows",
                 "refused", "estimates")  # fmt: skip
        parts = [f"{self.counts[name]} {name}" for name in names]
        return (
            f"{self.counts['scenes']} scenes, {', '.join(parts)}\n"
            f"{len(self.violations)} results exceed the limit; largest error over limit: "
            f"{self.largest:.3g}\n"
            f"estimates below a tenth of the error: {self.counts['tenth']}, below a hundredth: "
            f"{self.counts['hundredth']}\n"
            f"{self.truth_seconds:.0f} s for references, {self.seconds:.0f} s for results"
        )


def drawn(source: Random, number: int) -> tuple[Scene, float]:
    """Return the random scene of a number, and its time (s)."""
    if number % 2 == 0:
        return draw_ready(source, READY + TIMED)
    return draw(source, STEADY + TURNING if number % 8 != 3 else (source.choice(SUDDEN),))


def try_scene(tally: Tally, seed: str, number: int) -> None:
    """Solve one random scene by every entry point and with all tolerances."""
    source = Random(f"campaign {seed} {number}")
    scene, time = drawn(source, number)
    begin = process_time()
    truth = None
    while truth is None:
        times = [part * time for part in _TIMES]
        try:
            truth = truth_of(scene, times)
        except InputError:
            time *= _SHORTER
    tally.truth_seconds += process_time() - begin
    begin = process_time()
    tally.counts["scenes"] += 1
    variants = [scene]
    if scene.attitude is not None and not scene.torque.needs_attitude:
        variants.append(replace(scene, attitude=None))
    for variant in variants:
        for tolerance in TOLERANCES:
            try:
                for result in results(variant, times, tolerance):
                    place = _place(seed, number, scene, variant, result.entry)
                    tally.judge(place, truth, result, tolerance)
            except InputError:
                tally.counts["refused"] += 1
    if number // 2 % _EVERY == 0:
        _try_scipy(tally, _place(seed, number, scene, scene, ""), scene, truth, source)
    tally.seconds += process_time() - begin


def _try_scipy(tally: Tally, place: str, scene: Scene, truth: Truth, source: Random) -> None:
    name = source.choice(list(_SCIPY))
    tolerance = source.choice([each for each in TOLERANCES if each >= _SCIPY[name]])
    turning = scene.attitude is not None
    try:
        found = solve(scene, truth.times, name, tolerance, attitude=turning, effort=_SCIPY_EFFORT)
    except InputError:
        tally.counts["refused"] += 1
        return
    # SciPy's methods report no amplification, which is the same for all methods.
    growth = solve(scene, truth.times, tolerance=1e-9, attitude=turning).growth
    result = Result(name, found.omega, found.attitude, found.ended, found.error, growth, False)
    tally.judge(f"{place}{name}", truth, result, tolerance)


def _place(seed: str, number: int, scene: Scene, variant: Scene, entry: str) -> str:
    """Return the command that repeats a scene, and the names of the scene and the entry point."""
    turning = "with attitude" if variant.attitude is not None else "without attitude"
    command = f"python -m tests.campaigns.state_campaign 1 {seed} {number}"
    return f"{command}: {scene.name}, {turning}, {entry}"


def campaign(count: int, seed: str, first: int = 0) -> Tally:
    """Return the tally of `count` random scenes from number `first` on."""
    tally = Tally()
    for number in range(first, first + count):
        try_scene(tally, seed, number)
    return tally


def main(arguments: Sequence[str]) -> int:
    """Run the campaign of the command line; return 1 if a result exceeds the limit."""
    count, seed, first = [*arguments, "0"][:3]
    tally = campaign(int(count), seed, int(first))
    print(tally.summary())
    return 1 if tally.violations else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
