"""Checks of methods in scenes drawn from a seed, against an independent true solution.

The true omega is from `integer_series`, the true attitude from `reference`. An entry point is
`solve` or a prepared solver, with one method. Its tolerance limits the error of omega, relative to
the largest omega until the last time, or the attitude error (rad). With the error amplification K,
rounding alone causes errors of 2e-15 K.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name, Sample
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
from pyharness.checks.scenes.random_scenes import Draw, draw
from pyharness.checks.selection import Selection
from pyharness.checks.theory.conditioning import along
from pyharness.engine.problem import closed_form
from pyharness.engine.registry import METHODS, REGISTRY, SCIPY_METHODS
from pyharness.engine.solve import finest
from pyharness.model.basis import Basis
from pyharness.model.errors import InputError
from pyharness.truth.integer_series import integer_series

# The draws of a pair are a plain scene and a scene of a kind in `NASTY`. Methods run in one of 4
# pairs, because the true solution takes longer than the methods. Methods in Python or decimal
# arithmetic take longer still, and run in one of 60 pairs; attitudes in one of 20 draws.
_EVERY, _EVERY_SLOW, _EVERY_ATTITUDE = 4, 60, 20
_EFFORT = 0.05  # factor on the work limit of the reference, for an attitude
ROUNDING = 2e-15  # relative, for an error amplification of 1
CAMPAIGN = Basis(
    "measured",
    "error in random scenes: tolerance plus 2e-15 K, where K is the error amplification",
    "`pyharness verify --only random --draws 12000 --seed campaign-1`, and seeds of each week",
)
"""Basis of the limits in random scenes."""
_CALM = 10.0  # error amplification below which the series has no reason to refuse
# Kinds of random scenes that may diverge, or be too fast for any true solution and any series.
_MAY_REFUSE = ("extreme", "coefficients", "violent torque")
_FINE = 1e-9
_MORE_WORK = "allow more work"
_EARLIER = 0.4  # fraction of the last time, to judge intermediate output too

Entrances = Mapping[str, Callable[[], MethodRun]]


def truth_of(drawn: Draw) -> Truth:
    """Return the true omega of a draw at 0.4 of its end time and at its end time.

    Raise InputError if the motion is unbounded or too fast, or rounding leaves no digit of omega.
    """
    times = [_EARLIER * drawn.time, drawn.time]
    path = integer_series(drawn.scene, times)
    flow = along(drawn.scene, path.nodes, path.way)
    if not ROUNDING * flow.amplification < 1.0:
        raise InputError("rounding leaves no digit of it")
    largest = float(max(np.abs(path.way).max(), np.abs(path.omega).max()))
    return Truth(np.array(times), path.omega, 0.0, replace(flow, largest=largest))


def may_refuse(tried: MethodRun, truth: Truth, why: str) -> bool:
    """Return whether a method may refuse its run `tried` with the message `why`.

    `auto` may never refuse, `quick` always, and a closed form only near the limits of binary64. The
    others may for the kinds in `_MAY_REFUSE` (diverging or too fast), and if the amplification
    exceeds `_CALM`; SciPy's also for too fine a tolerance.
    """
    method, kind = tried.method, tried.scene.name
    if method == "auto":
        return False
    if method == "closed-form":
        # Far from ordinary scales, the square of a perturbation may underflow.
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


def _limit(truth: Truth, tried: MethodRun) -> float:
    growth = truth.flow.amplification
    return tolerance_of(tried) * lively(growth) + ROUNDING * growth


POLICY = Policy(_limit, CAMPAIGN, may_refuse)
"""Policy whose limit is the tolerance plus `ROUNDING` times the error amplification.

The tolerance is multiplied by the error amplification too if this exceeds `LIVELY`.
"""


def random_methods(chosen: Selection) -> Iterator[Check | Attempt]:
    """Yield checks of omega from every entry point; without true solution, one for the scene."""
    for number in range(chosen.draws):
        if number // 2 % _EVERY or not chosen.may_ask(f"random/{number}"):
            continue
        drawn = draw(chosen.seed, number)
        asked = _requested(chosen, number, _entrances(drawn, number, chosen.thin))
        if not asked:
            continue
        try:
            truth = truth_of(drawn)
        except InputError as refusal:
            # Without true solution, the motion diverges or is too fast.
            may = drawn.scene.name in _MAY_REFUSE
            none = chosen.name_draw(number, "no-truth")
            again = chosen.name_draw(number).replay
            yield replace(none.judged(may, f"{drawn.scene.name}: {refusal}"), again=again)
            continue
        yield from _sampled(chosen, number, asked, truth, POLICY)


def random_attitudes(chosen: Selection) -> Iterator[Attempt]:
    """Yield deferred checks of attitudes, if the true attitude is known despite rounding."""
    tolerance_at = METHODS["taylor"].finest
    for number in range(0, chosen.draws, _EVERY_ATTITUDE):
        if not chosen.may_ask(f"random/{number}"):
            continue
        drawn = draw(chosen.seed, number)
        scene = replace(drawn.scene, attitude=START)
        times = (_EARLIER * drawn.time, drawn.time)
        tolerance = drawn.tolerance(tolerance_at)
        entrances: Entrances = {
            "attitude-auto": partial(run_of_solve, "auto", tolerance, scene, times),
            "attitude-taylor": partial(run_of_solve, "taylor", tolerance, scene, times),
            "attitude-prepared": partial(run_of_call, "auto", tolerance, scene, times[-1]),
        }
        asked = _requested(chosen, number, entrances)
        try:
            truth = reference_truth(scene, times, _EFFORT) if asked else None
        except InputError:
            # The motion diverges, or is too fast or long for any true solution.
            continue
        if truth and allowed(truth, 0.0, 1.0) < 1.0:
            yield from _sampled(chosen, number, asked, truth, IF_CALM)


def _requested(chosen: Selection, number: int, entrances: Entrances) -> Entrances:
    return {name: x for name, x in entrances.items() if chosen.asks(f"random/{number}/{name}")}


def _entrances(drawn: Draw, number: int, thin: bool) -> Entrances:
    """Return deferred runs by name of the entry point; slow methods run in few draws."""
    forms = ["closed-form"] if closed_form(drawn.scene) else []
    names = ["auto", "taylor", f"gauss-{drawn.stages}", *forms]
    if number // 2 % _EVERY_SLOW == 0 and not thin:
        names += [*SCIPY_METHODS, "reference"]
    times = (_EARLIER * drawn.time, drawn.time)
    found: dict[str, Callable[[], MethodRun]] = {}
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
        # An end before the last time counts as a refusal.
        return of_end(name, end) if end.has_result else Answer(refusal=f"{name}: {end.ended}")

    return MethodRun(name, tolerance, drawn.scene, ask)


def _sampled(
    chosen: Selection, number: int, entrances: Entrances, truth: Truth, policy: Policy
) -> Iterator[Attempt]:
    for subject, tried in entrances.items():
        yield Attempt(chosen.name_draw(number, subject), partial(sample, tried, truth, policy))


def sample(tried: Callable[[], MethodRun], truth: Truth, policy: Policy, name: Name) -> Sample:
    """Return the check of a run's error, with its tolerance and error amplification."""
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
