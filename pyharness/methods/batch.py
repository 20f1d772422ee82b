"""Batches: scenes that one call solves, as a scene and the arrays in which they differ."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pyharness.methods.ensemble import Ensemble
from pyharness.methods.many import solve_many
from pyharness.methods.many_space import scene_of_row
from pyharness.methods.registry import METHODS, REGISTRY
from pyharness.methods.solve import solve
from pyharness.methods.solver import PREPARED
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
    """Scenes that share the method or program that solves them.

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

    def scene_of(self, i: int) -> Scene:
        """Return the scene with index `i`; InputError where its numbers are no scene."""
        own = {name: array for name, array in self.arrays.items() if name != "lipschitz"}
        return scene_of_row(replace(self.scene, attitude=None), own, i)

    def solve(self, method: str, tolerance: float, t_end: Array, **more: Any) -> Ensemble:
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
