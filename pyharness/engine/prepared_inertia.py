"""Prepared solvers of scenes with a full inertia matrix.

Their calls convert to principal axes and back in Python, and are therefore slower than others.
"""

from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.many_starts import many_starts
from pyharness.engine.plan import Plan
from pyharness.engine.prepared_attitude import AttitudeSolver
from pyharness.engine.solver import Solver, no_buffer
from pyharness.model.arrays import buffer_of, rows_of
from pyharness.model.attitude import IDENTITY, Quaternion, Rotation, product, unit_quaternion
from pyharness.model.errors import InputError
from pyharness.model.principal import principal
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.model.values import Number, Numbers, three_floats
from pyharness.model.waves import with_merged_waves


def _no_compiled_call(solver: object) -> Any:
    # Compiled code would take and return omega about the principal axes.
    raise AttributeError(
        "a solver for a full inertia matrix has no compiled call; allowed: a solver for the scene "
        "that `principal` returns"
    )


class InertiaSolver(Solver):
    """A `Solver` about the axes of the matrix; `plan` and `growth` are about the principal axes."""

    ctypes = capsule = property(_no_compiled_call)

    def __new__(
        cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0,
        scene: Scene | None = None,
    ) -> Self:  # fmt: skip
        """Create a solver; `chosen` is for principal axes, `scene` has the matrix."""
        solver = super().__new__(cls, chosen, tolerance, asked, effort)
        assert scene is not None
        solver._scene = scene
        solver._axes = principal(scene)[1]
        return solver

    _scene: Scene
    _axes: Array  # the principal axes, in columns

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the arguments for `copy` and `pickle`."""
        return type(self), (self.plan, *self._given, self._scene)

    def __call__(self, omega0: Numbers, t_end: Number, *, out: Array | None = None) -> Array:
        """Return omega (rad/s) at `t_end` (s), shape (3,)."""
        start = np.array(three_floats("omega0", omega0))
        if out is not None and (found := no_buffer(out)):
            raise InputError(
                f"out: {found}; allowed: a writable array of three float64 side by side"
            )
        end = rotated(super().__call__(rotated(start, self._axes.T), t_end), self._axes)
        if out is None:
            return end
        out[:] = end
        return out

    @property
    def many(self) -> Any:
        """Return the function that `Solver.many` describes."""
        return self._many

    def _many(
        self, omega0: Any, t_end: Any, *, threads: int = 1, out: Array | None = None
    ) -> tuple[Array, NDArray[np.int8]]:
        starts = rotated(rows_of("omega0", omega0, 3), self._axes.T)
        if out is not None:
            buffer_of("out", out, starts.shape, "d")
        ends, status = many_starts(self.packed, starts, t_end, threads=threads, out=out)
        ends[:] = rotated(ends, self._axes)
        return ends, status

    @property
    def _scene_of_calls(self) -> Scene:
        return self._scene


class InertiaAttitudeSolver(AttitudeSolver):
    """An `AttitudeSolver` about the axes of the inertia matrix."""

    ctypes = capsule = property(_no_compiled_call)

    def __new__(
        cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0,
        scene: Scene | None = None,
    ) -> Self:  # fmt: skip
        """Create a solver; `chosen` is for principal axes, `scene` has the matrix."""
        solver = super().__new__(cls, chosen, tolerance, asked, effort)
        assert scene is not None
        solver._scene = scene
        solver._axes, solver._turn = axes_and_turn(scene)
        return solver

    _scene: Scene
    _axes: Array  # the principal axes, in columns
    _turn: Quaternion  # from principal axes to the axes of the inertia matrix

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the arguments for `copy` and `pickle`."""
        return type(self), (self.plan, *self._given, self._scene)

    def __call__(
        self, omega0: Numbers, t_end: Number, attitude0: Numbers | Rotation | None = None
    ) -> tuple[Array, Array]:
        """Return omega (rad/s), shape (3,), and the quaternion, shape (4,), at `t_end` (s)."""
        start = np.array(three_floats("omega0", omega0))
        attitude = self._scene.attitude or IDENTITY
        if attitude0 is not None:
            attitude = unit_quaternion("attitude0", attitude0)[0]
        omega, found = super().__call__(
            rotated(start, self._axes.T), t_end, product(attitude, self._turn)
        )
        return rotated(omega, self._axes), turned_back(found, self._turn)

    @property
    def _scene_of_calls(self) -> Scene:
        return self._scene


def axes_and_turn(scene: Scene) -> tuple[Array, Quaternion]:
    """Return the principal axes, as columns, shape (3, 3), and as a quaternion."""
    about_principal, axes = principal(replace(scene, attitude=IDENTITY))
    return axes, about_principal.attitude or IDENTITY


def rotated(vectors: Array, matrix: Array) -> Array:
    """Return the products of one or n matrices, (3, 3), and vectors, (3,) or (n, 3)."""
    # The fixed order of the sums gives bit-for-bit the same products for any n.
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack(
        [(x * matrix[..., i, 0] + y * matrix[..., i, 1]) + z * matrix[..., i, 2] for i in range(3)],
        axis=-1,
    )


def turned_back(attitudes: Array, turn: Any) -> Array:
    """Return attitudes of the matrix's axes from those of the principal axes, (4,) or (n, 4)."""
    w, x, y, z = np.moveaxis(np.asarray(turn), -1, 0)
    first, *rest = np.moveaxis(attitudes, -1, 0)
    parts: Any = product((first, rest[0], rest[1], rest[2]), (w, -x, -y, -z))
    return np.stack(parts, axis=-1)


def prepared_inertia(scene: Scene, method: str, tolerance: float, effort: float) -> InertiaSolver:
    """Return a solver of omega for a full inertia matrix."""
    from pyharness.engine.plan import plan

    about_principal = with_merged_waves(principal(replace(scene, attitude=None))[0])
    return InertiaSolver(plan(about_principal, method, tolerance), tolerance, method, effort, scene)


def prepared_inertia_attitude(
    scene: Scene, method: str, tolerance: float, effort: float
) -> InertiaAttitudeSolver:
    """Return a solver of omega and attitude for a full inertia matrix."""
    from pyharness.engine.prepared_attitude import attitude_plan

    about_principal, _ = principal(replace(scene, attitude=scene.attitude or IDENTITY))
    chosen = attitude_plan(with_merged_waves(about_principal), method, tolerance)
    return InertiaAttitudeSolver(chosen, tolerance, method, effort, scene)
