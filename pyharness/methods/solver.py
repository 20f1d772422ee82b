"""A solver: a scene prepared for one method, in C for calls in a loop."""

import reprlib
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Self

import numpy as np

from pyharness.methods.last_call import LastCall
from pyharness.methods.many_starts import many_starts
from pyharness.methods.packed import packed_scene
from pyharness.methods.plan import RK4_OR_TAYLOR, Plan
from pyharness.model.codes import Methods, Places
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.model.values import (
    Number,
    Numbers,
    Triple,
    number,
    three,
    three_floats,
)

if TYPE_CHECKING:
    from pyharness._many import ManyStarts
    from pyharness._solver import BoundKernel
else:
    try:
        from pyharness._solver import BoundKernel
    except ImportError:  # not built, as `extension` says when a solver is made
        BoundKernel = object

CODES = {
    "closed-form": Methods.CLOSED_FORM,
    "sphere": Methods.SPHERE,
    RK4_OR_TAYLOR: Methods.QUICK_OR_TAYLOR,
    "taylor": Methods.TAYLOR,
    "improved-euler": Methods.IMPROVED_EULER,
    "taylor-3": Methods.TAYLOR_3,
    "rk4": Methods.RK4,
    "quick": Methods.QUICK,
    **{f"gauss-{stages}": Methods.GAUSS + stages for stages in range(1, 9)},
}
PREPARED = ("auto", *(name for name in CODES if name not in ("sphere", RK4_OR_TAYLOR)))

_FEW_WAVES = 16  # that take less time than releasing the GIL does


class Solver(LastCall, BoundKernel):
    """A scene prepared for one method.

    Call it as ``solver(omega0, t_end)``: `omega0` three real numbers (rad/s), `t_end` one, in
    seconds on either side of 0. It returns the angular velocity at `t_end`, a new array of shape
    (3,); or ``solver(omega0, t_end, out=array)`` writes it into an array of three floats that lie
    side by side, which may be `omega0` itself, and returns that. What is none of these is refused
    with an InputError, and `out` stays as it was. Fastest is an array of floats for `omega0`.

    Where the kernel could not finish the result is NaN and `status` says why; so it is from a
    start, or to a time, that is not finite. `error`, `growth` and `digits` say how good it is.

    Threads may share a solver and call it at once: the kernel releases the GIL, but where it takes
    less time than that, as a closed form does. Solvers can be
    copied and pickled; a copy has made no call yet.

    Attributes
    ----------
    plan : Plan
        What was decided, and why.
    """

    _packed: Array
    _packed_with_gil: Array | None

    # A kernel bound to its data, in C: a call goes from the interpreter into the kernel with no
    # Python between, which would cost as much as an easy solve.
    def __new__(cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0) -> Self:
        """Pack what does not change; `prepare` is the way to make one."""
        kernel = extension().solve_packed
        packed = packed_scene(chosen.scene, _code(chosen), tolerance, effort)
        packed_with_gil = None
        if chosen.closed_form and packed.size < Places.WAVES + 4 * _FEW_WAVES:
            # Where there is a fallback, it is no part of that.
            packed_with_gil = packed.copy()
            packed_with_gil[Places.METHOD] = CODES.get(chosen.closed_form, Methods.CLOSED_FORM)
        solver = super().__new__(cls, kernel, packed, _check, packed_with_gil)
        solver.plan = chosen
        solver._packed, solver._packed_with_gil = packed, packed_with_gil
        solver._given = tolerance, asked, effort
        return solver

    @cached_property
    def many(self) -> "ManyStarts":
        """Solve many starts in one call: ``solver.many(omega0, t_end, threads=1, out=None)``.

        `omega0` has shape (n, 3), `t_end` is a number or has shape (n,); returned are omega, shape
        (n, 3), which may be `out`, and the status of each, int8: see `Ensemble`. Each result
        depends on its own start and time alone, whatever the number of starts, their order and the
        threads. It keeps the same tolerance as a call of the solver, but with other roundings, for
        a single start too. An InputError refuses any other argument.
        """
        from pyharness._many import ManyStarts

        slowly = partial(many_starts, self._packed)
        return ManyStarts(
            extension().solve_packed_many, self._packed, self._packed_with_gil, slowly
        )

    @property
    def method(self) -> str:
        """The method of this thread's last call, where the kernel chose; else that of the plan."""
        steps = self._counted()
        if not steps:
            return self.plan.method
        if self.plan.method == RK4_OR_TAYLOR:
            return "quick" if steps < 0 else "taylor"
        return self.plan.fallback or self.plan.method

    def trajectory(self, omega0: Numbers, times: Number | Numbers) -> Trajectory:
        """Return rows from another start (rad/s) at `times` (s), strictly monotonic, on any side.

        InputError for a start that is not three finite numbers, or times out of order.
        """
        return self._rows(replace(self.plan.scene, omega=three("omega0", omega0)), times)

    def _rows(self, scene: Scene, times: Number | Numbers) -> Trajectory:
        from pyharness.methods.registry import METHODS
        from pyharness.methods.solve import solve

        tolerance, asked, effort = self._given
        method = "taylor" if asked == "quick" else asked
        # What was prepared in the scene's steps has no tolerance of its own.
        tolerance = max(tolerance, METHODS[method].finest)
        return solve(scene, times, method, tolerance, effort)


def _check(omega0: object, t_end: object, out: object) -> tuple[Triple, float]:
    """Convert what a call was given and can't read at once; InputError for what is none."""
    start, time = three_floats("omega0", omega0), number("t_end", t_end)
    if out is not None and (found := no_buffer(out)):
        raise InputError(f"out: {found}; allowed: a writable array of three float64 side by side")
    return start, time


def no_buffer(out: object) -> str:
    """Say what keeps `out` from being written to; nothing where nothing does."""
    if not isinstance(out, np.ndarray):
        try:
            return reprlib.repr(out)
        except ValueError:  # Python writes no whole number of many digits
            return "a number of too many digits to be shown"
    flags = out.flags
    if out.dtype.char != "d" or not out.dtype.isnative or out.shape != (3,):
        return f"{out.dtype} of shape {out.shape}"
    if not flags.writeable:
        return "an array that is read-only"
    return "" if flags.c_contiguous and flags.aligned else f"an array with strides {out.strides}"


def _code(chosen: Plan) -> int:
    """Return the number by which the kernel knows what was decided."""
    if chosen.closed_form == "sphere":
        return CODES["sphere"]
    if chosen.method == "closed-form":
        # A disturbance too faint to square: then the series, if that is not against the order.
        return Methods.CLOSED_FORM_OR_TAYLOR if chosen.fallback else CODES["closed-form"]
    return CODES[chosen.method]
