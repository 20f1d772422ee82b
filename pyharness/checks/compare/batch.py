"""Batches of scenes with arrays of the quantities in which they differ."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.many.many import solve_many
from pyharness.engine.plan.registry import (
    PREPARED,
    PREPARED_FOR_STATE,
    REGISTRY,
    requested_tolerance,
)
from pyharness.engine.prepared.many_scenes import scene_of_row
from pyharness.engine.solve import solve
from pyharness.model.arrays import unit_quaternions
from pyharness.model.attitude import IDENTITY, product
from pyharness.model.codes import Statuses
from pyharness.model.ensemble import Ensemble
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array
from pyharness.thesis.many import ProgramEnsemble, run_many

# Arrays that only programs use.
OF_PROGRAMS = ("step_size", "lipschitz")
_EFFORT = 1e9  # factor on the work limit; so large because the caller requested the whole batch


@dataclass(frozen=True)
class Solver:
    """The method or program of the thesis that solves a batch; one of the two is None.

    `t_end` (s) is by default the step size times the number of steps. The fields from `listing` to
    `may_stop` are for programs; `lipschitz` (1/s) is the limit of their stop test.
    """

    method: str | None = "auto"
    program: str | None = None
    tolerance: float | None = None  # by default the method's own
    t_end: float | None = None
    listing: str = "original"
    reading: str = "adopted"
    lipschitz: float = 500.0
    may_stop: bool = True
    compiled: bool = False


@dataclass(frozen=True, eq=False)
class Batch:
    """Many scenes, solved by one method or program when a result is first read."""

    # Checks of the thesis's claims use only `omega0`, `omega`, `status`, `n_rows`, `rows`,
    # `stop_variable` and `by_method`.
    scene: Scene  # the shared quantities
    solver: Solver
    listing: Listing | None  # None for a method
    t_end: Array  # s, shape (n,)
    # Quantities in which scenes differ, a row for each scene, named as in `solve_many`, `run_many`.
    arrays: Mapping[str, Array]
    attitude: bool = False  # whether a method computes attitudes
    # Results by number of samples.
    _rows: dict[int, Array] = field(default_factory=dict, init=False, repr=False)
    _found: dict[int, list[Ensemble]] = field(default_factory=dict, init=False, repr=False)

    @property
    def omega0(self) -> Array:
        """The initial angular velocities (rad/s), shape (n, 3)."""
        return self.arrays["omega"]

    @property
    def step_sizes(self) -> Array:
        """The step sizes (s), shape (n,)."""
        return self.arrays.get("step_size", np.full(len(self.omega0), self.scene.step_size))

    @property
    def bodies(self) -> Array:
        """The principal moments (kg m2), shape (n, 3), or (1, 3) if shared."""
        return self.arrays.get("moments", np.array([self.scene.moments]))

    @property
    def is_program(self) -> bool:
        return self.listing is not None

    @cached_property
    def omega(self) -> Array:
        """Omega at `t_end` (rad/s), shape (n, 3); NaN without a result."""
        return self._program.omega[:, -1] if self.is_program else self._ends.omega

    @property
    def status(self) -> NDArray[np.int8]:
        """The codes of the endings, from `pyharness.model.codes.Statuses`, shape (n,)."""
        return (self._program if self.is_program else self._ends).status

    @property
    def leaves(self) -> str | None:
        """The code that computed a recorded torque's Taylor series, as in `Ensemble.leaves`."""
        return self._ends.leaves

    @property
    def n_rows(self) -> NDArray[np.int32]:
        """The numbers of completed steps of a program, shape (n,)."""
        return self._program.n_rows

    @property
    def stop_variable(self) -> NDArray[np.int8]:
        """The number in STOP_VARIABLES of the variable that stopped each run, or 0, shape (n,)."""
        return self._program.stop_variable

    def sample_steps(self, samples: int) -> list[int]:
        """Return the last step (from 1) of each of `samples` nearly equal parts of a run."""
        steps = self.scene.steps
        return [max(1, round(steps * (i + 1) / samples)) for i in range(samples)]

    def rows(self, samples: int) -> Array:
        """Return omega (rad/s) at the ends of equal parts of each run, shape (n, samples, 3)."""
        if not self.is_program:
            return np.stack([each.omega for each in self._samples(samples)], axis=1)
        if samples not in self._rows:
            self._rows[samples] = self.run(self.sample_steps(samples)).omega
        return self._rows[samples]

    def attitudes(self, samples: int) -> Array:
        """Return quaternions at the ends of `samples` equal parts of the run, (n, samples, 4).

        They rotate from body axes to the initial body axes.
        """
        ends = [each.attitude for each in self._samples(samples) if each.attitude is not None]
        found = np.stack(ends, axis=1)
        if self._needs_attitude:
            w, x, y, z = self.first_attitudes.T[:, :, None]
            found = np.stack(product((w, -x, -y, -z), np.moveaxis(found, 2, 0)), axis=2)
        return found

    @property
    def first_attitudes(self) -> Array:
        """The normalised attitudes at time 0, shape (n, 4), or (1, 4) if shared."""
        first = np.array(self.arrays.get("attitude", [self.scene.attitude or IDENTITY]))
        return unit_quaternions(first)

    def by_method(self, method: str, tolerance: float, part: float = 1.0) -> Array:
        """Return omega (rad/s) at `part * t_end` by `method`, shape (n, 3)."""
        return self._solve(method, tolerance, self.t_end * part).omega

    def from_start(self, omega0: Array) -> "Batch":
        return replace(self, arrays={**self.arrays, "omega": omega0})

    def run(self, at: list[int]) -> ProgramEnsemble:
        """Return a program's results at the ascending steps `at`; `ier` is None for single runs."""
        if "torque_rate" not in self.arrays:  # `run_many` takes one rate for all scenes
            try:
                return self._run(self.scene, self.arrays, at)
            except InputError:  # at least one scene is refused
                pass
        return self._run_each(at)

    def scene_of(self, i: int) -> Scene:
        """Return scene `i` (from 0); it has an attitude only if the torque needs one."""
        own = {name: array for name, array in self.arrays.items() if name != "lipschitz"}
        return scene_of_row(self._shared, own, i)

    @property
    def _needs_attitude(self) -> bool:
        torque = self.scene.torque
        # A torque in space axes may be 0 in `scene`, but not in `arrays`.
        in_space = isinstance(torque, TorqueLaw) and torque.frame == "space"
        return in_space or torque.needs_attitude

    @cached_property
    def _shared(self) -> Scene:
        attitude = self.scene.attitude if self._needs_attitude else None
        return replace(self.scene, attitude=attitude)

    @cached_property
    def _ends(self) -> Ensemble:
        return self._solve_own(self.t_end)

    @cached_property
    def _program(self) -> ProgramEnsemble:
        return self.run([self.scene.steps])

    def _samples(self, samples: int) -> list[Ensemble]:
        if samples not in self._found:
            parts = [(i + 1) / samples for i in range(samples - 1)]
            ends = [self._solve_own(self.t_end * part) for part in parts]
            self._found[samples] = [*ends, self._ends]
        return self._found[samples]

    def _solve_own(self, t_end: Array) -> Ensemble:
        method = self.solver.method
        assert method is not None
        tolerance = requested_tolerance(method, self.solver.tolerance)
        # One initial attitude serves all scenes, because `attitudes` multiplies the result by
        # `first_attitudes`.
        has_one = self.attitude and not self._needs_attitude
        more = {"attitude": IDENTITY} if has_one else {}
        return self._solve(method, tolerance, t_end, **more)

    def _solve(self, method: str, tolerance: float, t_end: Array, **more: Any) -> Ensemble:
        """Return the states at `t_end` (s), scene by scene if no kernel integrates many."""
        by_state = isinstance(self.scene.torque, StateTorque)
        tolerance = max(tolerance, REGISTRY[method].finest)
        if method not in (PREPARED_FOR_STATE if by_state else PREPARED):
            return self._solve_each(method, tolerance, t_end)
        hidden = OF_PROGRAMS if self._needs_attitude else (*OF_PROGRAMS, "attitude")
        options: dict[str, Any] = {k: x for k, x in self.arrays.items() if k not in hidden} | more
        options["compiled"] = self.solver.compiled
        return solve_many(self._shared, t_end, method=method, tolerance=tolerance, **options)

    def _solve_each(self, method: str, tolerance: float, t_end: Array) -> Ensemble:
        n = len(self.omega0)
        ends, status = np.full((n, 3), np.nan), np.full(n, Statuses.REFUSED, dtype=np.int8)
        attitude = self._needs_attitude
        for i, time in enumerate(t_end.tolist()):
            try:
                found = solve(self.scene_of(i), time, method, tolerance, attitude=attitude)
            except InputError:  # the solver refuses only this scene
                continue
            status[i] = ENDS.index(found.ended)
            if found.has_all_rows:
                ends[i] = found.omega[-1]
        return Ensemble(ends, status)

    def _run_each(self, at: list[int]) -> ProgramEnsemble:
        n, steps = len(self.omega0), np.array(at, np.int32)
        omega, recorded = np.full((n, len(at), 3), np.nan), np.full((n, len(at)), np.nan)
        status, n_rows = np.full(n, Statuses.REFUSED, np.int8), np.zeros(n, np.int32)
        stops = np.zeros(n, np.int8), np.full(n, np.nan)
        found = ProgramEnsemble(omega, status, steps, None, recorded, n_rows, *stops, ier=None)
        for i in range(n):
            own = {name: array[i : i + 1] for name, array in self.arrays.items()}
            scene = self.scene
            try:
                if "torque_rate" in own:
                    rate = own.pop("torque_rate")[0]
                    scene = replace(scene, torque=replace(scene.law, rate=rate))
                part = self._run(scene, own, at)
            except InputError:  # the solver refuses only this scene
                continue
            for name in ("omega", "status", "n_rows", "stop_variable", "stop_quotient"):
                getattr(found, name)[i] = getattr(part, name)[0]
            found.recorded_time[i] = part.recorded_time
        return found

    def _run(self, scene: Scene, arrays: Mapping[str, Array], at: list[int]) -> ProgramEnsemble:
        assert self.listing is not None
        options: dict[str, Any] = {"lipschitz": self.solver.lipschitz, **arrays}
        options |= {"may_stop": self.solver.may_stop, "at": at, "effort": _EFFORT}
        return run_many(replace(scene, attitude=None), self.listing, **options)
