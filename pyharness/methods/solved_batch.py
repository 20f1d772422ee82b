"""A batch with its results: ends, intermediate output, other starts. Each is computed once."""

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pyharness.methods.batch import Batch
from pyharness.methods.ensemble import Ensemble
from pyharness.methods.registry import requested_tolerance
from pyharness.model.attitude import IDENTITY
from pyharness.model.trajectory import Array
from pyharness.original.many import ProgramEnsemble


class SolvedBatch:
    """A batch, solved as far as a reduction or a claim requests it.

    The functions of claims may read `batch`, `omega0`, `omega`, `status`, `n_rows` and
    `stop_variable`, and call `rows` and `by_method`.
    """

    def __init__(self, batch: Batch) -> None:
        """Take the batch; nothing is solved yet."""
        self.batch = batch
        self.omega0 = batch.omega0
        self._rows: dict[int, Array] = {}

    @property
    def is_program(self) -> bool:
        """Whether a program solves the batch, and not a method."""
        return self.batch.listing is not None

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
        steps = self.batch.scene.steps
        return [max(1, round(steps * (i + 1) / samples)) for i in range(samples)]

    def rows(self, samples: int) -> Array:
        """Return omega at the ends of `samples` equal parts of the time, (n, samples, 3).

        A method solves each anew from the start, so that errors do not add up; a program has the
        steps nearest to them.
        """
        if samples not in self._rows:
            if self.is_program:
                found = self.batch.run(self.sample_steps(samples)).omega
            else:
                parts = [(i + 1) / samples for i in range(samples - 1)]
                ends = [self._solve(self.batch.t_end * part).omega for part in parts]
                found = np.stack([*ends, self.omega], axis=1)
            self._rows[samples] = found
        return self._rows[samples]

    def attitudes(self, samples: int) -> Array:
        """Return quaternions at the same times, (n, samples, 4), from (1, 0, 0, 0) at the start."""
        ends = []
        for i in range(samples):
            part = (i + 1) / samples
            found = self._solve(self.batch.t_end * part, attitude0=IDENTITY)
            assert found.attitude is not None
            ends.append(found.attitude)
        return np.stack(ends, axis=1)

    def by_method(self, method: str, tolerance: float, part: float = 1.0) -> Array:
        """Return omega (n, 3) by another method, after a `part` of the time."""
        return self.batch.solve(method, tolerance, self.batch.t_end * part).omega

    def from_start(self, omega0: Array) -> "SolvedBatch":
        """Return the same batch from other starts, (n, 3)."""
        return SolvedBatch(replace(self.batch, arrays={**self.batch.arrays, "omega0": omega0}))

    @cached_property
    def _ends(self) -> Ensemble:
        return self._solve(self.batch.t_end)

    @cached_property
    def _program(self) -> ProgramEnsemble:
        return self.batch.run([self.batch.scene.steps])

    def _solve(self, t_end: Array, **more: tuple[float, ...]) -> Ensemble:
        method = self.batch.solver.method
        assert method is not None
        tolerance = requested_tolerance(method, self.batch.solver.tolerance)
        return self.batch.solve(method, tolerance, t_end, **more)
