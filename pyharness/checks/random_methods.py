"""Checks of methods in random scenes against an independent true solution.

The true omega is from `integer_series`, the true attitude from `reference`. An entry point is
`solve` or a prepared solver, with one method. The tolerance limits the error of the attitude (rad),
or of omega relative to its largest component.

Under torques that depend on omega or attitude, the reference's series (`truth.tape_series`) shares
no code with the methods.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from random import Random

import numpy as np

from pyharness.checks.check import Attempt, Check, Name, Sample, Selection, selected
from pyharness.checks.compare.candidates import prepared_candidate
from pyharness.checks.judge import (
    IF_CALM,
    Answer,
    MethodRun,
    Policy,
    Truth,
    allowed,
    by_rows,
    judge,
    lively,
    of_end,
    reference_truth,
    tolerance_of,
)
from pyharness.checks.methods import START, run_of_call, run_of_solve
from pyharness.checks.scenes import state_scenes
from pyharness.checks.scenes.random_scenes import COARSEST, Draw, draw
from pyharness.checks.theory.conditioning import along
from pyharness.engine.many.many import solve_many
from pyharness.engine.plan.registry import METHODS, PREPARED_FOR_STATE, REGISTRY, SCIPY_METHODS
from pyharness.engine.solve import finest
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.basis import Basis
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.scene import Scene
from pyharness.model.trajectory import WITH_ALL_ROWS
from pyharness.truth.integer_series import integer_series

# A pair of draws has a plain scene and a scene of a kind in `NASTY`. Because true solutions take
# long, methods run in one of 4 pairs, and slow ones (in Python or decimal arithmetic) in one of 60.
# Attitudes are checked in one of 20 draws. Torques that depend on the state are checked in one of
# 20 draws, and by slow methods in one of 80.
_EVERY, _EVERY_SLOW, _EVERY_ATTITUDE = 4, 60, 20
_EVERY_TORQUE, _EVERY_SLOW_TORQUE = 20, 80
# Factors on the reference's work limit: for attitudes, and for torques that depend on the state.
_EFFORT, _EFFORT_TORQUE = 0.05, 0.2
ROUNDING = 2e-15  # relative error from rounding if the error amplification is 1
CAMPAIGN = Basis(
    "measured",
    "error in random scenes: tolerance plus 2e-15 K, where K is the error amplification",
    "`pyharness verify --only random --draws 12000 --seed campaign-1`, and seeds of each week",
)
"""Basis of the limits in random scenes."""
_CALM = 10.0  # error amplification below which a series has no reason to refuse
# Kinds of scenes whose motions may diverge, or be too fast for a true solution or a series.
_MAY_REFUSE = ("extreme", "coefficients", "violent torque")
# Below this tolerance, methods in Python or decimal arithmetic take too long.
_FINE = 1e-9
_MORE_WORK = "allow more work"
_EARLIER = 0.4  # fraction of the last time at which results are judged too

Entrances = dict[str, Callable[[], MethodRun]]


def truth_of(drawn: Draw) -> Truth:
    """Return a draw's true omega at an earlier and at its last time.

    Raise InputError if the motion is unbounded, too fast or too sensitive.
    """
    times = [_EARLIER * drawn.time, drawn.time]
    path = integer_series(drawn.scene, times)
    flow = along(drawn.scene, path.nodes, path.way)
    if not ROUNDING * flow.amplification < 1.0:
        raise InputError("amplified rounding errors leave no correct digit")
    largest = float(max(np.abs(path.way).max(), np.abs(path.omega).max()))
    return Truth(np.array(times), path.omega, 0.0, replace(flow, largest=largest))


def may_refuse(tried: MethodRun, truth: Truth, why: str) -> bool:
    """Return whether the method of `tried` may refuse with the message `why`."""
    method, kind = tried.method, tried.scene.name
    if method == "auto":
        return False
    if method == "closed-form":
        # The square of an extremely small perturbation may underflow.
        return kind == "extreme"
    if kind in _MAY_REFUSE or truth.flow.amplification > _CALM or method == "quick":
        return True
    if method not in SCIPY_METHODS:
        return False
    tolerance = tolerance_of(tried)
    # Radau's order is too low for its finest tolerances.
    if tolerance < _FINE and _MORE_WORK in why:
        return True
    return finest(method, tried.scene, truth.end) > tolerance


def _may_refuse_torque(tried: MethodRun, truth: Truth, why: str) -> bool:
    return tried.method in SCIPY_METHODS and ("can't meet it" in why or _MORE_WORK in why)


def _limit(truth: Truth, tried: MethodRun) -> float:
    growth = truth.flow.amplification
    own = truth.relative_error if truth.attitude is None else truth.angle_error
    return tolerance_of(tried) * lively(growth) + ROUNDING * growth + own


POLICY = Policy(_limit, CAMPAIGN, may_refuse)
"""Policy whose limit adds tolerance, amplified `ROUNDING` and the error of the true solution.

The tolerance is amplified too if the error amplification exceeds `LIVELY`.
"""
TORQUE_POLICY = replace(POLICY, may_refuse=_may_refuse_torque)
"""Policy under torques that depend on the state."""


def random_methods(chosen: Selection) -> Iterator[Check | Attempt]:
    """Yield checks of omega by each entry point."""
    for number in range(chosen.draws):
        if number // 2 % _EVERY or not chosen.may_ask(f"random/{number}"):
            continue
        drawn = draw(chosen.seed, number)
        asked = _requested(
            lambda id: selected(id, chosen.only), number, _entrances(drawn, number, chosen.thin)
        )
        if not asked:
            continue
        try:
            truth = truth_of(drawn)
        except InputError as refusal:
            may = drawn.scene.name in _MAY_REFUSE
            none = chosen.name_draw(number, "no-truth")
            again = chosen.name_draw(number).replay
            yield replace(none.judged(may, f"{drawn.scene.name}: {refusal}"), again=again)
            continue
        for subject, tried in asked.items():
            yield Attempt(chosen.name_draw(number, subject), partial(sample, tried, truth, POLICY))


def random_attitudes(chosen: Selection) -> Iterator[Attempt]:
    for number in range(0, chosen.draws, _EVERY_ATTITUDE):
        if not chosen.may_ask(f"random/{number}"):
            continue
        drawn = draw(chosen.seed, number)
        scene = replace(drawn.scene, attitude=START)
        times = (_EARLIER * drawn.time, drawn.time)
        tolerance = drawn.tolerance(METHODS["taylor"].finest)
        entrances: Entrances = {
            "attitude-auto": partial(run_of_solve, "auto", tolerance, scene, times),
            "attitude-taylor": partial(run_of_solve, "taylor", tolerance, scene, times),
            "attitude-prepared": partial(run_of_call, "auto", tolerance, scene, times[-1]),
        }
        asked = _requested(lambda id: selected(id, chosen.only), number, entrances)
        truth = _truth_if_known(scene, times, _EFFORT) if asked else None
        if truth and allowed(truth, 0.0, 1.0) < 1.0:
            for subject, tried in asked.items():
                made = partial(sample, tried, truth, IF_CALM)
                yield Attempt(chosen.name_draw(number, subject), made)


def _truth_if_known(scene: Scene, times: tuple[float, float], effort: float) -> Truth | None:
    try:
        return reference_truth(scene, times, effort)
    except InputError:
        return None


def _requested(is_asked: Callable[[str], bool], number: int, entrances: Entrances) -> Entrances:
    return {name: x for name, x in entrances.items() if is_asked(f"random/{number}/{name}")}


def _entrances(drawn: Draw, number: int, thin: bool) -> Entrances:
    """Return deferred runs by entry point, with slow methods in few draws."""
    forms = ["closed-form"] if closed_form(drawn.scene) else []
    names = ["auto", "taylor", f"gauss-{drawn.stages}", *forms]
    if number // 2 % _EVERY_SLOW == 0 and not thin:
        names += [*SCIPY_METHODS, "reference"]
    times = (_EARLIER * drawn.time, drawn.time)
    found: Entrances = {}
    for name in names:
        tolerance = drawn.tolerance(REGISTRY[name].finest)
        found[f"solve-{name}"] = partial(by_rows, name, tolerance, drawn.scene, times)
    for name in ("auto", "taylor", "quick", *forms):
        found[f"prepare-{name}"] = partial(_prepared, name, drawn)
    return found


def _prepared(name: str, drawn: Draw) -> MethodRun:
    tolerance = drawn.tolerance(REGISTRY[name].finest)

    def ask() -> Answer:
        end = prepared_candidate(name, tolerance, primed=True).end(drawn.scene, drawn.time)
        # An integration that ends before the last time counts as a refusal.
        return of_end(name, end) if end.has_result else Answer(refusal=f"{name}: {end.ended}")

    return MethodRun(name, tolerance, drawn.scene, ask)


def sample(tried: Callable[[], MethodRun], truth: Truth, policy: Policy, name: Name) -> Sample:
    one = tried()
    found, tolerance = judge(name, one, truth, policy), tolerance_of(one)
    growth = truth.flow.amplification
    told = f"{one.scene.name}, tolerance {tolerance:.2g}, growth {growth:.3g}"
    note = f"{told}: {found.note}" if found.note else told
    return Sample(
        name, found.passed, found.value, found.limit, found.basis, note,
        reference_bound=found.reference_bound,
        entrance=name.subject, tolerance=tolerance, growth=growth,
    )  # fmt: skip


def random_torques(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks under torques that depend on the state."""
    for number in range(0, chosen.draws, _EVERY_TORQUE):
        if not chosen.may_ask(f"random/{number}"):
            continue
        source = Random(f"torque {chosen.seed}/{number}")
        # So that both kinds of torque occur in the draws with slow methods.
        kind = (number // _EVERY_TORQUE + number // _EVERY_SLOW_TORQUE) % 2
        scene, time = (state_scenes.draw, state_scenes.draw_ready)[kind](source)
        is_slow = number % _EVERY_SLOW_TORQUE == 0 and not chosen.thin
        entrances = _torque_entrances(scene, time, source, is_slow)
        asked = _requested(chosen.may_ask, number, entrances)
        times = (_EARLIER * time, time)
        truth = _truth_if_known(scene, times, _EFFORT_TORQUE) if asked else None
        if truth and ROUNDING * truth.flow.amplification < 1.0:
            for subject, tried in asked.items():
                yield Attempt(chosen.name_draw(number, subject), partial(_samples, tried, truth))


def _torque_entrances(scene: Scene, time: float, source: Random, is_slow: bool) -> Entrances:
    """Return deferred runs by entry point, at tolerances from 1e-3 to the finest."""
    times, digits = (_EARLIER * time, time), source.random()
    slow = ("reference", *SCIPY_METHODS) if is_slow else ()

    def tolerance(name: str) -> float:
        finest = max(METHODS[name].finest, 0.0 if name in PREPARED_FOR_STATE else _FINE)
        return float(COARSEST * (finest / COARSEST) ** digits)

    found: Entrances = {}
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


def _samples(tried: Callable[[], MethodRun], truth: Truth, name: Name) -> Iterator[Check]:
    run = cache(tried)
    yield sample(run, replace(truth, attitude=None), TORQUE_POLICY, name.with_quantity("omega"))
    if truth.attitude is not None:
        yield sample(run, truth, TORQUE_POLICY, name.with_quantity("angle"))
