"""A campaign of random scenes whose torque depends on the state, solved by every entry point.

The command is ``python -m tests.campaigns.state_campaign COUNT SEED [FIRST]``. Even numbers have
one or two ready terms, and odd numbers random expressions, of which every fourth changes suddenly.
A scene is solved with eleven tolerances from 1e-3 to 1e-13, with the attitude, and without it if
the torque does not depend on it. Every result is compared with a reference of 30 digits. A result
exceeds the limit if its error is larger than the tolerance plus 4e-15 K, where the error
amplification K is below 1e6. Estimates below a tenth or a hundredth of the error are counted.
A scene takes one to two seconds.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from random import Random

from pyharness import InputError, Scene, solve
from pyharness.checks.scenes.state_scenes import (
    READY,
    STEADY,
    SUDDEN,
    TIMED,
    TURNING,
    draw,
    draw_ready,
)
from tests.campaigns import driver
from tests.campaigns.driver import Tally
from tests.campaigns.entries import Result, Truth, results, truth_of

MODULE = "tests.campaigns.state_campaign"
TOLERANCES = tuple(10.0**-digits for digits in range(3, 14))
MOST_GROWTH = 1e6
_TIMES = (0.23, 0.61, 1.0)  # fractions of the last time at which there are results
# Factor on the work limit of the reference. Where it is exceeded, as by an omega that grows without
# bound, the time becomes shorter by the factor _SHORTER.
_EFFORT, _SHORTER = 0.2, 0.3
# An integration by SciPy takes longer than all others together, so that few scenes have one.
_SCIPY = {"dop853": 1e-10, "rk45": 1e-7, "radau": 1e-5, "lsoda": 1e-7}  # finest tolerances
_EVERY, _SCIPY_EFFORT = 25, 0.1
_FLOOR = 1e-15  # error that rounding of the result alone may cause


def judge(tally: Tally, truth: Truth, result: Result, tolerance: float, scene: Scene) -> None:
    """Compare a result with the reference, and count it."""
    if result.ended == "gave up" or result.ended.startswith("refused"):
        tally.counts["refused"] += 1
        return
    complete = len(truth.omega) == len(truth.times)
    wanted = int(complete) if result.last_only else len(truth.omega)
    growth = math.inf if result.growth is None else result.growth
    turning = "" if scene.attitude is None else ", with attitude"
    more = f", tolerance {tolerance:g}, {scene.name}{turning}"
    if len(result.omega) != wanted:
        if growth < MOST_GROWTH or complete:
            rows = f"{len(result.omega)} rows instead of {wanted}"
            tally.fault(f"{result.entry}: {rows}{more}, ended {result.ended}")
        else:
            tally.counts["singular, with other rows"] += 1
        return
    if not wanted:
        tally.counts["singular"] += 1
        return
    error = truth.error(result.omega, result.attitude, result.last_only)
    tally.counts["results"] += 1
    if result.estimate is not None:
        for name, factor in (("tenth", 10.0), ("hundredth", 100.0)):
            tally.counts[f"estimates below a {name} of the error"] += (
                error > factor * result.estimate + _FLOOR
            )
    if growth < MOST_GROWTH:
        more += f", K = {growth:.3g}, estimate {result.estimate}"
        tally.judge(result.entry, error, tolerance + 4e-15 * growth, more)


def drawn(source: Random, number: int) -> tuple[Scene, float]:
    """Return the random scene of a number, and its time (s)."""
    if number % 2 == 0:
        return draw_ready(source, READY + TIMED)
    return draw(source, STEADY + TURNING if number % 8 != 3 else (source.choice(SUDDEN),))


def try_scene(tally: Tally) -> None:
    """Solve one random scene by every entry point and with all tolerances."""
    source = Random(f"campaign {tally.seed} {tally.number}")
    scene, time = drawn(source, tally.number)
    truth = None
    while truth is None:
        times = [part * time for part in _TIMES]
        try:
            truth = truth_of(scene, times, _EFFORT)
        except InputError:
            time *= _SHORTER
    tally.counts["scenes"] += 1
    variants = [scene]
    if scene.attitude is not None and not scene.torque.needs_attitude:
        variants.append(replace(scene, attitude=None))
    for variant in variants:
        for tolerance in TOLERANCES:
            for result in results(variant, times, tolerance):
                judge(tally, truth, result, tolerance, variant)
    if tally.number // 2 % _EVERY == 0:
        _try_scipy(tally, scene, truth, source)


def _try_scipy(tally: Tally, scene: Scene, truth: Truth, source: Random) -> None:
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
    judge(tally, truth, result, tolerance, scene)


def main(arguments: Sequence[str]) -> int:
    return driver.run(MODULE, try_scene, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
