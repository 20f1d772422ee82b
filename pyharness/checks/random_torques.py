"""Checks of methods in random scenes whose torque depends on omega or attitude.

Torques are sums of recorded functions or of ready-made terms. The reference's series for them
(`pyharness.truth.tape_series`) shares no code with the methods.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from random import Random

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.judge import (
    Answer,
    MethodRun,
    Policy,
    Truth,
    by_rows,
    lively,
    reference_truth,
    tolerance_of,
)
from pyharness.checks.methods import run_of_call
from pyharness.checks.random_methods import CAMPAIGN, ROUNDING, sample
from pyharness.checks.scenes.random_scenes import COARSEST
from pyharness.checks.scenes.state_scenes import draw, draw_ready
from pyharness.checks.selection import Selection
from pyharness.engine.many import solve_many
from pyharness.engine.registry import METHODS, PREPARED_FOR_STATE, SCIPY_METHODS
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.scene import Scene
from pyharness.model.trajectory import WITH_ALL_ROWS

# One of 20 draws has such a scene; one of 80 also runs the methods in Python.
_EVERY, _EVERY_SLOW = 20, 80
_EFFORT = 0.2  # factor on the work limit of the reference
_EARLIER = 0.4  # fraction of the last time, to judge intermediate output too
# Methods in Python or decimal arithmetic, for which the finest tolerances take too long.
_FINE = 1e-9
_SLOW = ("reference", *SCIPY_METHODS)


def random_torques(chosen: Selection) -> Iterator[Attempt]:
    """Yield deferred checks of omega and attitude, if the true solution is known."""
    for number in range(0, chosen.draws, _EVERY):
        if not chosen.may_ask(f"random/{number}"):
            continue
        source = Random(f"torque {chosen.seed}/{number}")
        # Both kinds of torque occur in the draws that run all methods.
        kind = (number // _EVERY + number // _EVERY_SLOW) % 2
        scene, time = (draw, draw_ready)[kind](source)
        is_slow = number % _EVERY_SLOW == 0 and not chosen.thin
        entrances = {
            name: x
            for name, x in _entrances(scene, time, source, is_slow).items()
            if chosen.may_ask(f"random/{number}/{name}")
        }
        try:
            truth = reference_truth(scene, (_EARLIER * time, time), _EFFORT) if entrances else None
        except InputError:
            # The motion diverges, or is too fast or long for any true solution.
            continue
        if truth and ROUNDING * truth.flow.amplification < 1.0:
            for subject, tried in entrances.items():
                yield Attempt(chosen.name_draw(number, subject), partial(_samples, tried, truth))


def _entrances(
    scene: Scene, time: float, source: Random, is_slow: bool
) -> dict[str, Callable[[], MethodRun]]:
    """Return deferred runs by name of the entry point, at tolerances from 1e-3 to the finest."""
    times, digits = (_EARLIER * time, time), source.random()
    slow = _SLOW if is_slow else ()

    def tolerance(name: str) -> float:
        finest = max(METHODS[name].finest, 0.0 if name in PREPARED_FOR_STATE else _FINE)
        return float(COARSEST * (finest / COARSEST) ** digits)

    found: dict[str, Callable[[], MethodRun]] = {}
    for name in (*PREPARED_FOR_STATE, *slow):
        found[f"torque-solve-{name}"] = partial(by_rows, name, tolerance(name), scene, times)
    for name in PREPARED_FOR_STATE:
        run = partial(run_of_call, name, tolerance(name), scene, time)
        found[f"torque-prepare-{name}"] = run
    found["torque-solve-many"] = partial(_by_many, tolerance("auto"), scene, time)
    return found


def _by_many(tolerance: float, scene: Scene, time: float) -> MethodRun:
    def ask() -> Answer:
        found = solve_many([scene, scene], time, tolerance=tolerance)
        attitude = None if found.attitude is None else found.attitude[1:]
        ended = ENDS[found.status[1]]
        return Answer(found.omega[1:], attitude, ended, is_whole=ended in WITH_ALL_ROWS)

    return MethodRun("auto", tolerance, scene, ask)


def _may_refuse(tried: MethodRun, truth: Truth, why: str) -> bool:
    if tried.method in SCIPY_METHODS and "can't meet it" in why:
        return True
    return tried.method in SCIPY_METHODS and "allow more work" in why


def _limit(truth: Truth, tried: MethodRun) -> float:
    growth = truth.flow.amplification
    own = truth.relative_error if truth.attitude is None else truth.angle_error
    return tolerance_of(tried) * lively(growth) + ROUNDING * growth + own


POLICY = Policy(_limit, CAMPAIGN, _may_refuse)
"""Policy whose limit adds tolerance, amplified rounding and the error of the true solution.

The rounding is `ROUNDING` times the error amplification. The tolerance is amplified too if the
error amplification exceeds `LIVELY`.
"""


def _samples(tried: Callable[[], MethodRun], truth: Truth, name: Name) -> Iterator[Check]:
    run = cache(tried)
    yield sample(run, replace(truth, attitude=None), POLICY, name.with_quantity("omega"))
    if truth.attitude is not None:
        yield sample(run, truth, POLICY, name.with_quantity("angle"))
