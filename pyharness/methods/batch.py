"""Batches of scenes: one scene, and arrays of the quantities that differ between the scenes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.methods.ensemble import Ensemble
from pyharness.methods.many import solve_many
from pyharness.methods.many_space import scene_of_row
from pyharness.methods.registry import METHODS, REGISTRY, requested_tolerance
from pyharness.methods.solve import solve
from pyharness.methods.solver import PREPARED
from pyharness.model.attitude import IDENTITY
from pyharness.model.codes import Statuses
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.original.many import ProgramEnsemble, run_many

# Quantities that may be arrays for a program, but not for a method.
OF_PROGRAMS = ("step_size", "lipschitz")
_EFFORT = 1e9  # in effect no work limit: the caller has requested the whole batch


@dataclass(frozen=True)
class Solver:
    """The method or program that solves the scenes of a batch, with its settings.

    Exactly one of `method` and `program` is not None. `t_end` is the final time (s); if it is None,
    the final time is the product of the scene's step size and its number of steps. The other fields
    are for programs. `listing` and `reading` are the texts by which a sweep selects the defects and
    the interpretations that are active. `lipschitz` is the constant of the Lipschitz test (1/s),
    and `may_stop` states whether that test may end a run.
    """

    method: str | None = "auto"
    program: str | None = None
    tolerance: float | None = None  # by default the method's own
    t_end: float | None = None
    listing: str = "original"
    reading: str = "adopted"
    lipschitz: float = 500.0
    may_stop: bool = True


@dataclass(frozen=True, eq=False)
class Batch:
    """Scenes that share the method or program that solves them, and their results.

    A result is computed when it is first read. The functions that check claims may read `omega0`,
    `omega`, `status`, `n_rows` and `stop_variable`, and call `rows` and `by_method`.

    Attributes
    ----------
    scene : Scene
        The quantities that all scenes have in common.
    solver : Solver
        The method or program that solves the scenes, with its settings.
    listing : Listing, or None
        The listing of the program; None for a method.
    t_end : ndarray, shape (n,)
        The final time of each scene, s.
    arrays : mapping
        The quantities that differ between the scenes, one row for each scene. The keys are names of
        arguments of `solve_many` and `run_many`: always `omega0`; for programs `step_size` and
        `lipschitz` too.
    """

    scene: Scene
    solver: Solver
    listing: Listing | None
    t_end: Array
    arrays: Mapping[str, Array]

    @property
    def omega0(self) -> Array:
        """Return the initial angular velocities, shape (n, 3), rad/s."""
        return self.arrays["omega0"]

    @property
    def step_sizes(self) -> Array:
        """Return the step size of each scene, shape (n,), s."""
        return self.arrays.get("step_size", np.full(len(self.omega0), self.scene.step_size))

    @property
    def bodies(self) -> Array:
        """Return the moments (kg m2), shape (n, 3), or (1, 3) if all scenes have the same body."""
        return self.arrays.get("moments", np.array([self.scene.moments]))

    @property
    def is_program(self) -> bool:
        """Return whether a program of the thesis solves the batch, and not a modern method."""
        return self.listing is not None

    @cached_property
    def omega(self) -> Array:
        """Return omega (rad/s) at `t_end`, shape (n, 3); NaN for a scene that did not reach it."""
        return self._program.omega[:, -1] if self.is_program else self._ends.omega

    @property
    def status(self) -> NDArray[np.int8]:
        """Return how the solution of each scene ended, as integers, shape (n,).

        `pyharness.model.codes.Statuses` defines them, for example COMPLETE, OVERFLOW and REFUSED.
        """
        return (self._program if self.is_program else self._ends).status

    @property
    def n_rows(self) -> NDArray[np.int32]:
        """Return for each scene the number of steps with a result of the program, shape (n,)."""
        return self._program.n_rows

    @property
    def stop_variable(self) -> NDArray[np.int8]:
        """Return the variable that stopped each run of a program, shape (n,).

        A number counts the names in `pyharness.model.trajectory.STOP_VARIABLES` from 1. It is 0 for
        a run that the Lipschitz test did not stop.
        """
        return self._program.stop_variable

    def sample_steps(self, samples: int) -> list[int]:
        """Return the numbers of the program's steps at the ends of `samples` nearly equal parts.

        The parts divide the run of `scene.steps` steps. The numbers are from 1 and in order.
        """
        steps = self.scene.steps
        return [max(1, round(steps * (i + 1) / samples)) for i in range(samples)]

    def rows(self, samples: int) -> Array:
        """Return omega at `samples` times of each scene, shape (n, samples, 3), rad/s.

        The times are the ends of `samples` equal parts of the time from 0 to `t_end`. A method
        solves each scene from time 0 for each of these times, so that the errors of the parts do
        not add up. A program supplies its results at the steps that `sample_steps` returns.
        """
        if samples not in self._rows:
            if self.is_program:
                found = self.run(self.sample_steps(samples)).omega
            else:
                parts = [(i + 1) / samples for i in range(samples - 1)]
                ends = [self._solve_own(self.t_end * part).omega for part in parts]
                found = np.stack([*ends, self.omega], axis=1)
            self._rows[samples] = found
        return self._rows[samples]

    def attitudes(self, samples: int) -> Array:
        """Return the attitudes at `samples` times of each scene, shape (n, samples, 4).

        The times are the same as in `rows`. Attitudes are quaternions from body to space, scalar
        first; the attitude at time 0 is (1, 0, 0, 0). The batch must be solved by a method.
        """
        ends = []
        for i in range(samples):
            part = (i + 1) / samples
            found = self._solve_own(self.t_end * part, attitude0=IDENTITY)
            assert found.attitude is not None
            ends.append(found.attitude)
        return np.stack(ends, axis=1)

    def by_method(self, method: str, tolerance: float, part: float = 1.0) -> Array:
        """Return omega (rad/s) at `part` times `t_end` as another method computes it, shape (n, 3).

        `tolerance` is relative; it is raised to the smallest tolerance that the method accepts.
        """
        return self._solve(method, tolerance, self.t_end * part).omega

    def from_start(self, omega0: Array) -> "Batch":
        """Return a copy of the batch with the initial angular velocities `omega0`, (n, 3), rad/s.

        The copy has no results yet.
        """
        return replace(self, arrays={**self.arrays, "omega0": omega0})

    def run(self, at: list[int]) -> ProgramEnsemble:
        """Run the program for all scenes and return its results at the steps `at`.

        `at` contains numbers of steps, from 1, in ascending order. All scenes are run in one call
        if possible. They are run one by one if their torque rates differ, or if the program can't
        take one of them. Only the scene that it can't take then has the status REFUSED, and the
        results do not include the program's error code IER.
        """
        if "torque_rate" not in self.arrays:  # `run_many` takes one rate for all bodies
            try:
                return self._run(self.scene, self.arrays, at)
            except InputError:  # raised by at least one scene
                pass
        return self._run_each(at)

    def scene_of(self, i: int) -> Scene:
        """Return the scene of row `i` of the arrays, without attitude.

        Raise InputError if its numbers are not allowed.
        """
        own = {name: array for name, array in self.arrays.items() if name != "lipschitz"}
        return scene_of_row(replace(self.scene, attitude=None), own, i)

    @cached_property
    def _ends(self) -> Ensemble:
        return self._solve_own(self.t_end)

    @cached_property
    def _program(self) -> ProgramEnsemble:
        return self.run([self.scene.steps])

    @cached_property
    def _rows(self) -> dict[int, Array]:
        return {}

    def _solve_own(self, t_end: Array, **more: tuple[float, ...]) -> Ensemble:
        method = self.solver.method
        assert method is not None
        tolerance = requested_tolerance(method, self.solver.tolerance)
        return self._solve(method, tolerance, t_end, **more)

    def _solve(self, method: str, tolerance: float, t_end: Array, **more: Any) -> Ensemble:
        """Return the final states of all scenes, solved by a method until `t_end` (s).

        A method in `PREPARED` solves all scenes in one call, any other one by one. `more` contains
        additional arguments of `solve_many`.
        """
        if method not in PREPARED:
            return self._solve_each(method, tolerance, t_end)
        tolerance = max(tolerance, REGISTRY[method].finest)
        arrays: dict[str, Any] = {
            name: array for name, array in self.arrays.items() if name not in OF_PROGRAMS
        }
        return solve_many(self.scene, t_end, method=method, tolerance=tolerance, **arrays, **more)

    def _solve_each(self, method: str, tolerance: float, t_end: Array) -> Ensemble:
        n = len(self.omega0)
        ends, status = np.full((n, 3), np.nan), np.full(n, Statuses.REFUSED, dtype=np.int8)
        for i in range(n):
            try:
                finest = METHODS[method].finest
                found = solve(self.scene_of(i), float(t_end[i]), method, max(tolerance, finest))
            except InputError:  # refuses this scene alone
                continue
            status[i] = ENDS.index(found.ended)
            if found.has_all_rows:
                ends[i] = found.omega[-1]
        return Ensemble(ends, status)

    def _run_each(self, at: list[int]) -> ProgramEnsemble:
        n, steps = len(self.omega0), np.array(at, np.int32)
        found = ProgramEnsemble(
            omega=np.full((n, len(at), 3), np.nan),
            status=np.full(n, Statuses.REFUSED, np.int8),
            at=steps,
            velocity=None,
            recorded_time=np.full((n, len(at)), np.nan),
            n_rows=np.zeros(n, np.int32),
            stop_variable=np.zeros(n, np.int8),
            stop_quotient=np.full(n, np.nan),
            ier=None,
        )
        for i in range(n):
            own = {name: array[i : i + 1] for name, array in self.arrays.items()}
            try:
                scene = self.scene
                if "torque_rate" in own:
                    rate = own.pop("torque_rate")[0]
                    scene = replace(scene, torque=replace(scene.torque, rate=rate))
                part = self._run(scene, own, at)
            except InputError:  # refuses this scene alone
                continue
            for name in ("omega", "status", "n_rows", "stop_variable", "stop_quotient"):
                getattr(found, name)[i] = getattr(part, name)[0]
            found.recorded_time[i] = part.recorded_time
        return found

    def _run(self, scene: Scene, arrays: Mapping[str, Array], at: list[int]) -> ProgramEnsemble:
        assert self.listing is not None
        options: dict[str, Any] = {"lipschitz": self.solver.lipschitz, **arrays}
        return run_many(
            replace(scene, attitude=None),
            self.listing,
            may_stop=self.solver.may_stop,
            at=at,
            effort=_EFFORT,
            **options,
        )
