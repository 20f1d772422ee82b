"""Solvers: prepared once, called in a loop at little more than the cost of the kernel itself.

`prepare` validates the scene, decides what it needs (`plan`) and packs it; a call then looks at
three arguments and enters the kernel.
"""

import reprlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, Self, overload

import numpy as np

from pyharness.methods.plan import EITHER, FINEST, Plan, plan
from pyharness.methods.problem import known, normalized, remainders
from pyharness.methods.registry import GAUSS, check_torque
from pyharness.methods.sensitivity import closed_form_estimate, is_sensitive, motion_growth
from pyharness.model.codes import Methods, Places
from pyharness.model.effort import checked_effort
from pyharness.model.errors import InputError, unknown
from pyharness.model.extension import ENDS, extension
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.trajectory import WITH_ALL_ROWS, Array, Trajectory, digits_left
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
    from pyharness.methods.prepared_attitude import AttitudeSolver
else:
    try:
        from pyharness._solver import BoundKernel
    except ImportError:  # not built, as `extension` says when a solver is made
        BoundKernel = object

_CODES = {
    "closed-form": Methods.CLOSED_FORM,
    "sphere": Methods.SPHERE,
    EITHER: Methods.QUICK_OR_TAYLOR,
    "taylor": Methods.TAYLOR,
    "improved-euler": Methods.IMPROVED_EULER,
    "taylor-3": Methods.TAYLOR_3,
    "rk4": Methods.RK4,
    "quick": Methods.QUICK,
    **{f"gauss-{stages}": Methods.GAUSS + stages for stages in range(1, 9)},
}
PREPARED = ("auto", *(name for name in _CODES if name not in ("sphere", EITHER)))

_FEW_WAVES = 16  # that take less time than releasing the GIL does


class Solver(BoundKernel):
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

    # A kernel bound to its data, in C: a call goes from the interpreter into the kernel with no
    # Python between, which would cost as much as an easy solve.
    plan: Plan
    _given: tuple[float, str, float]  # tolerance, method and effort as asked for

    def __new__(cls, chosen: Plan, tolerance: float, asked: str, effort: float = 1.0) -> Self:
        """Pack what does not change; `prepare` is the way to make one."""
        kernel = extension().solve_packed
        packed = _pack(chosen.scene, _code(chosen), tolerance, effort)
        brief = None
        if chosen.closed_form and packed.size < Places.WAVES + 4 * _FEW_WAVES:
            # Where there is a fallback, it is no part of that.
            brief = packed.copy()
            brief[Places.METHOD] = _CODES.get(chosen.closed_form, Methods.CLOSED_FORM)
        solver = super().__new__(cls, kernel, packed, _check, brief)
        solver.plan = chosen
        solver._given = tolerance, asked, effort
        return solver

    def __reduce__(self) -> tuple[Any, ...]:
        """Let a copy, in this process or another, be prepared as this one was."""
        return type(self), (self.plan, *self._given)

    def __repr__(self) -> str:
        """Say the scene and the method."""
        return f"<Solver of '{self.plan.scene.name}' by {self.plan.method}>"

    @property
    def status(self) -> str:
        """How this thread's last call ended: complete, sensitive, overflow, refused or gave up.

        ``sensitive`` is a result too, but what the motion makes of rounding exceeds the tolerance:
        `digits` says what is left. A closed form and Gauss collocation work that out when they are
        asked, in microseconds and milliseconds. ``complete``, in 0 steps, before a call. What was
        refused at the door, or interrupted, is none.
        """
        return self._found()[0]

    @property
    def error(self) -> float | None:
        """Estimated error of this thread's last result, over the largest omega on the way.

        None where the method estimates none, and where there is no result.
        """
        return self._found()[1]

    @property
    def growth(self) -> float | None:
        """What the motion of this thread's last call makes of a small difference, at least 1.

        The largest norm of the derivative of omega at the end by omega at any time before; None
        where it is unknown.
        """
        return self._found()[2]

    @property
    def digits(self) -> float | None:
        """Decimal digits that are left of this thread's last result; None where unknown."""
        return digits_left(self.error)

    @property
    def steps(self) -> int:
        """Steps of this thread's last call; right-hand sides of Gauss, 0 of a closed form."""
        return abs(self._counted())

    @property
    def method(self) -> str:
        """The method of this thread's last call, where the kernel chose; else that of the plan."""
        steps = self._counted()
        if not steps:
            return self.plan.method
        if self.plan.method == EITHER:
            return "quick" if steps < 0 else "taylor"
        return self.plan.fallback or self.plan.method

    def _counted(self) -> int:
        """Return the steps of this thread's last call, as the kernel counts them."""
        ending = self._ending
        return 0 if ending is None else ending[1]

    def _found(self) -> tuple[str, float | None, float | None]:
        """Return status, error and growth of this thread's last call."""
        ending = self._ending
        if ending is None:
            return "complete", None, None
        number, steps, of_kernel, grown, omega0, t_end = ending
        status = ENDS[number]
        if status not in WITH_ALL_ROWS:
            return status, None, None
        error, growth = known(of_kernel), known(grown)
        scene = self.plan.scene
        if self.plan.closed_form and not steps:
            error, growth = closed_form_estimate(scene.euler_coefficients, omega0, t_end)
        elif self.plan.method in GAUSS:
            growth = motion_growth(replace(scene, omega=omega0), t_end)
        else:
            return status, error, growth
        return "sensitive" if is_sensitive(growth, self._given[0]) else status, error, growth

    def trajectory(self, omega0: Numbers, times: Number | Numbers) -> Trajectory:
        """Return rows from another start (rad/s) at `times` (s), strictly monotonic, on any side.

        InputError for a start that is not three finite numbers, or times out of order.
        """
        from pyharness.methods.registry import METHODS
        from pyharness.methods.solve import solve

        scene = replace(self.plan.scene, omega=three("omega0", omega0))
        tolerance, asked, effort = self._given
        method = "taylor" if asked == "quick" else asked
        # What was prepared in the scene's steps has no tolerance of its own.
        tolerance = max(tolerance, METHODS[method].finest)
        return solve(scene, times, method, tolerance, effort)


@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number = ...,
    effort: float = ...,
    attitude: Literal[False] = ...,
) -> Solver: ...
@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number = ...,
    effort: float = ...,
    *,
    attitude: Literal[True],
) -> "AttitudeSolver": ...
def prepare(
    scene: Scene,
    method: str = "auto",
    tolerance: Number = 1e-12,
    effort: float = 1.0,
    attitude: bool = False,
) -> "Solver | AttitudeSolver":
    """Prepare a solver of a scene.

    Parameters
    ----------
    scene : Scene
        Its step size is that of the methods with a fixed step.
    method : str
        A name in `PREPARED`; `auto` takes the fastest that meets the tolerance.
    tolerance : float
        Largest error of any component at the end, relative to the largest on the way; methods with
        a fixed step do not look at it. Where small differences grow by a factor K on the way, no
        method keeps less than some 1e-15 K.
    effort : float
        Factor on the work of a call, beyond which its status is `gave up`: 1 is some ten seconds.
    attitude : bool
        Whether calls give the attitude too; a torque about the axes of space needs it.

    Raises
    ------
    InputError
        For an unknown method, one that can't take the scene or carry its attitude, or a tolerance
        or an effort out of range.
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
    checked_scene(scene, any_torque=True)
    if not isinstance(method, str) or method not in PREPARED:
        raise unknown("method", method, PREPARED)
    tolerance = tolerance_of(tolerance, FINEST)
    effort = checked_effort(effort)
    check_torque(scene, method, attitude)
    if attitude:
        from pyharness.methods.prepared_attitude import prepared_attitude

        return prepared_attitude(scene, method, tolerance, effort)
    # Who does not ask for it pays nothing.
    scene = replace(scene, attitude=None)
    return Solver(plan(scene, method, tolerance), tolerance, method, effort)


def _check(omega0: object, t_end: object, out: object) -> tuple[Triple, float]:
    """Convert what a call was given and can't read at once; InputError for what is none."""
    start, time = three_floats("omega0", omega0), number("t_end", t_end)
    if out is not None and (found := _no_buffer(out)):
        raise InputError(f"out: {found}; allowed: a writable array of three float64 side by side")
    return start, time


def _no_buffer(out: object) -> str:
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
        return _CODES["sphere"]
    if chosen.method == "closed-form":
        # A disturbance too faint to square: then the series, if that is not against the order.
        return Methods.CLOSED_FORM_OR_TAYLOR if chosen.fallback else _CODES["closed-form"]
    return _CODES[chosen.method]


def _pack(scene: Scene, code: int, tolerance: float, effort: float) -> Array:
    coefficients, constant, rate, sines, cosines = normalized(scene)
    packed = np.zeros(Places.WAVES)
    packed[Places.METHOD] = code
    packed[Places.TOLERANCE] = tolerance
    packed[Places.STEP] = scene.step_size
    packed[Places.N_SINES] = sines.shape[1]
    packed[Places.N_COSINES] = cosines.shape[1]
    packed[Places.COEFFICIENTS : Places.CONSTANT] = coefficients
    packed[Places.CONSTANT : Places.RATE] = constant
    packed[Places.RATE : Places.EFFORT] = rate
    packed[Places.EFFORT] = effort
    packed[Places.COEFFICIENTS_LOW : Places.WAVES] = remainders(scene)
    return np.concatenate([packed, sines.T.ravel(), cosines.T.ravel()])
