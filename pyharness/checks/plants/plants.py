"""Planted faults, which test what each kind of checks detects."""

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from pyharness.checks.check import Selection
from pyharness.checks.external_file import Problem
from pyharness.checks.kinds import verify
from pyharness.checks.plants.faults import (
    Change,
    Fault,
    change_attribute,
    change_result,
    changing,
    in_method,
    instead,
    twin,
)
from pyharness.checks.plants.outcome import Outcome, control
from pyharness.engine.plan.registry import FIXED_STEP, GAUSS
from pyharness.engine.prepared.solver import CODES as _CODES
from pyharness.model import extension
from pyharness.model.codes import Methods, Places
from pyharness.model.listing import Listing, flagged
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.thesis.programs import Program

_COMPILED = "pyharness.thesis.compiled.run"
_PROGRAM = "pyharness.thesis.programs.Program.run"  # in either language


@dataclass(frozen=True)
class Plant:
    """A planted fault, its size, and the kinds of checks that can detect it."""

    name: str
    fault: str
    planted: Fault
    size: float
    kinds: tuple[str, ...]


def _plus(found: Any, size: float) -> Any:
    return found + (int(size) if isinstance(found, int) else size)


def _off(found: Array, size: float) -> Array:
    return np.asarray(found + size * np.abs(found).max(initial=0.0) * np.sign(found))


def _bit_off(found: Array, size: float) -> Array:
    wrong = found.copy()
    wrong[np.unravel_index(np.abs(found).argmax(), found.shape)] *= 1.0 + size
    return wrong


def _third_off(found: Array, size: float) -> Array:
    return np.asarray(found * [1.0, 1.0, 1.0 - size])


def _swapped(found: Array, size: float) -> Array:
    return found[:, [1, 0, 2]] if size else found


def _stale() -> Change:
    """Return a change that replaces a trajectory by the previous one of equal length."""
    before: dict[int, Trajectory] = {}

    def change(run: Trajectory, size: float) -> Trajectory:
        old = before.get(len(run.omega), run) if size else run
        before[len(run.omega)] = run
        return old

    return change


# Results of a prepared solver's kernel: omega, status, number of steps, and an array with the
# estimated error and the error amplification.
_Answer = tuple[Array, int, int, Array]


def _prepared(change: Callable[[Array, _Answer, float], _Answer]) -> Fault:
    """Return a fault that changes prepared results to ``change(packed, result, size)``."""

    def planted(size: float) -> AbstractContextManager[Any]:
        entry = extension.extension().solve_packed

        def solve_packed(packed: Array, *rest: Any) -> _Answer:
            return change(packed, entry(packed, *rest), size)

        kernel = SimpleNamespace(solve_packed=solve_packed)
        return patch("pyharness.engine.prepared.solver.extension", lambda: kernel)

    return planted


def _stale_solver(size: float) -> AbstractContextManager[Any]:
    """Return a context in which every second call of prepared solvers repeats the result before."""
    calls = itertools.count()
    before: list[_Answer] = []

    def change(packed: Array, answer: _Answer, size: float) -> _Answer:
        if not size or next(calls) % 2 == 0:
            before[:] = [answer]
        return before[0]

    return _prepared(change)(size)


def _refuses(packed: Array, answer: _Answer, size: float) -> _Answer:
    omega, _, steps, found = answer
    refused = omega * np.nan, extension.REFUSED, steps, found
    return refused if size and packed[Places.METHOD] == Methods.QUICK else answer


_FIXED = [_CODES[name] for name in (*GAUSS, *FIXED_STEP)]


def _too_large(packed: Array, answer: _Answer, size: float) -> _Answer:
    omega, status, steps, found = answer
    wrong = omega * (1.0 + size)
    return (wrong if packed[Places.METHOD] in _FIXED else omega, status, steps, found)


_Run = Callable[..., Trajectory]


def _shorter_compiled(size: float, run: _Run, scene: Scene, *rest: Any) -> Trajectory:
    """Return a compiled run with a smaller step size but the original times."""
    shorter = replace(scene, step_size=(1.0 - size) * scene.step_size)
    found, labels = run(shorter, *rest), run(scene, *rest)
    if found.steps != labels.steps:
        return found
    return replace(found, time=labels.time, recorded_time=labels.recorded_time)


def _shorter_both(
    size: float, run: _Run, program: Program, scene: Scene, *rest: Any, **named: Any
) -> Trajectory:
    part = 1.0 - size
    found = run(program, replace(scene, step_size=part * scene.step_size), *rest, **named)
    return replace(found, time=found.time / part, recorded_time=found.recorded_time / part)


def _label_both(
    size: float, run: _Run, program: Program, scene: Scene, *rest: Any, **named: Any
) -> Trajectory:
    found = run(program, scene, *rest, **named)
    return replace(found, time=found.time - size * scene.step_size)


def _shifted(
    size: float, solve: _Run, scene: Scene, times: Sequence[float], *rest: float
) -> Trajectory:
    late = size * scene.step_size if times[-1] >= 0.0 else -size * scene.step_size
    found = solve(scene, [t + late for t in times], *rest)
    time = np.array(times[: len(found.time)], dtype=float)
    return replace(found, time=time, recorded_time=time)


def _wrong_card(size: float) -> AbstractContextManager[Any]:
    """Return a context where compiled programs get two flags exchanged, unless `size` is 0."""
    known = [entry["flag"] for entry in flagged() if entry["kind"] != "reading"]
    flags = Listing.flags.fget  # type: ignore[attr-defined]

    def wrong(self: Listing) -> int:
        bits = flags(self)
        first, second = (bits >> known[k] & 1 for k in (0, 1))
        kept = bits & ~(1 << known[0] | 1 << known[1])
        return int(kept | first << known[1] | second << known[0])

    return patch.object(Listing, "flags", property(wrong)) if size else nullcontext()


def _digit_altered(known: Problem, size: float) -> Problem:
    """Return a problem whose first published number is wrong by `size` times its accuracy."""
    value = known.values[0]
    figure = next((each for each in value.omega if each is not None), None)
    if figure is None:
        return known
    wrong = replace(figure, value=figure.value + Decimal(size * figure.accuracy))
    omega = tuple(wrong if each is figure else each for each in value.omega)
    return replace(known, values=(replace(value, omega=omega), *known.values[1:]))


_VELOCITY, _COUNT = change_attribute("velocity", _third_off), change_attribute("evaluations", _plus)

PLANTS = (
    Plant("sign-in-twin", "a sign in the third equation of a twin",
          twin("four-term", "sign", both=False), 2.0, ("cells", "words")),
    Plant("sign-in-both", "a sign in the third equation, in both languages alike",
          twin("two-term", "sign"), 2.0, ("decks", "schemes")),
    Plant("sign-in-series", "a sign in what the Taylor kernel is given",
          change_result("pyharness.engine.methods.taylor.normalized",
             lambda found, size: (_third_off(found[0], size), *found[1:])),
          2.0, ("methods", "attitudes")),
    Plant("sign-in-reference", "a sign in the reference itself",
          change_result("pyharness.truth.reference.exact_coefficients",
             lambda found, size: [found[0], found[1], (1 - int(size)) * found[2]]),
          2.0, ("methods", "prepared")),
    Plant("axis-in-fortran", "two axes of the compiled programs change places",
          change_result(_COMPILED, change_attribute("omega", _swapped)), 1.0, ("cells", "decks")),
    Plant("axis-in-method", "two axes of the closed form change places",
          in_method("closed-form", changing(change_attribute("omega", _swapped))),
          1.0, ("methods",)),
    Plant("wrong-card", "the compiled programs correct another card than the one named",
          _wrong_card, 1.0, ("cells", "words")),
    Plant("half-step-in-fortran", "the compiled programs take half a step",
          instead(_COMPILED, _shorter_compiled), 0.5, ("decks", "schemes")),
    Plant("half-step-in-both", "half a step in both languages, labelled as a whole one",
          instead(_PROGRAM, _shorter_both), 0.5, ("schemes", "stops")),
    Plant("ulp-in-fortran", "one unit in the last place of one result",
          change_result(_COMPILED, change_attribute("omega", _bit_off)), 2.0**-52, ("cells",)),
    Plant("velocity-in-fortran", "a sign in the velocity",
          change_result(_COMPILED, _VELOCITY), 2.0, ("decks", "schemes")),
    Plant("velocity-in-both", "a sign in the velocity, in both languages alike",
          change_result(_PROGRAM, _VELOCITY), 2.0, ("schemes", "stops")),
    Plant("coefficient-in-both", "a coefficient off by a part in 1e9, in both languages alike",
          twin("runge-kutta", "coefficient b"), 1e-9, ("schemes", "orders")),
    Plant("stop-in-both", "the stop test looks at another stage, in both languages alike",
          twin("runge-kutta", "stage of the stop test"), 1.0, ("stops",)),
    Plant("stale-fortran", "the result of the run before",
          lambda size: change_result(_COMPILED, _stale())(size), 1.0, ("stops", "cells")),
    Plant("stale-method", "the Taylor method answers with the result before",
          lambda size: in_method("taylor", changing(_stale()))(size), 1.0, ("methods", "random")),
    Plant("stale-solver", "a prepared solver answers with the result before", _stale_solver,
          1.0, ("prepared", "random")),
    Plant("quick-refuses", "the solver for few digits refuses every scene",
          _prepared(_refuses), 1.0, ("prepared",)),
    Plant("label-in-fortran", "TIME shifted by half a step",
          change_result(_COMPILED, change_attribute(
              "recorded_time", lambda time, size: time - size * time[:1])),
          0.5, ("cells", "decks")),
    Plant("label-in-both", "the time of every row shifted by half a step, in both languages",
          instead(_PROGRAM, _label_both), 0.5, ("cells", "words")),
    Plant("label-of-method", "a motion half a step late, energy and momentum conserved",
          in_method("closed-form", _shifted), 0.5, ("methods", "attitudes")),
    Plant("count-in-fortran", "one right-hand side too many in the count",
          change_result(_COMPILED, _COUNT), 1.0, ("cells",)),
    Plant("count-in-both", "the count of right-hand sides, in both languages alike",
          change_result(_PROGRAM, _COUNT), 1.0, ("cells", "words")),
    Plant("prepared-steps", "prepared solvers in fixed steps are wrong by a hundredth",
          _prepared(_too_large), 1e-2, ("prepared",)),
    Plant("digit-of-the-print", "a digit of a published figure",
          change_result("pyharness.checks.kinds.problems",
             lambda found, size: [_digit_altered(each, size) for each in found]),
          20.0, ("external",)),
    Plant("scipy", "another SciPy, whose results are wrong in the fourth digit",
          in_method("dop853", changing(change_attribute("omega", _off))),
          1e-4, ("methods", "orders")),
)  # fmt: skip


# The golden record cannot distinguish a fault from an intended change.
_NOT_ENOUGH = "golden"
_DRAWS = 12


def self_test(seed: str, record: Path) -> Iterator[Outcome]:
    chosen = Selection(seed=seed, draws=_DRAWS, record=record, thin=True)
    failed, note = _failed(chosen)
    yield control(failed.total(), note)
    for plant in PLANTS:
        yield outcome(plant, chosen)


def outcome(plant: Plant, chosen: Selection) -> Outcome:
    """Return the outcome of a fault, which must fail a check other than the golden record's."""
    with plant.planted(plant.size):
        failed, note = _failed(replace(chosen, only=plant.kinds))
    noticed = failed.total() - failed[_NOT_ENOUGH]
    return Outcome(plant.name, plant.fault, noticed > 0, noticed, note)


def _failed(chosen: Selection) -> tuple[Counter[str], str]:
    names = [check.id for check in verify(chosen) if not check.passed]
    failed = Counter(name.partition("/")[0] for name in names)
    example = min(names, key=lambda name: name.startswith(_NOT_ENOUGH), default="")
    counts = ", ".join(f"{kind} {count}" for kind, count in failed.items())
    return failed, f"caught by {counts} ({example})" if failed else "nothing fails"
