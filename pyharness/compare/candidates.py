"""Candidates: whatever can be run on a scene, and judged or timed."""

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

_SAME = 1e-9  # of a time, but for the rounding of its steps


@dataclass(frozen=True, eq=False)
class End:
    """What a candidate made of a scene at one time."""

    omega: Array  # rad/s; NaN where it did not get there
    ended: str = "complete"  # or why it is not
    steps: int = 0  # as the candidate counts them
    evaluations: int | None = None  # right-hand sides, where they are counted
    attitude: Array | None = None  # shape (4,), scalar first, where it was carried

    @property
    def is_refused(self) -> bool:
        """Whether the kernel of a prepared solver would not, or gave up."""
        return self.ended in ("refused", "gave up")

    @property
    def has_result(self) -> bool:
        """Whether it got there, though it may be sensitive."""
        return self.ended in WITH_ALL_ROWS


@dataclass(frozen=True)
class Ready:
    """A call that goes from time 0 to T and does nothing else; and how to read it."""

    run: Callable[[], Any]
    read: Callable[[Any], End]


@dataclass(frozen=True)
class Candidate:
    """A method with its tolerance, a prepared solver, or a program with its listing."""

    name: str
    # From a scene and a time (s); InputError where it can't take them, as a program whose steps
    # end elsewhere.
    ready: Callable[[Scene, float], Ready]
    # From a scene, at the scene's own times; of methods also at other ones, given as second
    # argument; a prepared solver has none.
    rows: Callable[..., Trajectory]

    def end(self, scene: Scene, time: float) -> End:
        """Run it to one time (s); InputError where it refuses the scene."""
        ready = self.ready(scene, time)
        return ready.read(ready.run())


def method_candidate(name: str, tolerance: float, effort: float = 1.0) -> Candidate:
    """Return a method of the registry, as `solve` runs it; an attitude of the scene is wanted."""

    def rows(scene: Scene, times: Sequence[float] | None = None) -> Trajectory:
        times = scene.times() if times is None else times
        return solve(scene, times, name, tolerance, effort, scene.attitude is not None)

    def ready(scene: Scene, time: float) -> Ready:
        return Ready(partial(solve, scene, [time], name, tolerance, effort), _last)

    return Candidate(name, ready, rows)


def prepared_candidate(name: str, tolerance: float | None, primed: bool = False) -> Candidate:
    """Return a prepared solver; `primed` by a call from another start, of which nothing may stay.

    A method with a fixed step, and Gauss collocation, go in the scene's steps.
    """

    def ready(scene: Scene, time: float) -> Ready:
        solver, start = prepare(scene, name, tolerance), np.array(scene.omega)
        if primed:
            solver(start[::-1].copy(), 0.5 * time)
        return Ready(partial(solver, start, time), partial(_answered, solver))

    return Candidate(name, ready, _no_rows)


def attitude_candidate(name: str, tolerance: float | None, primed: bool = False) -> Candidate:
    """Return a prepared solver with attitude; `primed` as in `called`."""

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
    raise InputError("a prepared solver gives the end alone")


def program_candidate(
    listing: Listing,
    implementation: str = "fortran",
    lipschitz: float = 500.0,
    may_stop: bool = True,
    velocity: bool = True,
    effort: float = 1.0,
    word: str = BINARY64,
) -> Candidate:
    """Return a program with its listing; what it takes is told at `Program.run`."""
    options = lipschitz, may_stop, velocity

    def ready(scene: Scene, time: float) -> Ready:
        last = scene.step_size * scene.steps
        if abs(last - time) > _SAME * abs(time):
            raise InputError(f"{listing.program}: its steps end at {last:g} s, not at {time:g} s")
        if implementation != "fortran":
            return Ready(partial(rows, scene), _last)
        given = program_arguments(scene, listing, *options)
        return Ready(partial(extension().run_program, *given), _printed)

    def rows(scene: Scene) -> Trajectory:
        run = PROGRAM_REGISTRY[listing.program].run
        return run(scene, listing, implementation, *options, effort, word)

    return Candidate(f"{listing.program}-{listing.label}", ready, rows)


def unstopped(listing: Listing) -> Candidate:
    """Return a compiled program whose stop test ends nothing, for its omega alone."""
    return program_candidate(listing, may_stop=False, velocity=False)


def plain(values: Iterable[float]) -> Array:
    """Return omega in an array of its own: a buffer is used again by the next call."""
    return np.array([float(x) for x in values])


def not_finite(why: str = "overflow") -> End:
    """Return the end of a call that got nowhere."""
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
    # A Taylor series evaluates no right-hand side, it expands one.
    return End(plain(omega), solver.status, solver.steps, None if method == "taylor" else counted)


def _printed(result: Any) -> End:
    """Read what the compiled program gives: the last of its rows."""
    rows, _, n_rows, status, evaluations, variable, _ = result
    if status == STOPPED:
        return not_finite(f"stopped at step {n_rows} by {STOP_VARIABLES[variable - 1]}")
    if status != COMPLETE:
        return not_finite()
    return End(plain(rows[2:5, n_rows - 1]), "complete", n_rows, evaluations)
