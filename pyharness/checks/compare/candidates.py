"""`Candidate`, a common interface to methods, prepared solvers and programs.

A prepared solver, from `prepare`, solves one scene by one method, from many initial states.
Tolerances are relative to the largest omega; `effort` multiplies the work limit.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pyharness.engine.plan.registry import FIXED_STEP, METHODS
from pyharness.engine.prepared.solver import Solver, prepare
from pyharness.engine.solve import solve
from pyharness.model.errors import InputError
from pyharness.model.extension import COMPLETE, STOPPED, extension
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import STOP_VARIABLES, WITH_ALL_ROWS, Array, Trajectory
from pyharness.thesis.compiled import program_arguments
from pyharness.thesis.programs import BINARY64, PROGRAM_REGISTRY

_SAME = 1e-9  # relative difference up to which two times count as equal; step sizes are rounded


@dataclass(frozen=True, eq=False)
class End:
    """The state that a candidate computes at one time."""

    omega: Array  # shape (3,), rad/s; NaN if the time was not reached
    ended: str = "complete"  # "complete", or why there is no full result
    steps: int = 0  # number of steps, as the candidate counts them
    evaluations: int | None = None  # of the right-hand side, if counted
    attitude: Array | None = None  # shape (4,), scalar first, if propagated

    @property
    def is_refused(self) -> bool:
        """Return whether a prepared solver refused, or exceeded its work limit."""
        return self.ended in ("refused", "gave up")

    @property
    def has_result(self) -> bool:
        return self.ended in WITH_ALL_ROWS


@dataclass(frozen=True)
class Ready:
    """An integration to one time; `run` is timed, `read` converts its result."""

    run: Callable[[], Any]
    read: Callable[[Any], End]


@dataclass(frozen=True)
class Candidate:
    """A method with its tolerance, a prepared solver, or a program."""

    name: str
    # Returns an integration of the scene to the time (s). Raises InputError if the candidate cannot
    # solve the scene or has no result at this time (a program has results only after whole steps).
    ready: Callable[[Scene, float], Ready]
    # Returns the trajectory at the ends of the scene's steps or, for a method, at the times in an
    # optional second argument. Raises InputError for a prepared solver, which has no trajectory.
    rows: Callable[..., Trajectory]

    def end(self, scene: Scene, time: float) -> End:
        ready = self.ready(scene, time)
        return ready.read(ready.run())


def method_candidate(name: str, tolerance: float, effort: float = 1.0) -> Candidate:
    """Return a candidate that calls `solve`; `rows` has attitudes if the scene has one."""

    def rows(scene: Scene, times: Sequence[float] | None = None) -> Trajectory:
        times = scene.times() if times is None else times
        attitude = scene.attitude is not None
        return solve(scene, times, name, tolerance, effort=effort, attitude=attitude)

    def ready(scene: Scene, time: float) -> Ready:
        return Ready(partial(solve, scene, [time], name, tolerance, effort=effort), _last)

    return Candidate(name, ready, rows)


def prepared_candidate(
    name: str,
    tolerance: float | None,
    primed: bool = False,
    attitude: bool = False,
    compiled: bool = False,
) -> Candidate:
    """Return a candidate that calls a prepared solver of the method `name`.

    If `primed`, the solver is first called with another omega.
    """
    make: Any = partial(prepare, attitude=attitude, compiled=compiled)
    read = _turned if attitude else _answered

    def ready(scene: Scene, time: float) -> Ready:
        # With attitudes, the solver's third argument is the initial attitude.
        solver = make(scene, name, tolerance)
        start, turned = np.array(scene.omega), ((0.0, 0.0, 1.0, 0.0),) if attitude else ()
        if primed:
            solver(start[::-1].copy(), 0.5 * time, *turned)
        return Ready(partial(solver, start, time), partial(read, solver))

    return Candidate(name, ready, _no_rows)


def _no_rows(scene: Scene) -> Trajectory:
    raise InputError("a prepared solver returns the state at one time only; give one time")


def program_candidate(
    listing: Listing,
    implementation: str = "fortran",
    lipschitz: float = 500.0,
    may_stop: bool = True,
    velocity: bool = True,
    effort: float = 1.0,
    word: str = BINARY64,
) -> Candidate:
    """Return a candidate that runs a program; see `Program.run`."""
    options = lipschitz, may_stop, velocity

    def ready(scene: Scene, time: float) -> Ready:
        last = scene.step_size * scene.steps
        if abs(last - time) > _SAME * abs(time):
            raise InputError(
                f"{listing.program}: its last step ends at {last:g} s, not at {time:g} s; give "
                "that time, or another step size or number of steps"
            )
        if implementation != "fortran":
            return Ready(partial(rows, scene), _last)
        given = program_arguments(scene, listing, *options)
        return Ready(partial(extension().run_program, *given), _printed)

    def rows(scene: Scene) -> Trajectory:
        run = PROGRAM_REGISTRY[listing.program].run
        return run(scene, listing, implementation, *options, effort, word)

    return Candidate(f"{listing.program}-{listing.label}", ready, rows)


def unstopped(listing: Listing) -> Candidate:
    return program_candidate(listing, may_stop=False, velocity=False)


def copied_result(values: Iterable[float]) -> Array:
    """Return a copy of a compiled result, which the next call overwrites."""
    return np.array([float(x) for x in values])


def not_finite(why: str = "overflow") -> End:
    return End(np.full(3, math.nan), why)


def _last(found: Trajectory) -> End:
    omega = found.omega[-1] if len(found.omega) else not_finite().omega
    return End(omega, found.ended, found.steps, found.evaluations)


def _turned(solver: Any, found: tuple[Array, Array]) -> End:
    omega, attitude = map(copied_result, found)
    return End(omega, solver.status, solver.steps, attitude=attitude)


def _answered(solver: Solver, omega: Array) -> End:
    method = solver.plan.method
    each = METHODS[method].evaluations if method in FIXED_STEP else method.startswith("gauss-")
    # A Taylor series expands the right-hand side instead of evaluating it.
    evaluations = None if method == "taylor" else solver.steps * int(each)
    return End(copied_result(omega), solver.status, solver.steps, evaluations)


def _printed(result: Any) -> End:
    rows, _, n_rows, status, evaluations, variable, _ = result
    if status == STOPPED:
        return not_finite(f"stopped at step {n_rows} by {STOP_VARIABLES[variable - 1]}")
    if status != COMPLETE:
        return not_finite()
    return End(copied_result(rows[2:5, n_rows - 1]), "complete", n_rows, evaluations)
