"""What a reduction may ask of a load: its ends, rows on the way, other starts. Each solved once."""

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.ensembles.batches import Load
from pyharness.ensembles.one_by_one import Ends, ProgramRows, run_each, solve_each
from pyharness.methods.many import Ensemble, solve_many
from pyharness.methods.registry import REGISTRY, requested_tolerance
from pyharness.methods.solver import PREPARED
from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError
from pyharness.model.trajectory import Array
from pyharness.original.many import run_many

_EFFORT = 1e9  # chunks were asked for, and told how long they take


class Solved:
    """A load, solved as far as it was asked for.

    Its attributes, `load`, `omega0`, `omega`, `status`, `n_rows`, `stop_variable`, are what the
    functions of claims may read, and `rows` and `by_method` what they may call.
    """

    def __init__(self, load: Load, omega0: Array | None = None) -> None:
        """Solve nothing yet."""
        self.load = load
        self.omega0 = load.omega0 if omega0 is None else omega0
        self._rows: dict[int, Array] = {}

    @property
    def is_program(self) -> bool:
        """Whether a program runs, and no method."""
        return self.load.listing is not None

    @cached_property
    def omega(self) -> Array:
        """At the end, (n, 3); NaN where it was not reached."""
        return self._program.omega[:, -1] if self.is_program else self._ends.omega

    @cached_property
    def status(self) -> NDArray[np.int8]:
        """How each ended, (n,), as in `pyharness.model.codes.Statuses`."""
        return self._program.status if self.is_program else self._ends.status

    @property
    def n_rows(self) -> NDArray[np.int32]:
        """How many steps a program gave a row for, (n,)."""
        return self._program.n_rows

    @property
    def stop_variable(self) -> NDArray[np.int8]:
        """What ended a program, (n,), from 1 as in `STOP_VARIABLES`; 0 where nothing did."""
        return self._program.stop_variable

    def sample_steps(self, samples: int) -> list[int]:
        """Return the steps of a program that are nearest to `samples` equal parts of the way."""
        steps = self.load.scene.steps
        return [max(1, round(steps * (i + 1) / samples)) for i in range(samples)]

    def rows(self, samples: int) -> Array:
        """Return omega at the ends of `samples` equal parts of the way, (n, samples, 3).

        A method solves each anew from the start, so that errors do not add up; a program has the
        steps nearest to them.
        """
        if samples not in self._rows:
            if self.is_program:
                found = self._run(self.sample_steps(samples)).omega
            else:
                parts = [(i + 1) / samples for i in range(samples - 1)]
                ends = [self._solve(self.load.t_end * part).omega for part in parts]
                found = np.stack([*ends, self.omega], axis=1)
            self._rows[samples] = found
        return self._rows[samples]

    def attitudes(self, samples: int) -> Array:
        """Return quaternions at the same times, (n, samples, 4), from (1, 0, 0, 0) at the start."""
        parts = [(i + 1) / samples for i in range(samples)]
        ends = [self._turned(self.load.t_end * part) for part in parts]
        return np.stack(ends, axis=1)

    def by_method(self, method: str, tolerance: float, part: float = 1.0) -> Array:
        """Return omega (n, 3) by another method, after a `part` of the way."""
        return many_ends(self.load, method, tolerance, self.load.t_end * part, self.omega0).omega

    def from_start(self, omega0: Array) -> "Solved":
        """Return the same load from other starts, (n, 3)."""
        return Solved(self.load, omega0)

    @cached_property
    def _ends(self) -> Ends:
        return self._solve(self.load.t_end)

    @cached_property
    def _program(self) -> ProgramRows:
        return self._run([self.load.scene.steps])

    def _solve(self, t_end: Array) -> Ends:
        solver = self.load.solver
        assert solver.method is not None
        tolerance = requested_tolerance(solver.method, solver.tolerance)
        return many_ends(self.load, solver.method, tolerance, t_end, self.omega0)

    def _turned(self, t_end: Array) -> Array:
        solver = self.load.solver
        assert solver.method is not None
        tolerance = requested_tolerance(solver.method, solver.tolerance)
        found = _many(self.load, solver.method, tolerance, t_end, self.omega0, attitude0=IDENTITY)
        assert found.attitude is not None
        return found.attitude

    def _run(self, at: list[int]) -> ProgramRows:
        return many_rows(self.load, self.omega0, at)


def many_ends(load: Load, method: str, tolerance: float, t_end: Array, omega0: Array) -> Ends:
    """Return the ends of all scenes by a method: in one call where it takes arrays."""
    if method not in PREPARED:
        return solve_each(load, method, tolerance, t_end, omega0)
    found = _many(load, method, tolerance, t_end, omega0)
    return Ends(found.omega, found.status)


def _many(
    load: Load, method: str, tolerance: float, t_end: Array, omega0: Array, **more: Any
) -> Ensemble:
    return solve_many(
        load.scene,
        t_end,
        omega0=omega0,
        moments=load.moments,
        coefficients=load.coefficients,
        torque_constant=load.torque_constant,
        torque_rate=load.torque_rate,
        method=method,
        tolerance=max(tolerance, REGISTRY[method].finest),
        **more,
    )


def many_rows(load: Load, omega0: Array, at: list[int]) -> ProgramRows:
    """Return what a program makes of all scenes, with rows at some steps, in ascending order."""
    if load.torque_rate is not None:  # `run_many` takes one rate for all
        return run_each(load, omega0, at)
    assert load.listing is not None
    solver = load.solver
    try:
        found = run_many(
            replace(load.scene, attitude=None),
            load.listing,
            omega0=omega0,
            moments=load.moments,
            coefficients=load.coefficients,
            torque_constant=load.torque_constant,
            step_size=load.step_size,
            lipschitz=solver.lipschitz if load.lipschitz is None else load.lipschitz,
            may_stop=solver.may_stop,
            at=at,
            effort=_EFFORT,
        )
    except InputError:
        # One of them is no scene; the others are.
        return run_each(load, omega0, at)
    return ProgramRows(found.omega, found.n_rows, found.status, found.stop_variable)
