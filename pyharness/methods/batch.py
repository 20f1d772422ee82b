"""Batches: a scene and the arrays in which others differ from it, solved by one call."""

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

# What programs take as arrays, and methods do not.
OF_PROGRAMS = ("step_size", "lipschitz")
_EFFORT = 1e9  # the caller has requested the whole batch, and knows how long it takes


@dataclass(frozen=True)
class Solver:
    """The method or program that solves the scenes of a batch, with its settings.

    Exactly one of `method` and `program` is given. `t_end` is None where the scene's steps say it.
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

    A result is computed when it is first read. The functions of claims may read `omega0`, `omega`,
    `status`, `n_rows` and `stop_variable`, and call `rows` and `by_method`.

    Attributes
    ----------
    scene : Scene
        What all scenes have in common.
    solver : Solver
        What solves them.
    listing : Listing, or None
        The listing of the program; None for a method.
    t_end : ndarray, shape (n,)
        The times of the ends, s.
    arrays : mapping
        What the scenes differ in, by the names of arguments of `solve_many` and `run_many`, a row
        for each scene: always `omega0`; for programs `step_size` and `lipschitz` too.
    """

    scene: Scene
    solver: Solver
    listing: Listing | None
    t_end: Array
    arrays: Mapping[str, Array]

    @property
    def omega0(self) -> Array:
        """Initial angular velocities, (n, 3), rad/s."""
        return self.arrays["omega0"]

    @property
    def step_sizes(self) -> Array:
        """Step sizes, (n,), s."""
        return self.arrays.get("step_size", np.full(len(self.omega0), self.scene.step_size))

    @property
    def bodies(self) -> Array:
        """Moments, (n, 3), or (1, 3) where all scenes have the same."""
        return self.arrays.get("moments", np.array([self.scene.moments]))

    @property
    def is_program(self) -> bool:
        """Whether a program solves the batch, and not a method."""
        return self.listing is not None

    @cached_property
    def omega(self) -> Array:
        """Omega at the end, (n, 3); NaN where the end was not reached."""
        return self._program.omega[:, -1] if self.is_program else self._ends.omega

    @property
    def status(self) -> NDArray[np.int8]:
        """How each scene ended, (n,), as in `pyharness.model.codes.Statuses`."""
        return (self._program if self.is_program else self._ends).status

    @property
    def n_rows(self) -> NDArray[np.int32]:
        """The number of steps for which a program gave a row, (n,)."""
        return self._program.n_rows

    @property
    def stop_variable(self) -> NDArray[np.int8]:
        """The variable that ended a program, (n,), from 1 as in `STOP_VARIABLES`; 0 for none."""
        return self._program.stop_variable

    def sample_steps(self, samples: int) -> list[int]:
        """Return the steps of a program that are nearest to `samples` equal parts of the time."""
        steps = self.scene.steps
        return [max(1, round(steps * (i + 1) / samples)) for i in range(samples)]

    def rows(self, samples: int) -> Array:
        """Return omega at the ends of `samples` equal parts of the time, (n, samples, 3).

        A method solves each anew from the start, so that errors do not add up; a program has the
        steps nearest to them.
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
        """Return quaternions at the same times, (n, samples, 4), from (1, 0, 0, 0) at the start."""
        ends = []
        for i in range(samples):
            part = (i + 1) / samples
            found = self._solve_own(self.t_end * part, attitude0=IDENTITY)
            assert found.attitude is not None
            ends.append(found.attitude)
        return np.stack(ends, axis=1)

    def by_method(self, method: str, tolerance: float, part: float = 1.0) -> Array:
        """Return omega (n, 3) by another method, after a `part` of the time."""
        return self._solve(method, tolerance, self.t_end * part).omega

    def from_start(self, omega0: Array) -> "Batch":
        """Return the same batch from other starts, (n, 3)."""
        return replace(self, arrays={**self.arrays, "omega0": omega0})

    def run(self, at: list[int]) -> ProgramEnsemble:
        """Return the rows of all scenes by the program, at steps in ascending order.

        A scene that the program can't take is refused alone; there is then no IER.
        """
        if "torque_rate" not in self.arrays:  # `run_many` takes one rate for all
            try:
                return self._run(self.scene, self.arrays, at)
            except InputError:  # of some scene
                pass
        return self._run_each(at)

    def scene_of(self, i: int) -> Scene:
        """Return the scene with index `i`; InputError where its numbers are no scene."""
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
        """Return the ends of all scenes by a method: in one call where it takes arrays."""
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
            except InputError:  # of this scene alone
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
            except InputError:  # of this scene alone
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
