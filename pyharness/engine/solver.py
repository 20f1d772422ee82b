"""The class `Solver`: a scene prepared for one method, for many fast calls through C."""

import reprlib
from functools import cached_property, partial
from typing import TYPE_CHECKING, Self

import numpy as np

from pyharness.engine.last_call import LastCall
from pyharness.engine.many_starts import many_starts
from pyharness.engine.packed import packed_scene
from pyharness.engine.plan import RK4_OR_TAYLOR, Plan
from pyharness.engine.registry import FIXED_STEP
from pyharness.engine.system import is_recorded
from pyharness.model.codes import Methods, Places
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.trajectory import Array
from pyharness.model.values import (
    Triple,
    number,
    three_floats,
)

if TYPE_CHECKING:
    from pyharness._many import ManyStarts
    from pyharness._solver import BoundKernel
else:
    try:
        from pyharness._solver import BoundKernel
    except ImportError:  # not built: `extension` raises NotBuiltError when a solver is made
        BoundKernel = object

CODES = {
    "closed-form": Methods.CLOSED_FORM,
    "sphere": Methods.SPHERE,
    RK4_OR_TAYLOR: Methods.QUICK_OR_TAYLOR,
    "taylor": Methods.TAYLOR,
    **{name: getattr(Methods, name.upper().replace("-", "_")) for name in FIXED_STEP},
    "quick": Methods.QUICK,
    **{f"gauss-{stages}": Methods.GAUSS + stages for stages in range(1, 9)},
}
PREPARED = ("auto", *(name for name in CODES if name not in ("sphere", RK4_OR_TAYLOR)))

_FEW_WAVES = 16  # fewer waves take less time than releasing the GIL


class Solver(LastCall, BoundKernel):
    """A solver of a scene, prepared for one method by `prepare`.

    Call it as ``solver(omega0, t_end)`` or ``solver(omega0, t_end, out=out)``: three numbers
    (rad/s), and the final time (s), positive, negative or 0. A call returns omega (rad/s) at
    `t_end` as a new array of shape (3,), or in `out`, a contiguous array of three floats, which may
    be `omega0`. Invalid arguments raise an InputError and leave `out` unchanged. Calls are fastest
    with an array of floats.

    If the kernel could not finish, or an argument is not finite, the result is NaN and `status` has
    the reason.

    Threads may share a solver. The kernel releases the interpreter's lock (GIL), unless the
    solution takes less time than releasing it. Solvers can be copied and pickled, without the
    status of the last call.

    Attributes
    ----------
    plan : Plan
        The chosen method, and the parts that are computed, with reasons.
    status, error, growth, digits, steps, method
        Reports on this thread's last call.
    many : callable
        A function that solves from many initial angular velocities in one call.

    Examples
    --------
    >>> from pyharness import case_scene, prepare
    >>> solver = prepare(case_scene(1))
    >>> solver([1.0, 1.0, 1.0], 2.0)
    array([6., 6., 6.])
    >>> solver.status
    'complete'
    """

    packed: Array
    _packed_with_gil: Array | None

    # The base class binds a kernel to its data in C, because Python code in a call would take as
    # long as an easy solution.
    def __new__(cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0) -> Self:
        """Create a solver; users call `prepare` instead."""
        kernel = extension().solve_packed
        packed = packed_scene(chosen.scene, _code(chosen), tolerance, effort)
        packed_with_gil = None
        if chosen.closed_form and packed.size < Places.WAVES + 4 * _FEW_WAVES:
            # The call that keeps the GIL has no fallback, which may take long. If it fails, the
            # kernel is called again without the GIL.
            packed_with_gil = packed.copy()
            packed_with_gil[Places.METHOD] = CODES.get(chosen.closed_form, Methods.CLOSED_FORM)
        solver = super().__new__(cls, kernel, packed, _check, packed_with_gil)
        solver.plan = chosen
        solver.packed, solver._packed_with_gil = packed, packed_with_gil
        solver._given = tolerance, asked, effort
        return solver

    @cached_property
    def many(self) -> "ManyStarts":
        """Return the function that solves many initial omegas in one call.

        ``solver.many(omega0, t_end, threads=1, out=None)`` takes `omega0` (rad/s) of shape (n, 3),
        and `t_end` (s), a number or of shape (n,). It returns omega (rad/s), shape (n, 3), in `out`
        unless None, and the statuses of `Ensemble`, int8, shape (n,). A row does not depend on the
        others or on `threads`, but may differ by rounding from a single call. Invalid arguments
        raise an InputError.
        """
        from pyharness._many import ManyStarts

        slowly = partial(many_starts, self.packed)
        return ManyStarts(extension().solve_packed_many, self.packed, self._packed_with_gil, slowly)

    @property
    def method(self) -> str:
        """Return the name of the method of the last call.

        It is `plan.method`, unless the kernel chose `quick` or `taylor`, or used `plan.fallback`.
        """
        steps = self._counted()
        if not steps:
            return self.plan.method
        if self.plan.method == RK4_OR_TAYLOR:
            return "quick" if steps < 0 else "taylor"
        return self.plan.fallback or self.plan.method


def _check(omega0: object, t_end: object, out: object) -> tuple[Triple, float]:
    start, time = three_floats("omega0", omega0), number("t_end", t_end)
    if out is not None and (found := no_buffer(out)):
        raise InputError(f"out: {found}; allowed: a writable array of three float64 side by side")
    return start, time


def no_buffer(out: object) -> str:
    """Return a description of `out` if three floats can't be written into it, else ""."""
    if not isinstance(out, np.ndarray):
        try:
            return reprlib.repr(out)
        except ValueError:  # Python refuses to print an integer of too many digits
            return "a number of too many digits to be shown"
    flags = out.flags
    if out.dtype.char != "d" or not out.dtype.isnative or out.shape != (3,):
        return f"{out.dtype} of shape {out.shape}"
    if not flags.writeable:
        return "an array that is read-only"
    return "" if flags.c_contiguous and flags.aligned else f"an array with strides {out.strides}"


def _code(chosen: Plan) -> int:
    if is_recorded(chosen.scene):
        return Methods.TAPE
    if chosen.closed_form == "sphere":
        return CODES["sphere"]
    if chosen.method == "closed-form":
        # The closed form refuses a perturbation whose square underflows. The kernel then uses the
        # Taylor series, unless the closed form was requested.
        return Methods.CLOSED_FORM_OR_TAYLOR if chosen.fallback else CODES["closed-form"]
    return CODES[chosen.method]
