"""Plants: one fault at a time, put where it would be made, to see which check catches it.

A plant is made in the running process and gone when its context ends; the compiled programs are
altered at their door, the twins in a copy of their text.
"""

import itertools
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from pyharness.methods import problem, taylor
from pyharness.methods.registry import METHODS
from pyharness.model import extension
from pyharness.model.codes import Methods, Places
from pyharness.model.listing import Listing, flagged
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.original import compiled
from pyharness.original.programs import PROGRAM_REGISTRY, Program
from pyharness.truth import reference as truth
from pyharness.verify.external_file import Problem, problems
from pyharness.verify.plants.planted_twins import plant_in_twin


@dataclass(frozen=True)
class Plant:
    """A fault.

    Attributes
    ----------
    name : str
        Short, without blanks.
    fault : str
        What is wrong, and where.
    planted : callable
        Returns the context in which it is so.
    """

    name: str
    fault: str
    planted: Callable[[], AbstractContextManager[Any]]


@contextmanager
def _twin(program: str, file: str, old: str, new: str, both: bool) -> Iterator[None]:
    with tempfile.TemporaryDirectory() as folder:
        faulty = plant_in_twin(program, file, old, new, Path(folder), both)
        with patch.dict(PROGRAM_REGISTRY, {program: faulty}):
            yield


def _compiled(change: Callable[[Trajectory], Trajectory]) -> AbstractContextManager[Any]:
    """Change what the compiled programs return."""
    run = compiled.run

    def faulty(scene: Scene, *rest: Any) -> Trajectory:
        return change(run(scene, *rest))

    return patch.object(compiled, "run", faulty)


def _compiled_scene(change: Callable[[Scene], Scene]) -> AbstractContextManager[Any]:
    """Change what the compiled programs are given; their labels stay."""
    run = compiled.run

    def faulty(scene: Scene, *rest: Any) -> Trajectory:
        found, labels = run(change(scene), *rest), run(scene, *rest)
        if found.steps != labels.steps:
            return found
        return replace(found, time=labels.time, recorded_time=labels.recorded_time)

    return patch.object(compiled, "run", faulty)


def _both(change: Callable[[Program, Scene, tuple[Any, ...]], Trajectory]) -> Any:
    """Change what a program returns in either language."""
    run = Program.run

    def faulty(self: Program, scene: Scene, *rest: Any, **named: Any) -> Trajectory:
        def again(other: Scene) -> Trajectory:
            return run(self, other, *rest, **named)

        return change(self, scene, (again,))

    return patch.object(Program, "run", faulty)


def _method(
    name: str, change: Callable[[Scene, Sequence[float], Callable[..., Trajectory]], Trajectory]
) -> AbstractContextManager[Any]:
    """Change what a method does."""
    known = METHODS[name]

    def solve(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        return change(scene, times, lambda s, t: known.solve(s, t, tolerance, effort))

    return patch.dict(METHODS, {name: replace(known, solve=solve)})


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
    """Return the result of the call before where it has as many rows."""
    before: dict[int, Trajectory] = {}

    def change(run: Trajectory) -> Trajectory:
        old = before.get(len(run.omega), run)
        before[len(run.omega)] = run
        return old

    return change


def _stale_method(name: str) -> AbstractContextManager[Any]:
    change = _stale()
    return _method(name, lambda scene, times, solve: change(solve(scene, times)))


# What the kernel of a prepared solver returns: omega, status, steps.
_Answer = tuple[Array, int, int]


def _prepared(change: Callable[[Array, _Answer], _Answer]) -> AbstractContextManager[Any]:
    """Change what the kernel of a prepared solver returns, given what was packed for it."""
    import pyharness.methods.prepared as room

    entry = extension.extension().solve_packed

    def faulty(packed: Array, *rest: Any) -> _Answer:
        return change(packed, entry(packed, *rest))

    return patch.object(room, "extension", lambda: SimpleNamespace(solve_packed=faulty))


def _stale_solver() -> AbstractContextManager[Any]:
    """Every second call of a prepared solver returns what the call before did."""
    calls = itertools.count()
    before: list[_Answer] = []

    def change(packed: Array, answer: _Answer) -> _Answer:
        if next(calls) % 2 == 0:
            before[:] = [answer]
        return before[0]

    return _prepared(change)


def _refusing_solver(code: int) -> AbstractContextManager[Any]:
    """Let a prepared solver refuse everything; `code` is one of `Methods`."""

    def change(packed: Array, answer: _Answer) -> _Answer:
        omega, _, steps = answer
        return (
            (omega * np.nan, extension.REFUSED, steps) if packed[Places.METHOD] == code else answer
        )

    return _prepared(change)


def _half_step(scene: Scene) -> Scene:
    return replace(scene, step_size=0.5 * scene.step_size)


def _half_step_both(program: Program, scene: Scene, runs: tuple[Any, ...]) -> Trajectory:
    (run,) = runs
    found: Trajectory = run(_half_step(scene))
    return replace(found, time=2.0 * found.time, recorded_time=2.0 * found.recorded_time)


def _label_both(program: Program, scene: Scene, runs: tuple[Any, ...]) -> Trajectory:
    (run,) = runs
    found: Trajectory = run(scene)
    return replace(found, time=found.time - 0.5 * scene.step_size)


def _count_both(program: Program, scene: Scene, runs: tuple[Any, ...]) -> Trajectory:
    (run,) = runs
    found: Trajectory = run(scene)
    return replace(found, evaluations=2 * found.evaluations)


def _wrong_steps() -> AbstractContextManager[Any]:
    """Let the results of the fixed-step methods and of Gauss collocation be too large."""
    from pyharness.methods.prepared import _CODES

    steps = [code for name, code in _CODES.items() if name.startswith(("gauss", "rk", "impr"))]

    def change(packed: Array, answer: _Answer) -> _Answer:
        omega, *rest = answer
        return (omega * 1.01, *rest) if packed[Places.METHOD] in steps else answer  # type: ignore[return-value]

    return _prepared(change)


def _shifted(scene: Scene, times: Sequence[float], solve: Callable[..., Trajectory]) -> Trajectory:
    """Solve half a step later: energy and momentum are conserved as they should be."""
    half = 0.5 * scene.step_size if times[-1] >= 0.0 else -0.5 * scene.step_size
    found = solve(scene, [t + half for t in times])
    time = np.array(times[: len(found.time)], dtype=float)
    return replace(found, time=time, recorded_time=time)


def _wrong_card() -> AbstractContextManager[Any]:
    """Let the compiled programs read one flag in place of its neighbour."""
    known = [entry["flag"] for entry in flagged() if entry["kind"] == "defect"]
    flags = Listing.flags.fget  # type: ignore[attr-defined]

    def wrong(self: Listing) -> int:
        bits = flags(self)
        first, second = (bits >> known[k] & 1 for k in (0, 1))
        kept = bits & ~(1 << known[0] | 1 << known[1])
        return int(kept | first << known[1] | second << known[0])

    return patch.object(Listing, "flags", property(wrong))


def _sign_in_kernels() -> AbstractContextManager[Any]:
    normalized = problem.normalized

    def faulty(scene: Scene) -> tuple[Array, ...]:
        coefficients, *rest = normalized(scene)
        return (coefficients * [1.0, 1.0, -1.0], *rest)

    return patch.object(taylor, "normalized", faulty)


def _sign_in_reference() -> AbstractContextManager[Any]:
    coefficients = truth.exact_coefficients

    def faulty(scene: Scene) -> Any:
        a, b, c = coefficients(scene)
        return [a, b, -c]

    return patch.object(truth, "exact_coefficients", faulty)


def _digit() -> AbstractContextManager[Any]:
    """Change the last but one digit of a published figure."""

    def altered() -> list[Problem]:
        found = []
        for known in problems():
            value = known.values[0]
            figure = next(each for each in value.omega if each is not None)
            wrong = replace(figure, value=figure.value + Decimal(20.0 * figure.accuracy))
            omega = tuple(wrong if each is figure else each for each in value.omega)
            values = (replace(value, omega=omega), *known.values[1:])
            found.append(replace(known, values=values))
        return found

    return patch("pyharness.verify.kinds.problems", altered)


_COEFFICIENT = ("runge_kutta.py", "r2 + b * u[2]", "r2 + 1.000000001 * b * u[2]")
_STAGE = ("runge_kutta.py", "_distances(slope[4], slope[1])", "_distances(slope[3], slope[1])")
_SIGN = ("equations.py", "m[2] + c * u[0]", "m[2] - c * u[0]")

PLANTS = (
    Plant(
        "sign-in-twin",
        "a sign in the third equation of a twin",
        lambda: _twin("four-term", *_SIGN, both=False),
    ),
    Plant(
        "sign-in-both",
        "a sign in the third equation, in both languages alike",
        lambda: _twin("two-term", *_SIGN, both=True),
    ),
    Plant("sign-in-series", "a sign in what the Taylor kernel is given", _sign_in_kernels),
    Plant("sign-in-reference", "a sign in the reference itself", _sign_in_reference),
    Plant("axis-in-fortran", "two axes of the compiled programs change places",
          lambda: _compiled(_swapped)),
    Plant("axis-in-method", "two axes of the closed form change places",
          lambda: _method("closed-form", lambda scene, times, solve:
                          _swapped(solve(scene, times)))),
    Plant("wrong-card", "the compiled programs correct another card than the one named",
          _wrong_card),
    Plant("half-step-in-fortran", "the compiled programs take half a step",
          lambda: _compiled_scene(_half_step)),
    Plant("half-step-in-both", "half a step in both languages, labelled as a whole one",
          lambda: _both(_half_step_both)),
    Plant("ulp-in-fortran", "one unit in the last place of one result",
          lambda: _compiled(_one_ulp)),
    Plant("velocity-in-fortran", "a sign in the velocity", lambda: _compiled(_velocity_sign)),
    Plant("velocity-in-both", "a sign in the velocity, in both languages alike",
          lambda: _both(lambda program, scene, runs: _velocity_sign(runs[0](scene)))),
    Plant("coefficient-in-both", "a coefficient off by a part in 1e9, in both languages alike",
          lambda: _twin("runge-kutta", *_COEFFICIENT, both=True)),
    Plant("stop-in-both", "the stop test looks at another stage, in both languages alike",
          lambda: _twin("runge-kutta", *_STAGE, both=True)),
    Plant("stale-fortran", "the result of the run before", lambda: _compiled(_stale())),
    Plant("stale-method", "the Taylor method answers with the result before",
          lambda: _stale_method("taylor")),
    Plant("stale-solver", "a prepared solver answers with the result before", _stale_solver),
    Plant("quick-refuses", "the solver for few digits refuses every scene",
          lambda: _refusing_solver(Methods.QUICK)),
    Plant("label-in-fortran", "TIME shifted by half a step",
          lambda: _compiled(_half_step_label)),
    Plant("label-in-both", "the time of every row shifted by half a step, in both languages",
          lambda: _both(_label_both)),
    Plant("label-of-method", "a motion half a step late, energy and momentum conserved",
          lambda: _method("closed-form", _shifted)),
    Plant("count-in-fortran", "one right-hand side too many in the count",
          lambda: _compiled(lambda run: replace(run, evaluations=run.evaluations + 1))),
    Plant("count-in-both", "the count of right-hand sides, in both languages alike",
          lambda: _both(_count_both)),
    Plant("prepared-steps", "prepared solvers in fixed steps are wrong by a hundredth",
          _wrong_steps),
    Plant("digit-of-the-print", "a digit of a published figure", _digit),
    Plant("scipy", "another SciPy, whose results are wrong in the fourth digit",
          lambda: _method("dop853", lambda scene, times, solve:
                          replace(run := solve(scene, times), omega=run.omega * 1.0001))),
)  # fmt: skip
