"""Candidates, a common interface of methods, prepared solvers and programs.

Checks and timings run a candidate on a scene in the same way, whichever of the three it is. A
prepared solver solves one scene by one method, for many initial conditions.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pyharness.methods.prepared import prepare
from pyharness.methods.registry import FIXED_STEP, METHODS
from pyharness.methods.solve import solve
from pyharness.methods.solver import Solver
from pyharness.model.errors import InputError
from pyharness.model.extension import COMPLETE, STOPPED, extension
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import STOP_VARIABLES, WITH_ALL_ROWS, Array, Trajectory
from pyharness.original.compiled import program_arguments
from pyharness.original.programs import BINARY64, PROGRAM_REGISTRY

_SAME = 1e-9  # relative difference up to which two times are equal; the step size is rounded


@dataclass(frozen=True, eq=False)
class End:
    """The result at one time when a method, prepared solver or program has solved a scene.

    A prepared solver is made by `prepare` for a single scene.
    """

    omega: Array  # shape (3,), rad/s; NaN if the candidate did not reach the time
    ended: str = "complete"  # how the run ended: "complete", or why there is no full result
    steps: int = 0  # number of steps, as the candidate counts them
    evaluations: int | None = None  # evaluations of the right-hand side, if they are counted
    attitude: Array | None = None  # shape (4,), scalar first, if it was propagated

    @property
    def is_refused(self) -> bool:
        """Return whether a prepared solver can't solve the scene, or exceeded its work limit.

        A prepared solver is made by `prepare` for a single scene.
        """
        return self.ended in ("refused", "gave up")

    @property
    def has_result(self) -> bool:
        """Return whether the method, prepared solver or program reached the requested time.

        A prepared solver is made by `prepare` for a single scene. The result may nevertheless be
        "sensitive": its amplified rounding error is too large for the relative tolerance.
        """
        return self.ended in WITH_ALL_ROWS


@dataclass(frozen=True)
class Ready:
    """An integration from time 0 to one time, in two parts of which only the first is timed.

    `run` is the function to time, which integrates without any preparation. `read` converts the
    result of `run` to an End.
    """

    run: Callable[[], Any]
    read: Callable[[Any], End]


@dataclass(frozen=True)
class Candidate:
    """A method with its tolerance, a prepared solver, or a program, as one common interface.

    The prepared solver is one that `prepare` makes for a single scene. The program is one of the
    thesis, with a choice of its defects. Checks and timings run all three kinds of candidates by
    the same functions.
    """

    name: str
    # Takes a scene and a time (s). Raises InputError if the candidate can't solve the scene, or has
    # no result at the time, like a program whose steps end at another time.
    ready: Callable[[Scene, float], Ready]
    # Takes a scene, and returns its trajectory at the times of its steps. A method takes other
    # times as an optional second argument. A prepared solver has no rows and raises InputError.
    rows: Callable[..., Trajectory]

    def end(self, scene: Scene, time: float) -> End:
        """Return the result at one `time` (s); raise InputError if the candidate has none.

        The candidate is a method, a solver prepared for one scene by `prepare`, or a program.
        """
        ready = self.ready(scene, time)
        return ready.read(ready.run())


def method_candidate(name: str, tolerance: float, effort: float = 1.0) -> Candidate:
    """Return a `Candidate` (common interface of solvers) that runs a method by `solve`.

    `name` is the name of the method. `tolerance` is relative to the largest component of omega, and
    `effort` is the factor by which the work limit of the method is multiplied. The candidate's rows
    include the attitude if the scene has one.
    """

    def rows(scene: Scene, times: Sequence[float] | None = None) -> Trajectory:
        times = scene.times() if times is None else times
        attitude = scene.attitude is not None
        return solve(scene, times, name, tolerance, effort=effort, attitude=attitude)

    def ready(scene: Scene, time: float) -> Ready:
        return Ready(partial(solve, scene, [time], name, tolerance, effort=effort), _last)

    return Candidate(name, ready, rows)


def prepared_candidate(name: str, tolerance: float | None, primed: bool = False) -> Candidate:
    """Return a `Candidate` (common interface of solvers) that runs a solver made by `prepare`.

    The solver is prepared for a single scene and the method `name`. If `primed` is true, the solver
    is first called with another initial omega. This call must have no effect on the result.
    `tolerance` is relative to the largest component of omega; None selects the default of the
    method. A method with a fixed step, and Gauss collocation, use the scene's step size.
    """

    def ready(scene: Scene, time: float) -> Ready:
        solver, start = prepare(scene, name, tolerance), np.array(scene.omega)
        if primed:
            solver(start[::-1].copy(), 0.5 * time)
        return Ready(partial(solver, start, time), partial(_answered, solver))

    return Candidate(name, ready, _no_rows)


def attitude_candidate(name: str, tolerance: float | None, primed: bool = False) -> Candidate:
    """Return a `Candidate` (common interface) that runs a prepared solver for omega and attitude.

    A solver that `prepare` makes for a single scene is called a prepared solver. The arguments have
    the same meanings as those of `prepared_candidate`.
    """

    def ready(scene: Scene, time: float) -> Ready:
        solver, start = prepare(scene, name, tolerance, attitude=True), np.array(scene.omega)
        if primed:
            solver(start[::-1].copy(), 0.5 * time, (0.0, 0.0, 1.0, 0.0))

        def read(found: tuple[Array, Array]) -> End:
            omega, attitude = found
            return End(plain(omega), solver.status, solver.steps, attitude=plain(attitude))

        return Ready(partial(solver, start, time), read)

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
    """Return a `Candidate` (common interface of solvers) that runs a program of the thesis.

    `listing` is the program with those of its defects that are not corrected. The other arguments
    are those of `Program.run`.
    """
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
    """Return a `Candidate` that runs a compiled program of the thesis without its stop test.

    A `Candidate` is a common interface of solvers. `listing` is the program with those of its
    defects that are not corrected. The program does not compute the translational velocity.
    """
    return program_candidate(listing, may_stop=False, velocity=False)


def plain(values: Iterable[float]) -> Array:
    """Return a copy of `values`, a result of a compiled function, as an array of floats.

    The copy is needed because the next call of the function reuses the memory of its result.
    """
    return np.array([float(x) for x in values])


def not_finite(why: str = "overflow") -> End:
    """Return an `End` (result at one time) with omega NaN, for a run without result.

    `why` says how the run ended.
    """
    return End(np.full(3, math.nan), why)


def _last(found: Trajectory) -> End:
    omega = found.omega[-1] if len(found.omega) else not_finite().omega
    return End(omega, found.ended, found.steps, found.evaluations)


def _answered(solver: Solver, omega: Array) -> End:
    method, counted = solver.plan.method, 0
    if method in FIXED_STEP:
        counted = solver.steps * METHODS[method].evaluations
    elif method.startswith("gauss-"):
        counted = solver.steps
    # A Taylor series expands the right-hand side and does not evaluate it.
    return End(plain(omega), solver.status, solver.steps, None if method == "taylor" else counted)


def _printed(result: Any) -> End:
    """Return the last row of a compiled program's run as an `End` (result at one time)."""
    rows, _, n_rows, status, evaluations, variable, _ = result
    if status == STOPPED:
        return not_finite(f"stopped at step {n_rows} by {STOP_VARIABLES[variable - 1]}")
    if status != COMPLETE:
        return not_finite()
    return End(plain(rows[2:5, n_rows - 1]), "complete", n_rows, evaluations)
