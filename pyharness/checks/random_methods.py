"""Methods in scenes drawn from a seed, by every entrance, against the second reference.

A tolerance is on the error at the times requested, relative to the largest omega from 0 to the last
of them, or on the angle. Where the motion amplifies perturbations K times, rounding alone makes
2e-15 K.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name, Sample
from pyharness.checks.judge import (
    IF_CALM,
    Answer,
    Policy,
    Tried,
    Truth,
    allowed,
    by_rows,
    judge,
    lively,
    of_end,
    reference_truth,
    tolerance_of,
)
from pyharness.checks.methods import START, call_tried, solve_tried
from pyharness.checks.selection import Selection
from pyharness.compare.candidates import prepared_candidate
from pyharness.methods.problem import closed_form
from pyharness.methods.registry import METHODS, REGISTRY, SCIPY_METHODS
from pyharness.methods.solve import finest
from pyharness.model.errors import InputError
from pyharness.scenes.random_scenes import Draw, draw
from pyharness.theory.conditioning import along
from pyharness.truth.integer_series import integer_series

# Of so many pairs of draws, a plain and a nasty one, methods are tried in one: the truth costs more
# than they do. Those of Python and decimals, which cost more than the truth, in fewer; attitudes in
# one of so many draws.
_EVERY, _EVERY_SLOW, _EVERY_ATTITUDE = 4, 60, 20
_EFFORT = 0.05  # of the reference, for an attitude
ROUNDING = 2e-15  # relative, for each factor of growth
_CALM = 10.0  # growth of perturbations where the series has no reason to refuse
# Random scenes that may run away, or be too fast for any truth and any series.
_MAY_REFUSE = ("extreme", "coefficients", "violent torque")
_FINE = 1e-9
_MORE_WORK = "allow more work"
_EARLIER = 0.4  # of the last time: intermediate output is judged too

Entrances = Mapping[str, Callable[[], Tried]]


def truth_of(drawn: Draw) -> Truth:
    """Return the truth of a draw; InputError where there is none."""
    times = [_EARLIER * drawn.time, drawn.time]
    path = integer_series(drawn.scene, times)
    flow = along(drawn.scene, path.nodes, path.way)
    if not ROUNDING * flow.amplification < 1.0:
        raise InputError("rounding leaves no digit of it")
    largest = float(max(np.abs(path.way).max(), np.abs(path.omega).max()))
    return Truth(np.array(times), path.omega, 0.0, replace(flow, largest=largest))


def may_refuse(tried: Tried, truth: Truth, why: str) -> bool:
    """Whether a method may say that such a scene would take too long or leave too few digits.

    The choice of a method for a scene may not, and a closed form but where numbers end.
    """
    method, kind = tried.method, tried.scene.name
    if method == "auto":
        return False
    if method == "closed-form":
        # A perturbation too faint to square, far from every ordinary number.
        return kind == "extreme"
    if kind in _MAY_REFUSE or truth.flow.amplification > _CALM or method == "quick":
        return True
    if method not in SCIPY_METHODS:
        return False
    tolerance = tolerance_of(tried)
    # Radau's order is low for its finest tolerances.
    if tolerance < _FINE and _MORE_WORK in why:
        return True
    return finest(method, tried.scene, truth.end) > tolerance


def _limit(truth: Truth, tried: Tried) -> float:
    growth = truth.flow.amplification
    return tolerance_of(tried) * lively(growth) + ROUNDING * growth


POLICY = Policy(_limit, may_refuse)
"""As `IF_CALM`, with so much rounding for each factor of growth."""


def random_methods(chosen: Selection) -> Iterator[Check | Attempt]:
    """Judge every entrance in scenes drawn from the seed."""
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
            # Nothing to judge by: a run-away, or too fast a motion for any truth.
            may = drawn.scene.name in _MAY_REFUSE
            none = chosen.drawn(number, "no-truth")
            again = chosen.drawn(number).replay
            yield replace(none.judged(may, f"{drawn.scene.name}: {refusal}"), again=again)
            continue
        yield from _sampled(chosen, number, asked, truth, POLICY)


def random_attitudes(chosen: Selection) -> Iterator[Attempt]:
    """Judge the attitude of the automatic choice and of the series in scenes from the seed."""
    tolerance_at = METHODS["taylor"].finest
    for number in range(0, chosen.draws, _EVERY_ATTITUDE):
        if not chosen.may_ask(f"random/{number}"):
            continue
        drawn = draw(chosen.seed, number)
        scene = replace(drawn.scene, attitude=START)
        times = (_EARLIER * drawn.time, drawn.time)
        tolerance = drawn.tolerance(tolerance_at)
        entrances: Entrances = {
            "attitude-auto": partial(solve_tried, "auto", tolerance, scene, times),
            "attitude-taylor": partial(solve_tried, "taylor", tolerance, scene, times),
            "attitude-prepared": partial(call_tried, "auto", tolerance, scene, times[-1]),
        }
        asked = _requested(chosen, number, entrances)
        try:
            truth = reference_truth(scene, times, _EFFORT) if asked else None
        except InputError:
            # Too fast or too long a motion for any truth, or one that runs away.
            continue
        if truth and allowed(truth, 0.0, 1.0) < 1.0:
            yield from _sampled(chosen, number, asked, truth, IF_CALM)


def _requested(chosen: Selection, number: int, entrances: Entrances) -> Entrances:
    return {name: x for name, x in entrances.items() if chosen.asks(f"random/{number}/{name}")}


def _entrances(drawn: Draw, number: int, thin: bool) -> Entrances:
    """Return what is tried in a draw, by the name of its check; where `thin`, what is compiled."""
    forms = ["closed-form"] if closed_form(drawn.scene) else []
    names = ["auto", "taylor", f"gauss-{drawn.stages}", *forms]
    if number // 2 % _EVERY_SLOW == 0 and not thin:
        names += [*SCIPY_METHODS, "reference"]
    times = (_EARLIER * drawn.time, drawn.time)
    found: dict[str, Callable[[], Tried]] = {}
    for name in names:
        tolerance = drawn.tolerance(REGISTRY[name].finest)
        found[f"solve-{name}"] = partial(by_rows, name, tolerance, drawn.scene, times)
    for name in ("auto", "taylor", "quick", *forms):
        found[f"prepare-{name}"] = partial(_prepared, name, drawn)
    return found


def _prepared(name: str, drawn: Draw) -> Tried:
    tolerance = drawn.tolerance(REGISTRY[name].finest)

    def ask() -> Answer:
        end = prepared_candidate(name, tolerance, primed=True).end(drawn.scene, drawn.time)
        # Every end before the last time is as good as a refusal.
        return of_end(name, end) if end.has_result else Answer(refusal=f"{name}: {end.ended}")

    return Tried(name, tolerance, drawn.scene, ask)


def _sampled(
    chosen: Selection, number: int, entrances: Entrances, truth: Truth, policy: Policy
) -> Iterator[Attempt]:
    for subject, tried in entrances.items():
        yield Attempt(chosen.drawn(number, subject), partial(_sample, tried, truth, policy))


def _sample(tried: Callable[[], Tried], truth: Truth, policy: Policy, name: Name) -> Sample:
    """Judge an entrance, and tell what its limit is made of."""
    one = tried()
    found, tolerance = judge(name, one, truth, policy), tolerance_of(one)
    growth = truth.flow.amplification
    told = f"{one.scene.name}, tolerance {tolerance:.2g}, growth {growth:.3g}"
    note = f"{told}: {found.note}" if found.note else told
    return Sample(
        name, found.passed, found.value, found.limit, note,
        entrance=name.subject, tolerance=tolerance, growth=growth,
    )  # fmt: skip
