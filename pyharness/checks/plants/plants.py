"""Planted faults: one fault at a time, planted to test which check detects it.

A fault is planted in the running process and removed when its context ends. The compiled programs
are altered at their entry point, and the Python twins in a copy of their source.
"""

import itertools
import pkgutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from pyharness.checks.external_file import Problem
from pyharness.checks.plants.planted_twins import plant_in_twin
from pyharness.methods.registry import METHODS
from pyharness.methods.solver import CODES as _CODES
from pyharness.model import extension
from pyharness.model.codes import Methods, Places
from pyharness.model.listing import Listing, flagged
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.original.programs import PROGRAM_REGISTRY, Program

_COMPILED = "pyharness.original.compiled.run"
_BOTH = "pyharness.original.programs.Program.run"  # in either language


@dataclass(frozen=True)
class Plant:
    """A fault that is planted to test the checks: its name, its description, and how to plant it.

    `planted` returns a context manager within which the fault is present. `kinds` are the kinds of
    checks that can detect the fault, besides the comparison with stored results. The self-test runs
    these kinds.
    """

    name: str
    fault: str
    planted: Callable[[], AbstractContextManager[Any]]
    kinds: tuple[str, ...]


def instead(target: str, faulty: Callable[..., Any]) -> AbstractContextManager[Any]:
    """Return a context manager that replaces the function with the dotted name `target`.

    A call then becomes ``faulty(right, ...)``, where `right` is the original function.
    """
    right = pkgutil.resolve_name(target)
    return patch(target, lambda *rest, **named: faulty(right, *rest, **named))


def changed(target: str, change: Callable[[Any], Any]) -> AbstractContextManager[Any]:
    """Return a context manager that applies `change` to every result of a function.

    `target` is the dotted name of the function.
    """
    return instead(target, lambda right, *rest, **named: change(right(*rest, **named)))


@contextmanager
def _twin(program: str, file: str, old: str, new: str, both: bool) -> Iterator[None]:
    with tempfile.TemporaryDirectory() as folder:
        faulty = plant_in_twin(program, file, old, new, Path(folder), both)
        with patch.dict(PROGRAM_REGISTRY, {program: faulty}):
            yield


def _method(name: str, faulty: Callable[..., Trajectory]) -> AbstractContextManager[Any]:
    """Return a context manager that replaces the function `solve` of the method named `name`.

    A call then becomes ``faulty(right, scene, times, ...)``, where `right` is the original
    function.
    """
    known = METHODS[name]
    return patch.dict(METHODS, {name: replace(known, solve=partial(faulty, known.solve))})


def _method_changed(
    name: str, change: Callable[[Trajectory], Trajectory]
) -> AbstractContextManager[Any]:
    return _method(name, lambda right, *rest, **named: change(right(*rest, **named)))


def _swapped(run: Trajectory) -> Trajectory:
    return replace(run, omega=run.omega[:, [1, 0, 2]])


def _one_ulp(run: Trajectory) -> Trajectory:
    if len(run.omega) < 20:
        return run
    omega = run.omega.copy()
    omega[17, 1] = np.nextafter(omega[17, 1], np.inf)
    return replace(run, omega=omega)


def _velocity_sign(run: Trajectory) -> Trajectory:
    return run if run.velocity is None else replace(run, velocity=run.velocity * [1.0, 1.0, -1.0])


def _half_step_label(run: Trajectory) -> Trajectory:
    n = len(run.recorded_time)
    half = 0.5 * float(run.recorded_time[0]) if n else 0.0
    return replace(run, recorded_time=run.recorded_time - half)


def _stale() -> Callable[[Trajectory], Trajectory]:
    """Return a function that replaces a run's trajectory by that of an earlier run.

    This is a planted fault. The function takes a trajectory, and returns the trajectory of the last
    run before it with as many rows. The first trajectory of each number of rows is returned
    unchanged.
    """
    before: dict[int, Trajectory] = {}

    def change(run: Trajectory) -> Trajectory:
        old = before.get(len(run.omega), run)
        before[len(run.omega)] = run
        return old

    return change


# Results of the kernel of a prepared solver: omega, status, number of steps, and an array with the
# estimated error and the error amplification.
_Answer = tuple[Array, int, int, Array]


def _prepared(change: Callable[[Array, _Answer], _Answer]) -> AbstractContextManager[Any]:
    """Return a context manager that changes the results of the compiled kernel of prepared solvers.

    Each result becomes ``change(packed, result)``, where `packed` is the input of the kernel. A
    prepared solver is one that `prepare` has set up for one scene.
    """
    entry = extension.extension().solve_packed
    kernel = SimpleNamespace(
        solve_packed=lambda packed, *rest: change(packed, entry(packed, *rest))
    )
    return patch("pyharness.methods.solver.extension", lambda: kernel)


def _stale_solver() -> AbstractContextManager[Any]:
    """Return a context manager by which prepared solvers give a stale result in every second call.

    The stale result is the result of the call before. This is a planted fault, which checks must
    detect. A prepared solver is one that `prepare` has set up for one scene.
    """
    calls = itertools.count()
    before: list[_Answer] = []

    def change(packed: Array, answer: _Answer) -> _Answer:
        if next(calls) % 2 == 0:
            before[:] = [answer]
        return before[0]

    return _prepared(change)


def _refuses(packed: Array, answer: _Answer) -> _Answer:
    omega, _, steps, found = answer
    refused = omega * np.nan, extension.REFUSED, steps, found
    return refused if packed[Places.METHOD] == Methods.QUICK else answer


_FIXED = [code for name, code in _CODES.items() if name.startswith(("gauss", "rk", "impr"))]


def _too_large(packed: Array, answer: _Answer) -> _Answer:
    """Return the results of a prepared solver's kernel, with omega 1 % too large for some methods.

    These are the methods with a fixed step and Gauss collocation. `packed` is the input of the
    kernel, which contains the method. A prepared solver is one that `prepare` has set up for one
    scene. This is a planted fault, which checks must detect.
    """
    omega, status, steps, found = answer
    return (omega * 1.01 if packed[Places.METHOD] in _FIXED else omega, status, steps, found)


def _half_step(scene: Scene) -> Scene:
    return replace(scene, step_size=0.5 * scene.step_size)


def _half_step_compiled(run: Callable[..., Trajectory], scene: Scene, *rest: Any) -> Trajectory:
    """Call `run`, a compiled program, with half the step size, but return the times of whole steps.

    This is a planted fault. The rows of the result have the omegas after half steps and the times
    of whole steps.
    """
    found, labels = run(_half_step(scene), *rest), run(scene, *rest)
    if found.steps != labels.steps:
        return found
    return replace(found, time=labels.time, recorded_time=labels.recorded_time)


def _half_step_both(
    run: Callable[..., Trajectory], program: Program, scene: Scene, *rest: Any, **named: Any
) -> Trajectory:
    found = run(program, _half_step(scene), *rest, **named)
    return replace(found, time=2.0 * found.time, recorded_time=2.0 * found.recorded_time)


def _label_both(
    run: Callable[..., Trajectory], program: Program, scene: Scene, *rest: Any, **named: Any
) -> Trajectory:
    found = run(program, scene, *rest, **named)
    return replace(found, time=found.time - 0.5 * scene.step_size)


def _shifted(
    solve: Callable[..., Trajectory], scene: Scene, times: Sequence[float], *rest: float
) -> Trajectory:
    """Call `solve` for times that are half a step late, and label the results with `times` (s).

    This is a planted fault. The results still conserve energy and momentum, so that only a
    comparison with the true solution detects it.
    """
    half = 0.5 * scene.step_size if times[-1] >= 0.0 else -0.5 * scene.step_size
    found = solve(scene, [t + half for t in times], *rest)
    time = np.array(times[: len(found.time)], dtype=float)
    return replace(found, time=time, recorded_time=time)


def _wrong_card() -> AbstractContextManager[Any]:
    """Return a context manager that exchanges the flags of two defects in the compiled programs.

    This is a planted fault, which checks must detect. A flag tells a compiled program whether to
    correct a defect. If only one of the two defects is to be corrected, the programs then correct
    the card (source line) with the other defect.
    """
    known = [entry["flag"] for entry in flagged() if entry["kind"] != "reading"]
    flags = Listing.flags.fget  # type: ignore[attr-defined]

    def wrong(self: Listing) -> int:
        bits = flags(self)
        first, second = (bits >> known[k] & 1 for k in (0, 1))
        kept = bits & ~(1 << known[0] | 1 << known[1])
        return int(kept | first << known[1] | second << known[0])

    return patch.object(Listing, "flags", property(wrong))


def _digit_altered(known: Problem) -> Problem:
    """Return a published problem with the last but one digit of its first number changed.

    This is a planted fault, which the checks against published results must detect.
    """
    value = known.values[0]
    figure = next(each for each in value.omega if each is not None)
    wrong = replace(figure, value=figure.value + Decimal(20.0 * figure.accuracy))
    omega = tuple(wrong if each is figure else each for each in value.omega)
    return replace(known, values=(replace(value, omega=omega), *known.values[1:]))


_COEFFICIENT = ("runge_kutta.py", "r2 + b * u[2]", "r2 + 1.000000001 * b * u[2]")
_STAGE = ("runge_kutta.py", "_distances(slope[4], slope[1])", "_distances(slope[3], slope[1])")
_SIGN = ("equations.py", "m[2] + c * u[0]", "m[2] - c * u[0]")

PLANTS = (
    Plant("sign-in-twin", "a sign in the third equation of a twin",
          lambda: _twin("four-term", *_SIGN, both=False),
          ("cells", "words")),
    Plant("sign-in-both", "a sign in the third equation, in both languages alike",
          lambda: _twin("two-term", *_SIGN, both=True),
          ("decks", "schemes")),
    Plant("sign-in-series", "a sign in what the Taylor kernel is given",
          lambda: changed("pyharness.methods.taylor.series_kernel",
                          lambda found: (found[0],
                                         (found[1][0] * [1.0, 1.0, -1.0], *found[1][1:]))),
          ("methods", "attitudes")),
    Plant("sign-in-reference", "a sign in the reference itself",
          lambda: changed("pyharness.truth.reference.exact_coefficients",
                          lambda found: [found[0], found[1], -found[2]]),
          ("methods", "prepared")),
    Plant("axis-in-fortran", "two axes of the compiled programs change places",
          lambda: changed(_COMPILED, _swapped),
          ("cells", "decks")),
    Plant("axis-in-method", "two axes of the closed form change places",
          lambda: _method_changed("closed-form", _swapped),
          ("methods",)),
    Plant("wrong-card", "the compiled programs correct another card than the one named",
          _wrong_card,
          ("cells", "words")),
    Plant("half-step-in-fortran", "the compiled programs take half a step",
          lambda: instead(_COMPILED, _half_step_compiled),
          ("decks", "schemes")),
    Plant("half-step-in-both", "half a step in both languages, labelled as a whole one",
          lambda: instead(_BOTH, _half_step_both),
          ("schemes", "stops")),
    Plant("ulp-in-fortran", "one unit in the last place of one result",
          lambda: changed(_COMPILED, _one_ulp),
          ("cells",)),
    Plant("velocity-in-fortran", "a sign in the velocity",
          lambda: changed(_COMPILED, _velocity_sign),
          ("decks", "schemes")),
    Plant("velocity-in-both", "a sign in the velocity, in both languages alike",
          lambda: changed(_BOTH, _velocity_sign),
          ("schemes", "stops")),
    Plant("coefficient-in-both", "a coefficient off by a part in 1e9, in both languages alike",
          lambda: _twin("runge-kutta", *_COEFFICIENT, both=True),
          ("schemes", "orders")),
    Plant("stop-in-both", "the stop test looks at another stage, in both languages alike",
          lambda: _twin("runge-kutta", *_STAGE, both=True),
          ("stops",)),
    Plant("stale-fortran", "the result of the run before", lambda: changed(_COMPILED, _stale()),
          ("stops", "cells")),
    Plant("stale-method", "the Taylor method answers with the result before",
          lambda: _method_changed("taylor", _stale()),
          ("methods", "random")),
    Plant("stale-solver", "a prepared solver answers with the result before", _stale_solver,
          ("prepared", "random")),
    Plant("quick-refuses", "the solver for few digits refuses every scene",
          lambda: _prepared(_refuses),
          ("prepared",)),
    Plant("label-in-fortran", "TIME shifted by half a step",
          lambda: changed(_COMPILED, _half_step_label),
          ("cells", "decks")),
    Plant("label-in-both", "the time of every row shifted by half a step, in both languages",
          lambda: instead(_BOTH, _label_both),
          ("cells", "words")),
    Plant("label-of-method", "a motion half a step late, energy and momentum conserved",
          lambda: _method("closed-form", _shifted),
          ("methods", "attitudes")),
    Plant("count-in-fortran", "one right-hand side too many in the count",
          lambda: changed(_COMPILED, lambda run: replace(run, evaluations=run.evaluations + 1)),
          ("cells",)),
    Plant("count-in-both", "the count of right-hand sides, in both languages alike",
          lambda: changed(_BOTH, lambda run: replace(run, evaluations=2 * run.evaluations)),
          ("cells", "words")),
    Plant("prepared-steps", "prepared solvers in fixed steps are wrong by a hundredth",
          lambda: _prepared(_too_large),
          ("prepared",)),
    Plant("digit-of-the-print", "a digit of a published figure",
          lambda: changed("pyharness.checks.kinds.problems",
                          lambda found: list(map(_digit_altered, found))),
          ("external",)),
    Plant("scipy", "another SciPy, whose results are wrong in the fourth digit",
          lambda: _method_changed("dop853", lambda run: replace(run, omega=run.omega * 1.0001)),
          ("methods", "orders")),
)  # fmt: skip
