"""Plants of a chosen size: one just beyond every limit of `verify` and `stress`, one just within.

The values of the limits are written down here a second time, from their descriptions and not from
the code. A limit that becomes looser lets its plant pass; one that becomes too tight fails a plant
within it.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cache, partial
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from pyharness.checks.plants.faults import (
    COMPILED,
    PROGRAM,
    Change,
    Fault,
    beside,
    bit_off,
    instead,
    of,
    off,
    on,
    plus,
)
from pyharness.checks.plants.plants import PLANTS
from pyharness.checks.port_process import PortError
from pyharness.checks.scene_trials import scene_trials
from pyharness.checks.stress import TRIALS, Trial, trial
from pyharness.checks.trials import length, step_size
from pyharness.dynamics.terms import damping
from pyharness.methods.registry import METHODS
from pyharness.methods.solve import solve
from pyharness.model.attitude import product
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.original.linear_solver import SINGULAR
from pyharness.original.vectors import Answer
from pyharness.theory import brouwer
from pyharness.truth.reference import Reference, reference

# Half a unit in the last place of 1, and a whole one.
U = 2.0**-53
ULP = 2.0 * U

_IN_WORD = "pyharness.original.in_word.run"
_ANSWER = "pyharness.checks.port.read_answer"
_DECK = "pyharness.checks.decks.run_deck"
_DRAWN = "pyharness.checks.random_methods"
_SOLVE = "pyharness.compare.candidates.solve"
_ANSWERED = "pyharness.compare.candidates._answered"
_END = "pyharness.compare.candidates.Candidate.end"
_NEAR_SEPARATRIX = "pyharness.checks.trials.separatrix.run_method"
_HELD = "pyharness.checks.hold.run_method"
_TURNED = "pyharness.checks.trials.invariance"
_TURNING = "pyharness.checks.trials.attitude.solve"
_PREPARED = "pyharness.compare.candidates.prepare"
_REGIONS = "pyharness.checks.trials.regions"
_STEPS = "pyharness.checks.trials.step_size"
_MATRICES = "pyharness.checks.trials.matrices"

# A module that is imported while a fault is planted would keep the fault.
for _name in TRIALS:
    trial(_name)


@dataclass(frozen=True)
class Slack:
    """A limit of the check `check`, between two plants.

    With a plant of size `beyond`, the check fails (or `failing`, if given, fails instead); with one
    of size `within`, it passes.
    """

    check: str
    planted: Fault
    beyond: float
    within: float
    failing: str = ""
    # The trials to which the check belongs, if they are not those of `stress` without a scene.
    trials: Callable[[], Mapping[str, Trial]] | None = None


def near(check: str, planted: Fault, due: float) -> Slack:
    """Return a limit of size `due`, on an error that adds to the existing one."""
    return Slack(check, planted, 1.5 * due, 0.75 * due)


def exact(check: str, planted: Fault, least: float = 1.0, failing: str = "") -> Slack:
    """Return a limit of zero: the smallest possible error fails."""
    return Slack(check, planted, least, 0.0, failing)


# The planted changes: `change(found, size)`.


@dataclass
class Turned:
    """A prepared solver whose attitudes are wrong by `size` (rad)."""

    solver: Callable[..., tuple[Array, Array]]
    size: float
    status: str = "complete"
    steps: int = 0

    def __call__(self, *given: Any) -> tuple[Array, Array]:
        """Rotate the attitude of the solver's result."""
        omega, attitude = self.solver(*given)
        return omega, _turned(attitude[None, :], np.array([[0.48, 0.64, -0.6]]), self.size)[0]


def turned_off(found: Trajectory, size: float, along: bool = False) -> Trajectory:
    """Rotate every attitude by `size` (rad), across the angular momentum or along it."""
    assert found.attitude is not None
    axes = found.angular_momentum()
    axes = axes if along else np.cross(axes, [1.0, 2.0, 3.0])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return replace(found, attitude=_turned(found.attitude, axes, size))


def _turned(attitude: Array, axes: Array, size: float) -> Array:
    turn = np.full(len(attitude), math.cos(0.5 * size)), *math.sin(0.5 * size) * axes.T
    result: Array = np.array(product(attitude.T, turn)).T
    return result


def unturned(found: Trajectory, size: float) -> Trajectory:
    return replace(found, attitude=None) if size else found


def last_off(found: Array, size: float) -> Array:
    """Apply `off` to the last row only."""
    return np.vstack([found[:-1], off(found[-1:], size)])


def without_answer(found: list[Answer], size: float) -> list[Answer]:
    """Remove the answer of the first vector, if the size is not 0."""
    return [found[0]._replace(found=""), *found[1:]] if size else found


def degrees_off(found: Array, size: float) -> Array:
    """Change the first angle by `size` (rad)."""
    wrong: Array = found + np.array([math.degrees(size), 0.0, 0.0])
    return wrong


def value_off(found: Any, size: float) -> Any:
    """Multiply a number, or each number of an array, by 1 + `size`."""
    return found * (1.0 + size)


def singular(ier: Array, size: float) -> Array:
    """Report singular matrices for the last `size` steps."""
    wrong = ier.copy()
    wrong[len(ier) - int(size) :] = SINGULAR
    return wrong


def ended(found: Any, size: float, why: str = "overflow") -> Any:
    return replace(found, ended=why) if size else found


VALUE, IER = of("found", plus), of("ier", singular)
TIME, LAST = of("time", bit_off), of("omega", last_off)
QUOTIENT = of("stop", of("quotient", value_off))
SHORT = of("omega", lambda found, size: found[: len(found) - int(size)])
LONG = of("attitude", value_off)


# The places of plants.


def named(plant: str) -> Fault:
    """Return a fault of the self-test of `verify` by its name."""
    return next(each.planted for each in PLANTS if each.name == plant)


def refuses(target: str, error: type[Exception] = InputError) -> Fault:
    """Return a plant that refuses every call, if the size is not 0."""

    def faulty(size: float, right: Callable[..., Any], *rest: Any, **named: Any) -> Any:
        if size:
            raise error("no")
        return right(*rest, **named)

    return instead(target, faulty)


def made_by(target: str, stand_in: Callable[..., Any]) -> Fault:
    """Return a plant that replaces a function; the size comes before its arguments."""
    return lambda size: patch(target, partial(stand_in, size))


@cache
def _truth() -> Reference:
    return reference(case_scene(5), case_scene(5).times(), velocity=True)


def graded(target: str, error: Callable[[Scene, float], float]) -> Fault:
    """Return a plant of results with a known error, relative to the largest omega of Case 5."""

    def faulty(size: float, right: Callable[..., Any], *rest: Any, **named: Any) -> Trajectory:
        scene = next(each for each in rest if isinstance(each, Scene))

        def rows(truth: Array) -> Array:
            parts = scene.steps // len(truth)
            found = np.zeros((scene.steps, 3))
            found[parts - 1 :: parts] = truth + error(scene, size) * np.abs(truth).max()
            return found

        known: Trajectory = right(*(case_scene(5) if x is scene else x for x in rest), **named)
        velocity = None if known.velocity is None else rows(np.asarray(_truth().velocity))
        omega = rows(_truth().omega)
        return replace(known, ier=None, steps=scene.steps, omega=omega, velocity=velocity)

    return instead(target, faulty)


def solved(size: float, scene: Scene, times: Sequence[float], *_: Any, **__: Any) -> Trajectory:
    """Return a solution with an error of `size`, in place of any method."""
    found: Trajectory = off(solve(scene, times, "taylor", 1e-15), size)
    return found


def of_order(due: int) -> Callable[[Scene, float], float]:
    """Return an error whose order is too low by the size."""
    return lambda scene, size: 1e-3 * (scene.step_size / case_scene(5).step_size) ** (due - size)


def roundings(more: float) -> Callable[[Scene, float], float]:
    """Return `size` times the sum of 8 roundings of every step and `more`."""
    return lambda scene, size: size * (8.0 * U * scene.steps + more)


def _tighter(size: float, right: Callable[..., Any], *rest: Any, **named: Any) -> Any:
    """Run a program with the constant of the stop test multiplied by 1 + `size`."""
    if "lipschitz" in named:
        named["lipschitz"] *= 1.0 + size
    return right(*rest, **named)


def kept(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that computes each result only once."""
    known: dict[str, Any] = {}

    def found(*rest: Any, **named: Any) -> Any:
        key = repr((rest, named))
        if key not in known:
            known[key] = function(*rest, **named)
        return known[key]

    return found


@cache
def _contenders() -> dict[str, length.Integrator]:
    return {
        name: replace(each, run=kept(each.run), noise=kept(each.noise), revolutions=1e3, others=1e3)
        for name, each in length.INTEGRATORS.items()
    }


def shorter() -> AbstractContextManager[Any]:
    """Follow only two starts, through a thousand revolutions."""
    return patch.multiple(length, INTEGRATORS=_contenders(), STARTS=2)


def watched(error: Callable[[float, float], float]) -> Fault:
    """Let the error of energy, momentum and phase be `error(size, time)`."""

    def faulty(size: float, scene: Scene, body: Any, time: float, *_: Any) -> dict[str, float]:
        return dict.fromkeys(brouwer.LAWS, error(size, time))

    return beside(shorter, made_by("pyharness.theory.brouwer.errors", faulty))


def form_for_all(
    size: float, scene: Scene, times: Sequence[float], name: str, *rest: Any, **named: Any
) -> Trajectory:
    """Solve by a closed form, or by the series in its place if the size is not 0."""
    if size:
        return solve(scene, times, "taylor", 1e-15, **named)
    return solve(scene, times, name, *rest, **named)


def other_library() -> AbstractContextManager[Any]:
    return patch("pyharness.checks.golden.mathematics", lambda: "another")


def without(found: Iterator[Any] | dict[str, Any], size: float) -> Any:
    """Leave out Case 5 of the Taylor series, from the record or from what should be recorded."""
    if not size:
        return found
    if not isinstance(found, dict):
        return [each for each in found if (each.source, each.name) != ("taylor", "case-5")]
    rest = [each for each in found["taylor"]["trajectory"] if "--case 5 " not in each["command"]]
    return {**found, "taylor": {**found["taylor"], "trajectory": rest}}


def linear(change: Change) -> Fault:
    """Change what the compiled solver of linear equations returns."""

    def altered(kernels: Any, size: float) -> SimpleNamespace:
        def faulty(a: Array, b: Array) -> tuple[Array, Array, int]:
            factors, x, ier = kernels.solve_linear(a, b)
            return factors, change(x, size), ier

        return SimpleNamespace(solve_linear=faulty)

    return on("pyharness.model.extension.extension", altered)


def crossing_off(size: float) -> AbstractContextManager[Any]:
    """Let truncation dominate down to a step of 10**-3.75 s times 10**-size, and not below."""

    def error(scene: Scene, name: str, case: int, listing: Any) -> tuple[float, str]:
        rules = math.log10(scene.step_size) > -3.75 - size
        return (step_size._forecaster(case, name).at(scene.steps).truncation if rules else 1.0), ""

    return patch.object(step_size, "_error", error)


def some_bits(size: float) -> AbstractContextManager[Any]:
    """Let `size` of the calls in threads return other bits."""
    calls = itertools.count()
    # Seven jobs run alone before they run at once.
    return patch(
        "pyharness.checks.trials.threads.bits", lambda job: bytes(7 <= next(calls) < 7 + size)
    )


_BITS = "cells/runge-kutta/case-3/original"
_ORDERS = {"two-term": 2, "four-term": 2, "runge-kutta": 4}
_TEXTBOOKS = {"improved-euler": 2, "taylor-3": 2, "rk4": 4}
_GAUSS = tuple(f"gauss-{stages}" for stages in range(1, 9))
_JUDGED = [
    name
    for name, method in METHODS.items()
    if method.finest < 1.0 and not method.weak_torque and name != "reference"
]


def _with_form(name: str) -> int:
    """Return a case that the method accepts."""
    return 4 if name == "closed-form" else 5


VERIFY = (
    # Every bit, counter and label, in one language and in both alike.
    exact("cells/two-term/case-3/corrected", named("ulp-in-fortran"), ULP),
    exact("random/0/program", on(COMPILED, bit_off), ULP),
    exact("words/two-term/case-3/corrected", on(_IN_WORD, bit_off), ULP),
    exact("words/vectors", on("pyharness.checks.words.answers", without_answer)),
    exact("port/two-term/case-3/original", on(_ANSWER, of("rows", bit_off)), ULP),
    exact("port/runge-kutta/case-2/original", refuses(_ANSWER, PortError)),
    exact("decks/two-term/case-3/original", on(COMPILED, bit_off), ULP),
    exact("decks/runge-kutta/case-2/original", refuses(_DECK, RuntimeError)),
    exact(_BITS, named("velocity-in-fortran"), ULP),
    exact(_BITS, named("label-in-fortran"), ULP),
    exact(_BITS, on(COMPILED, TIME), ULP),
    exact(_BITS, named("label-in-both"), ULP),
    exact(_BITS, on(COMPILED, ended)),
    exact(_BITS, named("count-in-fortran")),
    exact(_BITS, named("count-in-both")),
    exact("cells/four-term/case-3/corrected", on(COMPILED, IER)),
    exact("random/0/solve-taylor", refuses(f"{_DRAWN}.truth_of"), failing="random/0/no-truth"),
    # .298 of the digits from 1e-3 to the finest tolerance that each claims: 1e-15, 1e-14, 7e-13,
    # 2.1e-12, 2.2e-16, and 1e-12.
    *(
        near(f"random/0/solve-{name}", on(_SOLVE, off), due)
        for name, due in (
            ("auto", 2.65e-7), ("taylor", 2.65e-7), ("gauss-7", 5.26e-7), ("dop853", 1.87e-6),
            ("rk45", 2.59e-6), ("radau", 1.87e-6), ("lsoda", 2.59e-6), ("reference", 1.69e-7),
        )
    ),
    *(
        near(f"random/0/prepare-{name}", on(_ANSWERED, off), due)
        for name, due in (("auto", 2.65e-7), ("taylor", 2.65e-7), ("quick", 2.07e-6))
    ),
    # Where a perturbation grows a thousandfold, the tolerance may be exceeded by the same factor.
    near("random/56/solve-taylor", on(_SOLVE, off), 5.1e-6),
    near("random/592/solve-taylor", on(_SOLVE, off), 3.31e-6),
    near("random/592/solve-gauss-6", on(_SOLVE, off), 5.32e-6),
    near("random/641/solve-gauss-8", on(_SOLVE, off), 14.9e3 * 1.53e-6),
    # Rounding is allowed 2e-15 for each unit of amplification, here 15.1.
    near("random/337/solve-gauss-8", on(_SOLVE, off), 9.7e-14 + 15.1 * 2e-15),
    # Under a torque that depends on the state.
    near("random/40/torque-solve-taylor/omega", on(_SOLVE, off), 3.83e-6),
    exact("random/40/torque-solve-taylor/omega", refuses(_SOLVE)),
    exact("random/0/solve-taylor", on(_SOLVE, TIME), ULP),
    exact("random/0/solve-taylor", on(_SOLVE, ended)),
    exact("random/0/solve-taylor", refuses(_SOLVE)),
    exact("cells/two-term/case-3/corrected", refuses("pyharness.checks.cells.case_scene"),
          failing="cells/refused"),
    # The last step of Case 7 ends at (.25, .91, 1.08). The limit is 4 roundings at either end, and
    # h times 32 roundings of the sum of the sizes of a rate's terms, 2.8, .3 and .16. For
    # collocation it is multiplied by the condition of the matrix, 7 and 547.
    near("schemes/two-term/case-7", on(PROGRAM, LAST), 8.2 * U / 1.08),
    near("schemes/four-term/case-7", on(PROGRAM, LAST), 37.0 * U / 1.08),
    near("schemes/runge-kutta/case-7", on(PROGRAM, LAST), 2.9 * U / 1.08),
    exact("schemes/runge-kutta/case-7", on(PROGRAM, SHORT)),
    exact("stops/case-3/corrected", on(PROGRAM, SHORT)),
    # In a step of Case 3 the rates, 5 rad/s**2 with 32 roundings each, change by .27. Omega, 10
    # rad/s with 2 roundings at either end and those of the rates, changes by .05.
    near("stops/case-3/corrected", on(PROGRAM, QUOTIENT), 2.3e-13),
    # The constants differ from a quotient by twice the rounding.
    near("stops/case-3/corrected", instead(PROGRAM, _tighter), 4.6e-13),
    # A tolerance, relative to the largest omega.
    *(
        near(f"methods/{name}/case-{_with_form(name)}/1.0e-06",
             made_by(_SOLVE, solved), 1e-6)
        for name in _JUDGED
    ),
    # A steady spin has only 8 roundings of the start, 8 of the result, and half a unit in the last
    # place of the truth itself.
    near("methods/taylor/case-1/1.0e-15", on(_SOLVE, off), 1e-15 + 17.0 * U),
    exact("methods/taylor/case-5/1.0e-06", refuses(_SOLVE)),
    exact("methods/closed-form/case-5/1.0e-06", made_by(_SOLVE, form_for_all)),
    exact("methods/taylor/case-5/1.0e-06", on(_SOLVE, TIME), ULP),
    exact("methods/taylor/case-5/1.0e-06", on(_SOLVE, ended)),
    *(
        near(f"prepared/{name}/case-{_with_form(name)}/{end}/1.0e-06",
             on(_ANSWERED, off), 1e-6)
        for name in ("auto", "taylor", "quick", "closed-form")
        for end in (3, -1)
    ),
    # The tolerance of an angle, in radians.
    *(
        near(f"attitudes/{name}/case-{_with_form(name)}/1.0e-06", on(_SOLVE, turned_off), 1e-6)
        for name in ("auto", "taylor", "closed-form", "dop853", "lsoda")
    ),
    exact("attitudes/taylor/case-5/1.0e-06", refuses(_SOLVE)),
    exact("attitudes/closed-form/case-5/1.0e-06",
          made_by(_SOLVE, form_for_all)),
    exact("attitudes/taylor/case-5/1.0e-06", on(_SOLVE, ended)),
    near("attitudes/prepared-taylor/case-5/-1/1.0e-06", on(_PREPARED, Turned), 1e-6),
    near("attitudes/prepared-auto/case-4/3/1.0e-06", on(_PREPARED, Turned), 1e-6),
    near("random/0/attitude-taylor", on(_SOLVE, turned_off), 2.65e-7),
    near("random/0/attitude-prepared", on(_PREPARED, Turned), 2.65e-7),
    exact("prepared/quick/case-5/1/1.0e-06", on(_ANSWERED, partial(ended, why="gave up"))),
    *(
        exact(f"prepared/{name}/case-5/bits", on(_ANSWERED, bit_off), ULP)
        for name in (*_TEXTBOOKS, *_GAUSS)
    ),
    # A fifth of an order.
    *(
        near(f"orders/{name}/case-5{what}", graded(PROGRAM, of_order(_ORDERS[name])), 0.2)
        for name in PROGRAMS
        for what in ("", "/velocity")
    ),
    *(
        near(f"orders/{name}/case-5", graded(_SOLVE, of_order(due)), 0.2)
        for name, due in _TEXTBOOKS.items()
    ),
    # An error counts as rounding up to 8 roundings of every step, and the error of the truth, which
    # is 7e-13 if `solve_ivp` computed it.
    near("orders/two-term/case-5", graded(PROGRAM, roundings(7e-13)), 1.0),
    near("orders/two-term/case-5/velocity", graded(PROGRAM, roundings(0.0)), 1.0),
    # A method compared with print: half a unit of the last digit or the error that the source
    # admits (5e-15 here), the finest tolerance, and two roundings of each number of the problem,
    # which change the least sensitive omega by 4e-15.
    near("external/detest-b5/20/taylor", on(_SOLVE, off), 1.0e-14),
    near("external/detest-b5/20/gauss-8", on(_SOLVE, off), 1.9e-14),
    near("external/detest-b5/20/quick", on(_ANSWERED, off), 1e-9),
    # The finest tolerance that LSODA claims over 20 s.
    near("external/detest-b5/20/lsoda", on(_SOLVE, off), 1.6e-11),
    # Nine digits of each of four components; the error of the angle is twice theirs.
    near("external/nasa-brick-attitude/1/taylor/attitude", on(_SOLVE, turned_off), 4e-9),
    exact("external/nasa-brick-attitude/1/taylor/attitude", refuses(_SOLVE)),
    exact("external/nasa-brick-attitude/1/taylor/attitude", on(_SOLVE, unturned)),
    near("external/nasa-brick/30/taylor", on(_SOLVE, off), 2e-8 / 34.3),
    # A program's halved steps have half a unit in the last place for each of 16 384 steps.
    near("external/detest-b5/20/runge-kutta", on(PROGRAM, off), 2.0e-12),
    # Half a unit of three digits, of which 3.9e-4 is used, and the error of the halved steps.
    Slack("external/hairer-rigid-body/20/runge-kutta", on(PROGRAM, off), 4e-4, 1e-4),
    exact("external/detest-b5/20/auto", refuses(_SOLVE)),
    exact("external/detest-b5/20/two-term", on(PROGRAM, IER)),
    # The record and the result may each have an error of 1e-9; where every bit counts, none.
    near("golden/taylor/case-5", on(_SOLVE, off), 2e-9),
    exact("golden/taylor/case-5", on(_SOLVE, TIME), ULP),
    exact("golden/taylor/case-5", on("pyharness.checks.golden.read_record", without)),
    exact("golden/taylor", on("pyharness.checks.golden.recorded", without),
          failing="golden/taylor/case-5-method-taylor-tolerance-1e-09"),
    # With another library's sine and cosine, results may differ by the rounding of a wave.
    near("golden/rk4/case-7", beside(other_library, on(_SOLVE, off)), 3.4e-15),
    exact("golden/rk4/case-5", on(_SOLVE, bit_off), ULP),
    exact("golden/two-term/case-5/corrected", on(PROGRAM, bit_off), ULP),
)  # fmt: skip

_SCALED = "pyharness.checks.trials.scales.run_method"
_SPHERE = "near-symmetry/{}/sphere-equal/{}"
_FREE = f"{_TURNED}.end"

STRESS = (
    exact("separatrix/taylor/none", refuses(_NEAR_SEPARATRIX),
          failing="separatrix/refused"),
    exact("separatrix/taylor/none", on(_NEAR_SEPARATRIX, bit_off), ULP),
    near("separatrix/quick/none", on(_NEAR_SEPARATRIX, off), ULP),
    exact("separatrix/taylor/none", on(_NEAR_SEPARATRIX, ended)),
    # Near the separatrix the flow amplifies tolerances, here 10.4 times; the limit means nothing
    # where fewer than two digits are left.
    near("separatrix/taylor/early-1e-01/1e-06/error", on(_HELD, off), 1.04e-5),
    near("separatrix/taylor/on-1e-04/1e-06/error", on(_HELD, off), 6.4e-3 / 0.63),
    exact("separatrix/taylor/early-1e-01/1e-06/error", on(_HELD, ended)),
    exact("separatrix/taylor/early-1e-01/1e-06/error", refuses(_HELD)),
    # The flow of a sphere amplifies nothing. The limit is a tolerance, 8 roundings of the start and
    # 8 of the result, half a unit in the last place of the truth, and one of each of the 10 steps
    # of a method that does not compensate, or 4 if its steps are iterated.
    *(
        near(_SPHERE.format(name, "1e-06/error"), on(_HELD, off), 1e-6)
        for name in ("taylor", *_GAUSS, "dop853", "lsoda", "radau", "rk45")
    ),
    near(_SPHERE.format("taylor", "1e-15/error"), on(_HELD, off), 1e-15 + 17.0 * U),
    near(_SPHERE.format("taylor", "1e-15/drift"), on(_HELD, off), 1e-15 + 16.0 * U),
    near(_SPHERE.format("rk4", "steps/error"), on(_HELD, off), 27.0 * U),
    near(_SPHERE.format("rk4", "steps/drift"), on(_HELD, off), 26.0 * U),
    near(_SPHERE.format("gauss-4", "steps/drift"), on(_HELD, off), 56.0 * U),
    near(_SPHERE.format("closed-form", "1e-14/error"), on(_HELD, off), 1e-14),
    near(_SPHERE.format("auto", "1e-14/drift"), on(_HELD, off), 1e-14),
    # The rounding of A, B and C has an effect of 2.7e-12 after 1e6 s, which is the actual error
    # too.
    Slack("near-symmetry/closed-form/large-pair-long-1e-01/1e-14/error", on(_HELD, off), 4e-12,
          1e-12),
    # The finest tolerance of the ladder that LSODA can meet over 14.5 radians, amplified 18.8
    # times.
    near("near-symmetry/lsoda/small-pair-1e-01/1e-11/drift", on(_HELD, off), 1e-11),
    near("near-symmetry/lsoda/small-pair-1e-01/1e-11/error", on(_HELD, off), 18.8 * 1e-11),
    # The truncation error of a step of .002 radians, by the largest derivatives, 20 000 times.
    near("near-symmetry/improved-euler/small-pair-1e-01/steps/drift", on(_HELD, off), 1.38e-4),
    near("near-symmetry/rk4/small-pair-1e-01/steps/drift", on(_HELD, off), 1.19e-9),
    near("shapes/taylor/plate-123/1e-06/error", on(_HELD, off), 9.2e-5),
    near("shapes/quick/plate-123/1e-06/drift", on(_HELD, off), 1e-6),
    near("scales/gauss-4/1e0/1e-06/drift", on(_HELD, off), 1e-6),
    near("scales/taylor/1e0/1e-06/error", on(_HELD, off), 4.1e-4),
    exact("scales/taylor/same-2^100", on(_SCALED, bit_off, call=2), ULP),
    exact("scales/taylor/beyond", on(_SCALED, partial(ended, why="complete"))),
    # The flow of the driven body amplifies errors 4 times.
    *(
        near(f"torque/{name}/tiny-1e-12/1e-06", on(_END, off), 4e-6)
        for name in ("taylor", "auto", "prepared-auto", "quick", "gauss-4", "dop853")
    ),
    exact("torque/taylor/tiny-1e-12/1e-06", refuses(_SOLVE)),
    exact("torque/prepared-auto/tiny-1e-12/1e-06", on(_ANSWERED, partial(ended, why="gave up"))),
    exact("torque/taylor/tiny-1e-12/1e-06",
          on(_END, ended)),
    # The sphere's angle is a double-double, and the sum has 16 roundings of its terms.
    near("torque/closed-form/no-digits-1e16/1e-14", on(_END, off),
         1e-14 + 16.0 * U),
    # The phase of 1e4 radians in binary64, with 4 sqrt(n) roundings for n evaluations.
    near("torque/taylor/axial-1e4/1e-15", on(_END, off), 4.8e-10),
    # The effect of a wave of 1e16 rad/s is invisible; the limit is the tolerance, amplified twice.
    near("torque/quick/averaged-1e16/1e-06", on(_END, off), 2.03e-6),
    # 4 sqrt(n) times one rounding of a step, and n times its truncation error.
    *(
        near(f"length/{name}/tumbling/{what}/1000", watched(lambda size, time: size), due)
        for name, what, due in (
            ("taylor", "energy", 4.4e-13), ("taylor", "momentum", 2.3e-13),
            ("taylor", "phase", 9.5e-10), ("gauss-4", "energy", 4.6e-13),
            ("gauss-4", "momentum", 2.4e-13), ("gauss-4", "phase", 2.9e-7),
        )
    ),
    # The power of the growth, half way to the next power.
    *(
        Slack(f"length/{name}/tumbling/{what}/power",
              watched(lambda size, time: 1e-20 * time**size), due + 0.1, due - 0.1)
        for name, what, due in (
            ("taylor", "energy", 1.25), ("taylor", "phase", 2.25), ("gauss-4", "momentum", 0.75),
            ("gauss-4", "phase", 1.75),
        )
    ),
    *(
        near(f"length/closed-form/tumbling/{what}", watched(lambda size, time: size), due)
        # 16 roundings of omega.
        for what, due in (("energy", 6.3e-15), ("momentum", 3.5e-15), ("phase", 6.7e-15))
    ),
    exact("length/taylor/tumbling/prepared",
          beside(shorter, on(_ANSWERED, bit_off)), ULP),
    exact("invariance/taylor/signs-12/free/1e-06", on(_FREE, bit_off, call=2), ULP),
    exact("invariance/runge-kutta/cyclic/free/corrected", on(PROGRAM, bit_off, call=2), ULP),
    exact("invariance/taylor/signs-12/free/1e-06", refuses(_FREE)),
    # Either solution may have an error of the tolerance, amplified 2.7 times.
    near("invariance/taylor/cyclic/free/1e-06", on(_FREE, off, call=2), 5.4e-6),
    near("invariance/dop853/times-1.7/free/1e-06", on(_FREE, off, call=2), 5.4e-6),
    # The backward integration amplifies the error of the forward one, and adds its own.
    near("invariance/taylor/back/free/1e-06", on(_FREE, off, call=2), 8.6e-6),
    # Four pieces, each amplified by those that follow, compared with one.
    near("invariance/taylor/split/free/1e-06", on(_FREE, off, call=5), 1.8e-5),
    # 40 roundings, at any time. For the angular momentum also those of omega, 16 times the largest
    # component over the norm.
    near("attitude/closed-form/plate/1e-14/angle", on(_SOLVE, turned_off), 40.0 * U),
    near("attitude/closed-form/revolutions-1000000/tumbling/angle",
         on(_SOLVE, turned_off), 40.0 * U),
    near("attitude/closed-form/plate/1e-14/length", on(_SOLVE, LONG), 8.0 * U),
    near("attitude/closed-form/plate/1e-14/momentum", on(_SOLVE, turned_off), 78.0 * U),
    near("attitude/taylor/plate/1e-06/angle", on(_SOLVE, turned_off), 1e-6),
    near("attitude/dop853/needle/1e-06/angle", on(_SOLVE, turned_off), 1e-6),
    exact("attitude/taylor/plate/1e-06/angle", refuses(_SOLVE)),
    # 2 E T/L is 37 rad here; 8 roundings of it and of a turn are added to those of the attitude.
    near("attitude/closed-form/montgomery/random-0",
         on(_TURNING, partial(turned_off, along=True)), 3.7e-14),
    # The roundings of two attitudes.
    near("attitude/closed-form/cyclic/random-0", on(_TURNING, turned_off, call=2), 88.0 * U),
    near("attitude/closed-form/half-turn/random-0", on(_TURNING, turned_off, call=2), 88.0 * U),
    near("attitude/closed-form/space/random-0", on(_TURNING, turned_off, call=2), 88.0 * U),
    # The forward error of omega, 16 roundings that may be amplified, rotates the backward motion.
    near("attitude/closed-form/back/random-0", on(_TURNING, turned_off, call=2), 3.9e-12),
    near("attitude/angles/3-1-3/1", on("pyharness.checks.trials.attitude.angles", degrees_off),
         64.0 * U),
    near("attitude/angles/3-2-1/pole", on("pyharness.checks.trials.attitude.angles", degrees_off),
         64.0 * U),
    exact("matrices/two-term/1e-02/ier", on(f"{_MATRICES}.solved", of("ier", plus))),
    exact("matrices/two-term/1e-02/bits", linear(bit_off), ULP),
    # 3n roundings of a sum, propagated by the inverse.
    near("matrices/two-term/1e-02/residual", linear(value_off), 6.0 * U),
    near("matrices/two-term/1e-02/forward", linear(value_off), 18.0 * U),
    near("matrices/two-term/1e-02/increment", linear(value_off), 41.0 * U),
    near("matrices/four-term/1e-02/residual", linear(value_off), 12.0 * U),
    # Two sums, each with an error of n + 2 roundings.
    near("matrices/two-term/1e-02/pivots", on(f"{_MATRICES}.solved",
         lambda found, size: replace(found, pivoting=(size, found.pivoting[1]))), 16.0 * U),
    near("matrices/four-term/threshold",
         on(f"{_MATRICES}.declared_singular_below", value_off), 1.3e-14),
    exact("matrices/four-term/original/ier-1e-04", on(COMPILED, IER)),
    # Roundings of a step, amplified by the difference quotient that gives its derivative.
    *(
        near(f"regions/{program}/corrected/{check}", on(f"{_REGIONS}.{probe}", VALUE), due)
        for program, check, probe, due in (
            ("two-term", "first-step-spin-0.25", "first_step", 7.0e-14),
            ("four-term", "first-step-spin-0.25", "first_step", 9.5e-11),
            ("runge-kutta", "first-step-spin-0.25", "first_step", 4.8e-13),
            ("two-term", "10-steps-imaginary-0.5", "later_steps", 5.9e-13),
            ("runge-kutta", "10-steps-imaginary-0.5", "later_steps", 8.8e-14),
            ("two-term", "boundary-real", "observed_boundary", 1.0e-12),
            ("runge-kutta", "boundary-real", "observed_boundary", 1.1e-13),
            ("two-term", "step-10-at--2", "complex_step", 5.0e-13),
            ("four-term", "step-10-at--2", "complex_step", 3.7e-9),
            ("two-term", "step-10-case-6", "moving_step", 1.9e-13),
        )
    ),
    # Twice the local errors, propagated to the end, and in a million steps the roundings of each.
    *(
        near(f"step-size/{check}", made_by(f"{_STEPS}._error", lambda size, *_: (size, "")), due)
        for check, due in (
            ("two-term/case-5/corrected/1e-02", 9.2e-4), ("rk4/case-5/1e-02", 6.4e-8),
            ("four-term/case-5/corrected/1e-06", 6.3e-6), ("rk4/case-5/1e-06", 2.9e-10),
            # The longest step for which there is a forecast.
            ("rk4/case-4/3e-01", 0.03),
            ("two-term/case-5/corrected/1e-06", 5.8e-10),
        )
    ),
    # The limit is a quarter of a decade, since steps are half a decade apart, and the root of the
    # decade by which rounding is uncertain. The next step is beyond it.
    Slack("step-size/rk4/case-5/crossing", crossing_off, 0.3, 0.2),
    # The step at which the wobble of a spin has doubled.
    near("step-size/rk4/case-4/diverges",
         on("pyharness.checks.divergence.smallest_divergent", value_off), 0.0575),
    exact("threads/linear-solver", some_bits),
)  # fmt: skip

_OF_SCENE = "pyharness.checks.scene_trials"
_SPINNING = Scene("spin", (0.0, 0.0, 1.0), moments=(2.0, 3.0, 4.0), torque=damping(0.01))
SCENE = tuple(
    replace(each, trials=partial(scene_trials, _SPINNING, ""))
    for each in (
        # Either solution has the tolerance as its error, which the motion amplifies 1.47 times in
        # the worst direction, and the second one also the error of the first.
        near("invariance/taylor/back/1e-06", on(f"{_OF_SCENE}.solve", off), 1.81e-6),
        exact("invariance/taylor/split/1e-06", refuses(f"{_OF_SCENE}.solve")),
        exact("length/taylor/1/1e-06", refuses(_SOLVE), failing="length/taylor/1/1e-06/omega"),
        near("length/taylor/1/1e-06/omega", on(_SOLVE, off), 1e-6),
        exact(
            "threads/taylor",
            made_by(f"{_OF_SCENE}.different", lambda size, jobs, **_: jobs * int(size)),
        ),
    )
)

SLACK: Sequence[Slack] = (*VERIFY, *STRESS, *SCENE)
