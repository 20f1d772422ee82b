"""Prepared solvers of scenes with a full inertia matrix.

A call transforms its arguments to principal axes, solves the scene about these axes, and transforms
the result back. The transformations are in Python, whereas a solver of a scene with principal
moments calls the kernel directly from C.
"""

from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pyharness.methods.many_starts import many_starts
from pyharness.methods.plan import Plan
from pyharness.methods.prepared_attitude import AttitudeSolver
from pyharness.methods.solver import Solver, no_buffer
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
    """A solver, made by `prepare`, of one scene with a full inertia matrix.

    It is called in the same way as a `Solver`. The omegas that a call takes and returns are about
    the axes of the inertia matrix. The attribute `plan` has the chosen method and the scene about
    principal axes. The attribute `growth` is the error amplification: the largest norm of the
    state-transition matrices of omega about principal axes.
    """

    ctypes = capsule = property(_no_compiled_call)

    def __new__(
        cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0,
        scene: Scene | None = None,
    ) -> Self:  # fmt: skip
        """Create a solver of the scene about principal axes; users call `prepare` instead.

        `chosen` is the plan: the scene about principal axes, and the chosen method. `scene` is the
        scene with the inertia matrix. `tolerance` is the largest allowed error, relative to the
        largest |omega|. `asked` is the name of the requested method, such as `auto`. `effort`
        multiplies the work limit of a call.
        """
        solver = super().__new__(cls, chosen, tolerance, asked, effort)
        assert scene is not None
        solver._scene = scene
        solver._axes = principal(scene)[1]
        return solver

    _scene: Scene
    _axes: Array  # the principal axes, in columns

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the arguments from which `copy` and `pickle` recreate the solver."""
        return type(self), (self.plan, *self._given, self._scene)

    def __call__(self, omega0: Numbers, t_end: Number, *, out: Array | None = None) -> Array:
        """Return omega (rad/s) at `t_end` (s), shape (3,), about the axes of the inertia matrix.

        `omega0` is the initial omega (rad/s), about the same axes. If the keyword argument `out`,
        an array of three floats, is not None, the result is written into it and `out` is returned.
        """
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
        """Return the function that solves the scene from many initial omegas in one call.

        Call it as ``solver.many(omega0, t_end)``; `Solver.many` describes its arguments.
        """
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
    """A solver, made by `prepare`, of omega and attitude of a scene with a full inertia matrix.

    The solver is called in the same way as an `AttitudeSolver`. The omegas that a call takes and
    returns are about the axes of the inertia matrix. The quaternions rotate from these axes to
    space.
    """

    ctypes = capsule = property(_no_compiled_call)

    def __new__(
        cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0,
        scene: Scene | None = None,
    ) -> Self:  # fmt: skip
        """Create a solver of the scene about principal axes; users call `prepare` instead.

        `chosen` is the plan: the scene about principal axes, and the chosen method. `scene` is the
        scene with the inertia matrix. `tolerance` is the largest allowed error, relative to the
        largest |omega|. `asked` is the name of the requested method, such as `auto`. `effort`
        multiplies the work limit of a call.
        """
        solver = super().__new__(cls, chosen, tolerance, asked, effort)
        assert scene is not None
        solver._scene = scene
        solver._axes, solver._turn = axes_and_turn(scene)
        return solver

    _scene: Scene
    _axes: Array  # the principal axes, in columns
    _turn: Quaternion  # from principal axes to the axes of the inertia matrix

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the arguments from which `copy` and `pickle` recreate the solver."""
        return type(self), (self.plan, *self._given, self._scene)

    def __call__(
        self, omega0: Numbers, t_end: Number, attitude0: Numbers | Rotation | None = None
    ) -> tuple[Array, Array]:
        """Return omega (rad/s), shape (3,), and the attitude, shape (4,), at `t_end` (s).

        Omega is about the axes of the inertia matrix, and the attitude is a quaternion from these
        axes to space, scalar first. `omega0` is the initial omega (rad/s), and `attitude0` the
        initial quaternion. The default quaternion is the scene's, or (1, 0, 0, 0) if the scene has
        none.
        """
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
    """Return the principal axes of a scene's inertia matrix, as a matrix and as a quaternion.

    The columns of the matrix, shape (3, 3), are the axes. The quaternion, scalar first, is the same
    rotation. Both transform components about principal axes to components about the axes of the
    inertia matrix.
    """
    about_principal, axes = principal(replace(scene, attitude=IDENTITY))
    return axes, about_principal.attitude or IDENTITY


def rotated(vectors: Array, matrix: Array) -> Array:
    """Return the product of a matrix and each of n vectors, shape (n, 3), or of a single vector.

    `vectors` has shape (n, 3), or (3,) for a single vector; the result has the same shape. `matrix`
    has shape (3, 3), or shape (n, 3, 3) with one matrix for each vector. The products are summed in
    a fixed order, so that the result of a vector is bit-for-bit identical for any n.
    """
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack(
        [(x * matrix[..., i, 0] + y * matrix[..., i, 1]) + z * matrix[..., i, 2] for i in range(3)],
        axis=-1,
    )


def turned_back(attitudes: Array, turn: Any) -> Array:
    """Convert attitudes of the principal axes to attitudes of the axes of the inertia matrix.

    `attitudes` has shape (n, 4), or (4,) for a single attitude; the result has the same shape.
    `turn` is the quaternion of the rotation from principal axes to the axes of the inertia matrix.
    It has shape (4,), or (n, 4) with one quaternion for each attitude. Quaternions are scalar
    first.
    """
    w, x, y, z = np.moveaxis(np.asarray(turn), -1, 0)
    first, *rest = np.moveaxis(attitudes, -1, 0)
    parts: Any = product((first, rest[0], rest[1], rest[2]), (w, -x, -y, -z))
    return np.stack(parts, axis=-1)


def prepared_inertia(scene: Scene, method: str, tolerance: float, effort: float) -> InertiaSolver:
    """Return a solver of omega, prepared for many calls with the same scene.

    The scene must have a full inertia matrix, and the attitude is not computed. `method` is a name
    in `pyharness.methods.solver.PREPARED`. `tolerance` is the largest allowed error, relative to
    the largest |omega|. `effort` multiplies the work limit of a call, some ten seconds.
    """
    from pyharness.methods.plan import plan

    about_principal = with_merged_waves(principal(replace(scene, attitude=None))[0])
    return InertiaSolver(plan(about_principal, method, tolerance), tolerance, method, effort, scene)


def prepared_inertia_attitude(
    scene: Scene, method: str, tolerance: float, effort: float
) -> InertiaAttitudeSolver:
    """Return a solver of omega and attitude, prepared for many calls with the same scene.

    The scene must have a full inertia matrix. `method` is a name in
    `pyharness.methods.solver.PREPARED`. `tolerance` is the largest allowed error, relative to the
    largest |omega|. `effort` multiplies the work limit of a call, some ten seconds.
    """
    from pyharness.methods.prepared_attitude import attitude_plan

    about_principal, _ = principal(replace(scene, attitude=scene.attitude or IDENTITY))
    chosen = attitude_plan(with_merged_waves(about_principal), method, tolerance)
    return InertiaAttitudeSolver(chosen, tolerance, method, effort, scene)
