"""Scenes prepared for one method, for many fast calls through C."""

import math
from dataclasses import replace
from functools import cached_property, partial
from types import GenericAlias
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar, overload

from pyharness.engine.methods.sensitivity import judge_ending
from pyharness.engine.plan.plan import RK4_OR_TAYLOR, Plan, plan
from pyharness.engine.plan.registry import (
    GAUSS,
    PREPARED,
    PREPARED_WITH_ATTITUDE,
    REGISTRY,
    check_prepared,
    check_torque,
    computes_attitude,
    requested_tolerance,
)
from pyharness.engine.prepared.compiled_call import CompiledCall, check_call, compiled_call
from pyharness.engine.prepared.many_prepared import many_starts, many_states
from pyharness.engine.problem.problem import problem_of
from pyharness.engine.system.leaf_cache import leaves_for
from pyharness.engine.system.recorded import is_recorded, packed_scene
from pyharness.model.array_type import Maybe
from pyharness.model.attitude import IDENTITY, Quaternion
from pyharness.model.codes import Methods, Places
from pyharness.model.errors import known
from pyharness.model.extension import extension
from pyharness.model.keywords import with_hints
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.trajectory import Array, Trajectory, digits_left
from pyharness.model.values import Number, Numbers, boolean, checked_effort, three

if TYPE_CHECKING:
    from pyharness._solver import BoundKernel, Result
else:
    Result = TypeVar("Result")
    try:
        from pyharness._solver import BoundKernel
    except ImportError:  # not built: `extension` raises NotBuiltError when a solver is made

        class BoundKernel:
            __class_getitem__ = classmethod(GenericAlias)


CODES = {
    **{name: each.code for name, each in REGISTRY.items() if each.code is not None},
    "sphere": Methods.SPHERE,
    RK4_OR_TAYLOR: Methods.QUICK_OR_TAYLOR,
}

_FEW_WAVES = 16  # fewer waves take less time than releasing the GIL


class Solver(BoundKernel[Result]):
    """A solver of a scene, prepared for one method by `prepare`.

    ``solver(omega, t_end, *, out=None)`` takes three numbers, the initial omega (rad/s), and the
    final time (s), of any sign. It returns omega (rad/s) at `t_end` as a new array of shape (3,),
    or in `out`, a contiguous array of three floats, which may be the array `omega`.

    Prepared with the attitude, ``solver(omega, t_end, attitude=None)`` takes the initial
    quaternion from body to space, scalar first; the default is the scene's, or (1, 0, 0, 0). It
    returns omega and the quaternion at `t_end`, shape (4,), as new arrays.

    Invalid arguments raise an InputError and leave `out` unchanged. Calls are fastest with arrays
    of floats and a unit quaternion. If the kernel could not finish, or an argument is not finite,
    the result is NaN and `status` has the reason.

    Threads may share a solver. All but the shortest calls release the GIL. Solvers can be copied
    and pickled, without the last call's status.

    Attributes
    ----------
    scene : Scene
        The prepared scene.
    plan : Plan
        The chosen method, and the computed parts with reasons.
    status, error, growth, digits, steps, method
        The ending, estimated error, error amplification, correct digits, steps and method of this
        thread's last call that raised no error.
    leaves : str or None
        The origin of the code that computes the Taylor series of a recorded torque: ``built`` with
        the package, ``compiled`` for this torque, or an ``interpreter``, with the reason if
        compilation was requested. None for other torques.
    many : callable
        A function that solves from many initial states in one call.

    Examples
    --------
    >>> from pyharness import case_scene, prepare
    >>> solver = prepare(case_scene(1))
    >>> solver([1.0, 1.0, 1.0], 2.0)
    array([6., 6., 6.])
    >>> solver.status
    'complete'
    """

    scene: Scene
    plan: Plan
    with_attitude: bool
    packed: Array
    turn: tuple[Array, Quaternion] | None  # of the principal axes, which the kernel has
    _packed_with_gil: Array | None
    settings: tuple[float, str, float]  # requested tolerance, method, and factor on the work limit
    leaves: str | None
    _compiled: bool

    # The base class is in C, because Python code in a call would take as long as an easy solution.
    def __new__(
        cls, scene: Scene, chosen: Plan, tolerance: float, asked: str, effort: float,
        with_attitude: bool, compiled: bool = False,
    ) -> Self:  # fmt: skip
        entry = extension()
        kernel = entry.solve_packed_attitude if with_attitude else entry.solve_packed
        code = _code(chosen, with_attitude)
        address, leaves = leaves_for(chosen.scene, compiled) if code == Methods.TAPE else (0, None)
        packed = packed_scene(chosen.scene, code, tolerance, effort, address)
        packed_with_gil = None
        if chosen.closed_form and packed.size < Places.WAVES + 4 * _FEW_WAVES:
            # With the GIL, no fallback is called, because it may take long; if this kernel refuses,
            # the other is called without the GIL.
            packed_with_gil = packed.copy()
            is_sphere = chosen.closed_form == "sphere" and not with_attitude
            packed_with_gil[Places.METHOD] = CODES["sphere" if is_sphere else "closed-form"]
        turn = problem_of(scene, with_attitude).turn
        axes = turn and (tuple(turn[0]), turn[1])
        solver = super().__new__(
            cls, kernel, packed, partial(check_call, scene, with_attitude), packed_with_gil,
            (scene.attitude or IDENTITY) if with_attitude else None,
            scene.changing.span if scene.changing else (-math.inf, math.inf), axes,
        )  # fmt: skip
        solver.scene, solver.plan, solver.with_attitude = scene, chosen, with_attitude
        solver.packed, solver._packed_with_gil, solver.turn = packed, packed_with_gil, turn
        solver.settings = tolerance, asked, effort
        solver.leaves, solver._compiled = leaves, compiled
        return solver

    def __reduce__(self) -> tuple[Any, ...]:
        options = self.with_attitude, self._compiled
        return type(self), (self.scene, self.plan, *self.settings, *options)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of '{self.scene.name}' by {self.plan.method}>"

    @cached_property
    def many(self) -> Any:
        """Return the function that solves many initial states in one call.

        ``solver.many(omega, t_end, threads=1, out=None)`` takes `omega` (rad/s) of shape (n, 3),
        and `t_end` (s), a number or of shape (n,). It returns omega (rad/s), shape (n, 3), and the
        statuses of `Ensemble`, shape (n,). Rows do not depend on each other or on `threads`, but
        may differ by rounding from a single call's result. If a changing moment of inertia reaches
        0 before `t_end`, the status is `refused`, or `overflow` if a function gives the moment.
        Invalid arguments raise an InputError.

        For a solver with attitude, it is ``solver.many(omega, t_end, attitude=None, threads=1,
        out=None)`` with quaternions of shape (n, 4) or (4,), and returns omega, attitudes and
        statuses. `out`, to be overwritten, is an array for omega or, with attitude, an Ensemble.
        """
        if self.with_attitude:
            return partial(many_states, self)
        slowly = partial(many_starts, self)
        if self.scene.inertia is not None or self.scene.changing is not None:
            return slowly
        from pyharness._many import ManyStarts

        return ManyStarts(extension().solve_packed_many, self.packed, self._packed_with_gil, slowly)

    @property
    def ctypes(self) -> CompiledCall:
        """Return the solver for compiled code, such as numba's; C code uses `capsule`."""
        return compiled_call(self)

    def trajectory(self, omega: Numbers, times: Number | Numbers) -> Trajectory:
        """Return the trajectory from `omega` (rad/s) at `times` (s) by `solve`."""
        from pyharness import solve  # which prepares solvers
        from pyharness.engine.plan.registry import METHODS

        scene = replace(self.scene, omega=three("omega", omega))
        tolerance, asked, effort = self.settings
        method = "taylor" if asked == "quick" else asked
        # `solve` expects the tolerance 1 for a method with a fixed step.
        tolerance = max(tolerance, METHODS[method].finest)
        return solve(scene, times, method, tolerance, effort=effort, attitude=self.with_attitude)

    @property
    def method(self) -> str:
        """Return the name of the method of the last call.

        The kernel may choose `quick` or `taylor`, or use `plan.fallback`.
        """
        steps = 0 if self._ending is None else self._ending[1]  # negative if it chose `quick`
        if not steps:
            return self.plan.method
        if self.plan.method == RK4_OR_TAYLOR:
            return "quick" if steps < 0 else "taylor"
        return self.plan.fallback or self.plan.method

    @property
    def status(self) -> str:
        """Return how the last call ended; ``complete`` before the first call.

        ``gave up`` means that the work limit or the largest phase was exceeded; ``refused``, that
        the method does not apply; ``sensitive``, that amplified rounding errors exceed the
        tolerance.
        """
        return self._judge()[0]

    @property
    def error(self) -> Maybe[float]:
        """Return the estimated error of the last result, as in `Trajectory`; None if unknown."""
        return self._judge()[1]

    @property
    def growth(self) -> Maybe[float]:
        """Return the error amplification of the last motion; None if unknown."""
        return self._judge()[2]

    @property
    def digits(self) -> Maybe[float]:
        """Return the number of correct decimal digits of the last result; None if unknown."""
        return digits_left(self.error)

    @property
    def steps(self) -> int:
        """Return the last call's number of steps; Gauss collocation counts evaluations instead."""
        return 0 if self._ending is None else abs(self._ending[1])

    def _judge(self) -> tuple[str, float | None, float | None]:
        if self._ending is None:
            return "complete", None, None
        kind = "closed" if self.plan.closed_form else "gauss" * (self.plan.method in GAUSS)
        return judge_ending(self.plan.scene, kind, self.settings[0], self._ending)


def _code(chosen: Plan, with_attitude: bool) -> int:
    if is_recorded(chosen.scene) or chosen.scene.torque.in_space:
        return Methods.TAPE
    if chosen.closed_form == "sphere" and not with_attitude:
        return CODES["sphere"]
    if chosen.method == "closed-form" or (with_attitude and chosen.closed_form):
        # If the closed form was not requested, the Taylor series solves what it refuses.
        return Methods.CLOSED_FORM_OR_TAYLOR if chosen.fallback else CODES["closed-form"]
    return CODES[chosen.method]


@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    *,
    effort: float = ...,
    attitude: None = ...,
    compiled: bool = ...,
) -> Solver[Any]: ...
@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    *,
    effort: float = ...,
    attitude: Literal[False],
    compiled: bool = ...,
) -> Solver[Array]: ...
@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    *,
    effort: float = ...,
    attitude: Literal[True],
    compiled: bool = ...,
) -> Solver[tuple[Array, Array]]: ...
@with_hints
def prepare(
    scene: Scene,
    method: str = "auto",
    tolerance: Number | None = None,
    *,
    effort: float = 1.0,
    attitude: bool | None = None,
    compiled: bool = False,
) -> Solver[Any]:
    """Prepare a solver for many calls with the same scene.

    Parameters
    ----------
    scene : Scene
        The body, its torque and its default attitude. Each call supplies the initial omega.
    method : str
        A name in `pyharness.engine.prepared.solver.PREPARED`; `auto` selects the fastest.
    tolerance : float
        Largest allowed error of a component of omega, relative to the largest |omega| from time 0
        to the end; the default is as in `solve`. Methods with a fixed step and Gauss collocation
        ignore it.
    effort : float
        Factor on the work limit of a call (about ten seconds); beyond it the status is `gave up`.
    attitude : bool, optional
        Whether calls return the attitude too; the default is as in `solve`.
    compiled : bool
        Whether a C compiler translates a recorded torque, mostly within a second; the result is
        cached. Without a compiler the torque is interpreted (see `Solver.leaves`).

    Returns
    -------
    Solver
        A callable: ``solver(omega, t_end)`` returns omega (rad/s), shape (3,), at `t_end` (s); with
        `attitude`, also the quaternion, shape (4,). Under a torque that depends on the state, an
        initial omega above 2**300 or below 2**-300 rad/s is `refused`; `solve` accepts it.

    Raises
    ------
    InputError
        If the method is unknown, or can't solve the scene or its attitude; if the torque needs the
        attitude, and `attitude` is false; or if the tolerance or effort is out of range. A call
        raises it if a changing moment of inertia reaches 0; if a function gives the moment, the
        status is `overflow` instead.
    NotBuiltError
        If the extension is not built.

    Examples
    --------
    >>> import numpy as np
    >>> from pyharness import case_scene, prepare
    >>> solver = prepare(case_scene(2), tolerance=1e-12)
    >>> np.round(solver(np.array([0.0, 1.0, 10.0]), 1.0), 6) + 0.0
    array([-0.958924,  0.283662, 10.      ])
    """
    checked_scene(scene, any_axes=True, any_torque=True, any_state=True, changing=True)
    compiled = boolean("compiled", compiled)
    method = known("method", method, PREPARED)
    attitude = computes_attitude(scene, method, attitude, PREPARED_WITH_ATTITUDE)
    tolerance = requested_tolerance(method, tolerance)
    effort = checked_effort(effort)
    check_prepared(scene, method)
    check_torque(scene, method, attitude)
    chosen = plan(problem_of(scene, attitude).turned, method, tolerance, rows=attitude)
    return Solver(scene, chosen, tolerance, method, effort, attitude, compiled)
