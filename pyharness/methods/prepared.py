"""Solvers: prepared once, called in a loop at little more than the cost of the kernel itself.

`prepare` validates the scene, decides what it needs (`plan`) and packs it; a call then looks at
three arguments and enters the kernel.
"""

import reprlib
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from pyharness.methods.plan import EITHER, FINEST, Plan, plan
from pyharness.methods.problem import normalized
from pyharness.model.codes import Methods, Places
from pyharness.model.effort import checked_effort
from pyharness.model.errors import InputError, unknown
from pyharness.model.extension import ENDS, extension
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.model.values import (
    Number,
    Numbers,
    Triple,
    number,
    three,
    three_floats,
    tolerance_of,
)

if TYPE_CHECKING:
    from pyharness._solver import BoundKernel
else:
    try:
        from pyharness._solver import BoundKernel
    except ImportError:  # not built, as `extension` says when a solver is made
        BoundKernel = object

_CODES = {
    "closed-form": Methods.CLOSED_FORM,
    "sphere": Methods.SPHERE,
    "taylor": Methods.TAYLOR,
    "improved-euler": Methods.IMPROVED_EULER,
    "taylor-3": Methods.TAYLOR_3,
    "rk4": Methods.RK4,
    "quick": Methods.QUICK,
    EITHER: Methods.QUICK_OR_TAYLOR,
    **{f"gauss-{stages}": Methods.GAUSS + stages for stages in range(1, 9)},
}
PREPARED = (
    "auto",
    "closed-form",
    *(name for name in _CODES if name not in ("closed-form", "sphere", EITHER)),
)


class Solver(BoundKernel):
    """A scene prepared for one method.

    Call it as ``solver(omega0, t_end)``: `omega0` three real numbers (rad/s), `t_end` one, in
    seconds on either side of 0. It returns the angular velocity at `t_end`, a new array of shape
    (3,); or ``solver(omega0, t_end, out=array)`` writes it into an array of three floats that lie
    side by side, which may be `omega0` itself, and returns that. What is none of these is refused
    with an InputError, and `out` stays as it was. Fastest is an array of floats for `omega0`.

    Where the kernel could not finish the result is NaN and `status` says why; so it is from a
    start, or to a time, that is not finite.

    Threads may share a solver and call it at once: the kernel releases the GIL. Solvers can be
    copied and pickled; a copy has made no call yet.

    Attributes
    ----------
    plan : Plan
        What was decided, and why.
    """

    # A kernel bound to its data, in C: a call goes from the interpreter into the kernel with no
    # Python between, which would cost as much as an easy solve.
    plan: Plan
    _tolerance: float
    _effort: float
    _asked: str

    def __new__(cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0) -> Self:
        """Pack what does not change; `prepare` is the way to make one."""
        kernel = extension().solve_packed
        packed = _pack(chosen.scene, _code(chosen), tolerance, effort)
        solver = super().__new__(cls, kernel, packed, _check)
        solver.plan = chosen
        solver._tolerance = tolerance
        solver._effort = effort
        solver._asked = asked
        return solver

    def __reduce__(self) -> tuple[Any, ...]:
        """Let a copy, in this process or another, be prepared as this one was."""
        given = (self.plan, self._tolerance, self._asked, self._effort)
        return type(self), given

    def __repr__(self) -> str:
        """Say the scene and the method."""
        return f"<Solver of '{self.plan.scene.name}' by {self.plan.method}>"

    @property
    def status(self) -> str:
        """How this thread's last call ended: complete, overflow, refused or gave up.

        ``complete``, in 0 steps, where this thread has made none. A call that was refused at the
        door, or interrupted, is not counted.
        """
        return ENDS[self._ending[0]]

    @property
    def steps(self) -> int:
        """Steps of this thread's last call (right-hand sides of Gauss collocation).

        0 of a closed form.
        """
        return abs(self._ending[1])

    @property
    def method(self) -> str:
        """The method that solved this thread's last call, where the kernel had a choice.

        Else, and before a call, that of the plan.
        """
        steps = self._ending[1]
        if not steps:
            return self.plan.method
        if self.plan.method == EITHER:
            return "quick" if steps < 0 else "taylor"
        return self.plan.fallback or self.plan.method

    def trajectory(self, omega0: Numbers, times: Number | Numbers) -> Trajectory:
        """Return rows at `times` from another start.

        Parameters
        ----------
        omega0 : sequence of three floats
            rad/s.
        times : float or iterable of float, shape (n,)
            s; strictly monotonic, also on both sides of 0.

        Raises
        ------
        InputError
            For a start that is not three finite numbers, or times out of order.
        """
        from dataclasses import replace

        from pyharness.methods.registry import METHODS
        from pyharness.methods.solve import solve

        scene = replace(self.plan.scene, omega=three("omega0", omega0))
        method = "taylor" if self._asked == "quick" else self._asked
        # What was prepared in the scene's steps has no tolerance of its own.
        tolerance = max(self._tolerance, METHODS[method].finest)
        return solve(scene, times, method, tolerance, self._effort)


def prepare(
    scene: Scene, method: str = "auto", tolerance: Number = 1e-12, effort: float = 1.0
) -> Solver:
    """Prepare a solver.

    Parameters
    ----------
    scene : Scene
        What to solve. Its step size is that of the methods with a fixed step.
    method : str
        A name in `PREPARED`; `auto` takes the fastest that meets the tolerance.
    tolerance : float
        Largest error of any component at the end, relative to the largest on the way; methods with
        a fixed step do not look at it. Where small differences grow by a factor K on the way, no
        method keeps less than some 1e-15 K.
    effort : float
        Factor on the work of a call, beyond which its status is `gave up`: 1 is some ten seconds.

    Returns
    -------
    Solver
        Ready to be called.

    Raises
    ------
    InputError
        For an unknown method, one that can't take the scene, or a tolerance or an effort out of
        range.
    NotBuiltError
        Where the extension is not built.

    Examples
    --------
    >>> import numpy as np
    >>> from pyharness import case_scene, prepare
    >>> solver = prepare(case_scene(2), tolerance=1e-12)
    >>> np.round(solver(np.array([0.0, 1.0, 10.0]), 1.0), 6) + 0.0
    array([-0.958924,  0.283662, 10.      ])
    """
    checked_scene(scene)
    if not isinstance(method, str) or method not in PREPARED:
        raise unknown("method", method, PREPARED)
    tolerance = tolerance_of(tolerance, FINEST)
    effort = checked_effort(effort)
    return Solver(plan(scene, method, tolerance), tolerance, method, effort)


def _check(omega0: object, t_end: object, out: object) -> tuple[Triple, float]:
    """Convert what a call was given and can't read at once.

    Raises
    ------
    InputError
        For what is no start, no time or no buffer.
    """
    start, time = three_floats("omega0", omega0), number("t_end", t_end)
    if out is not None:
        _check_buffer(out)
    return start, time


def _check_buffer(out: Any) -> None:
    allowed = "a writable array of three float64 side by side"
    if not isinstance(out, np.ndarray):
        raise _refused("out", out, allowed)
    flags = out.flags
    if out.dtype.char != "d" or not out.dtype.isnative or out.shape != (3,):
        raise InputError(f"out: {out.dtype} of shape {out.shape}; allowed: {allowed}")
    if not flags.writeable:
        raise InputError(f"out: an array that is read-only; allowed: {allowed}")
    if not (flags.c_contiguous and flags.aligned):
        raise InputError(f"out: an array with strides {out.strides}; allowed: {allowed}")


def _refused(where: str, value: object, allowed: str) -> InputError:
    try:
        shown = reprlib.repr(value)
    except ValueError:  # Python writes no whole number of many digits
        shown = "a number of too many digits to be shown"
    return InputError(f"{where}: {shown}; allowed: {allowed}")


def _code(chosen: Plan) -> int:
    """Return the number by which the kernel knows what was decided."""
    if chosen.method == "closed-form":
        if chosen.closed_form == "sphere":
            return _CODES["sphere"]
        # A disturbance too faint to square: then the series, if that is not against the order.
        return Methods.CLOSED_FORM_OR_TAYLOR if chosen.fallback else _CODES["closed-form"]
    return _CODES[chosen.method]


def _pack(scene: Scene, code: int, tolerance: float, effort: float) -> Array:
    coefficients, constant, rate, sines, cosines = normalized(scene)
    packed = np.zeros(Places.WAVES + sines.size + cosines.size)
    packed[Places.METHOD] = code
    packed[Places.TOLERANCE] = tolerance
    packed[Places.STEP] = scene.step_size
    packed[Places.N_SINES] = sines.shape[1]
    packed[Places.N_COSINES] = cosines.shape[1]
    packed[Places.EFFORT] = effort
    for place, values in (
        (Places.COEFFICIENTS, coefficients),
        (Places.CONSTANT, constant),
        (Places.RATE, rate),
        (Places.WAVES, sines.T.ravel()),
        (Places.WAVES + sines.size, cosines.T.ravel()),
    ):
        packed[place : place + values.size] = values
    return packed
