"""Methods in scenes drawn from a seed, by every entrance, against the second reference.

A tolerance is on the error at the times asked for, relative to the largest omega from 0 to the last
of them. Where small differences grow K times on the way, rounding alone makes 1e-15 K of it.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from pyharness.checks.check import REFUSED, Check, Sample
from pyharness.checks.selection import Selection
from pyharness.compare.candidates import called, solved
from pyharness.methods.problem import closed_form
from pyharness.methods.registry import REGISTRY, SCIPY_METHODS
from pyharness.methods.solve import finest
from pyharness.model.errors import InputError
from pyharness.model.trajectory import Array
from pyharness.scenes.random_scenes import Draw, draw
from pyharness.theory.conditioning import along
from pyharness.truth.integer_series import integer_series

# Of so many pairs of draws, a plain and a nasty one, methods are tried in one: the truth costs more
# than they do. Those of Python and decimals, which cost more than the truth, in fewer.
_EVERY, _EVERY_SLOW = 4, 60
ROUNDING = 2e-15  # relative, for each factor of growth
_CALM = 10.0  # growth of small differences where the series has no reason to refuse
_LIVELY = 1e3  # growth of small differences up to which a tolerance is kept as it stands
# Random scenes that may run away, or be too fast for any truth and any series.
_MAY_REFUSE = ("extreme", "coefficients", "violent torque")
_FINE = 1e-9
_MORE_WORK = "allow more work"
_EARLIER = 0.4  # of the last time: rows on the way are held to it too


@dataclass(frozen=True, eq=False)
class Truth:
    """The second reference in one draw."""

    times: list[float]  # s
    omega: Array  # shape (n, 3), rad/s
    largest: float  # largest abs(omega) of any component from 0 to the last time, rad/s
    growth: float  # largest factor by which a small difference on the way reaches the end

    def error(self, omega: Array) -> float:
        """Return the largest error of rows, relative to the largest omega; NaN where one is."""
        difference = float(np.abs(omega - self.omega[-len(omega) :]).max())
        if self.largest == 0.0:
            return 0.0 if difference == 0.0 else math.inf
        return difference / self.largest

    def limit(self, tolerance: float) -> float:
        """Return the largest error that a method may have."""
        bent = self.growth >= _LIVELY
        return tolerance * (self.growth if bent else 1.0) + ROUNDING * self.growth


def truth_of(drawn: Draw) -> Truth:
    """Return the truth of a draw; InputError where there is none."""
    times = [_EARLIER * drawn.time, drawn.time]
    path = integer_series(drawn.scene, times)
    largest = float(max(np.abs(path.way).max(), np.abs(path.omega).max()))
    growth = along(drawn.scene, path.nodes, path.way).amplification
    if not ROUNDING * growth < 1.0:
        raise InputError("rounding leaves no digit of it")
    return Truth(times, path.omega, largest, growth)


def _entrances(drawn: Draw, number: int, thin: bool) -> Mapping[str, Callable[[Truth], "Answer"]]:
    """Return what is tried in a draw, by the name of its check; where `thin`, what is compiled."""
    forms = ["closed-form"] if closed_form(drawn.scene) else []
    names = ["auto", "taylor", f"gauss-{drawn.stages}", *forms]
    if number // 2 % _EVERY_SLOW == 0 and not thin:
        names += [*SCIPY_METHODS, "reference"]
    again = ["auto", "taylor", "quick", *forms]
    return {f"solve-{name}": partial(_solved, name, drawn) for name in names} | {
        f"prepare-{name}": partial(_prepared, name, drawn) for name in again
    }


@dataclass(frozen=True, eq=False)
class Answer:
    """What an entrance gave: rows for the last of the times, or the reason why there are none."""

    method: str
    tolerance: float
    omega: Array | None
    why: str = ""


def _solved(name: str, drawn: Draw, truth: Truth) -> Answer:
    tolerance = drawn.tolerance(REGISTRY[name].finest)
    try:
        run = solved(name, tolerance).rows(drawn.scene, truth.times)
    except InputError as refusal:
        return Answer(name, tolerance, None, f"{REFUSED}{refusal}")
    if not run.has_all_rows or run.time.tolist() != truth.times:
        return Answer(name, tolerance, None, f"{run.ended}, other times than asked for")
    return Answer(name, tolerance, run.omega)


def _prepared(name: str, drawn: Draw, truth: Truth) -> Answer:
    tolerance = drawn.tolerance(REGISTRY[name].finest)
    end = called(name, tolerance, primed=True).end(drawn.scene, truth.times[-1])
    if not end.has_result:
        return Answer(name, tolerance, None, f"{REFUSED}{end.ended}")
    return Answer(name, tolerance, end.omega[None, :])


def random_methods(chosen: Selection) -> Iterator[Check]:
    """Hold every entrance to the second reference in scenes drawn from the seed."""
    for number in range(chosen.draws):
        if number // 2 % _EVERY or not chosen.may_ask(f"random/{number}"):
            continue
        drawn = draw(chosen.seed, number)
        asked = {
            f"random/{number}/{name}": entrance
            for name, entrance in _entrances(drawn, number, chosen.thin).items()
            if chosen.asks(f"random/{number}/{name}")
        }
        if not asked:
            continue
        try:
            truth = truth_of(drawn)
        except InputError as refusal:
            # Nothing to hold it against: a run-away, or too fast a motion for any truth.
            id = f"random/{number}/no-truth"
            again = chosen.replay_of_draw(f"random/{number}")
            may = drawn.scene.name in _MAY_REFUSE
            yield Check(id, may, None, None, again, f"{drawn.scene.name}: {refusal}")
            continue
        for id, entrance in asked.items():
            yield _held(id, chosen.replay_of_draw(id), drawn, truth, entrance(truth))


def _held(id: str, again: str, drawn: Draw, truth: Truth, answer: Answer) -> Sample:
    """Return the check that an answer is as near to the truth as it has to be."""
    error, limit, passed = None, None, False
    if answer.omega is not None:
        error, limit = truth.error(answer.omega), truth.limit(answer.tolerance)
        passed = error <= limit
    elif answer.why.startswith(REFUSED):
        passed = _may_refuse(answer, drawn, truth)
    entrance = id.rpartition("/")[2]
    note = f"{drawn.scene.name}, tolerance {answer.tolerance:.2g}, growth {truth.growth:.3g}"
    note = f"{note}: {answer.why}" if answer.why else note
    return Sample(id, passed, error, limit, again, note, entrance, answer.tolerance, truth.growth)


def _may_refuse(answer: Answer, drawn: Draw, truth: Truth) -> bool:
    """Whether a method may say that such a scene would take too long or leave too few digits.

    The choice of a method for a scene may not, and a closed form but where numbers end.
    """
    method = answer.method
    if method == "auto":
        return False
    if method == "closed-form":
        # A disturbance too faint to square, far from every ordinary number.
        return drawn.scene.name == "extreme"
    if drawn.scene.name in _MAY_REFUSE or truth.growth > _CALM or method == "quick":
        return True
    if method not in SCIPY_METHODS:
        return False
    # Radau's order is low for its finest tolerances.
    if answer.tolerance < _FINE and _MORE_WORK in answer.why:
        return True
    return finest(method, drawn.scene, truth.times[-1]) > answer.tolerance
