"""Prepared solvers of scenes whose inertia changes with time."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.many_starts import many_starts
from pyharness.engine.plan import plan
from pyharness.engine.prepared_attitude import AttitudeSolver, attitude_plan
from pyharness.engine.solver import Solver
from pyharness.model.arrays import rows_of
from pyharness.model.attitude import Rotation
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.model.values import Number, Numbers, number


class ChangingSolver(Solver):
    """A `Solver` whose calls raise InputError if a principal moment reaches 0 before the end."""

    def __call__(self, omega0: Numbers, t_end: Number, *, out: Array | None = None) -> Array:
        """Return omega (rad/s) at `t_end` (s), shape (3,)."""
        _check_time(self.plan.scene, number("t_end", t_end))
        return super().__call__(omega0, t_end, out=out)

    @property
    def many(self) -> Any:
        """Return `Solver.many`; the status is REFUSED if a moment reaches 0 before the end."""
        return self._many

    def _many(
        self, omega0: Any, t_end: Any, *, threads: int = 1, out: Array | None = None
    ) -> tuple[Array, NDArray[np.int8]]:
        assert self.plan.scene.changing is not None
        first, last = self.plan.scene.changing.span
        times = rows_of("t_end", t_end)
        # The kernel refuses a time that is not finite.
        reached = np.where((first < times) & (times < last), times, math.nan)
        return many_starts(self.packed, omega0, reached, threads=threads, out=out)


class ChangingAttitudeSolver(AttitudeSolver):
    """An `AttitudeSolver` whose calls raise InputError if a moment reaches 0 before the end."""

    def __call__(
        self, omega0: Numbers, t_end: Number, attitude0: Numbers | Rotation | None = None
    ) -> tuple[Array, Array]:
        """Return omega (rad/s), shape (3,), and the quaternion, shape (4,), at `t_end` (s)."""
        _check_time(self.plan.scene, number("t_end", t_end))
        return super().__call__(omega0, t_end, attitude0)


def prepared_changing(
    scene: Scene, method: str, tolerance: float, effort: float, attitude: bool
) -> ChangingSolver | ChangingAttitudeSolver:
    """Return a solver of a scene whose inertia changes with time."""
    if attitude:
        chosen = attitude_plan(scene, method, tolerance)
        return ChangingAttitudeSolver(chosen, tolerance, method, effort)
    chosen = plan(replace(scene, attitude=None), method, tolerance)
    return ChangingSolver(chosen, tolerance, method, effort)


def _check_time(scene: Scene, time: float) -> None:
    assert scene.changing is not None
    if math.isfinite(time):
        scene.changing.check([time])
