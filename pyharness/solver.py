"""Solvers: prepared once, called in a loop at little more than the cost of the kernel itself.

`prepare` validates the scene, decides what it needs (`plan`) and packs it; a call then converts
three arguments and enters the kernel. `solve` is the same for one use, with rows at many times.
"""

from functools import partial
from typing import Self

import numpy as np

from pyharness.errors import unknown
from pyharness.kernels import ENDS, extension, normalized
from pyharness.plan import EITHER, FINEST, Plan, plan
from pyharness.scene import Scene, checked_scene
from pyharness.trajectory import Array, Trajectory
from pyharness.values import Number, Numbers, three, tolerance_of

# Places in the packed array: see fortran/modern/prepared.f90.
_STATUS_AT, _STEPS_AT, _WAVES_AT = 14, 15, 16
_CODES = {
    "closed-form": 1,
    "sphere": 2,
    "taylor": 3,
    "improved-euler": 4,
    "taylor-3": 5,
    "rk4": 6,
    "quick": 7,
    EITHER: 8,
    **{f"gauss-{stages}": 10 + stages for stages in range(1, 9)},
}
_FREE_OR_SERIES = 9
PREPARED = (
    "auto",
    "closed-form",
    *(name for name in _CODES if name not in ("closed-form", "sphere", EITHER)),
)


class Solver(partial[Array]):
    """A scene prepared for one method; a solver belongs to one thread, its buffers are its own.

    Call it as ``solver(omega0, t_end)``: `omega0` an array of three floats (rad/s), `t_end` in
    seconds on either side of 0. It returns the angular velocity at `t_end`, an array of shape
    (3,) that the next call overwrites: copy what you keep. Nothing is checked in a call; where
    the kernel could not finish the result is NaN and `status` says why.

    Attributes
    ----------
    plan : Plan
        What was decided, and why.
    """

    # A partial of the kernel: a call goes from the interpreter into the kernel with no Python
    # between, which would cost as much as an easy solve.
    plan: Plan
    _scene: Scene
    _tolerance: float
    _asked: str

    def __new__(cls, scene: Scene, chosen: Plan, tolerance: float, asked: str) -> Self:
        """Pack what does not change; `prepare` is the way to make one."""
        packed = _pack(scene, _code(chosen, asked), tolerance)
        solver = super().__new__(cls, extension().solve_packed, packed, np.empty(3))
        solver.plan = chosen
        solver._scene = scene
        solver._tolerance = tolerance
        solver._asked = asked
        return solver

    def __repr__(self) -> str:
        """Say the scene and the method."""
        return f"<Solver of '{self._scene.name}' by {self.plan.method}>"

    @property
    def status(self) -> str:
        """How the last call ended: complete, overflow, refused or gave up."""
        return ENDS[int(self.args[0][_STATUS_AT])]

    @property
    def steps(self) -> int:
        """Steps of the last call (right-hand sides of Gauss collocation), 0 of a closed form."""
        return int(self.args[0][_STEPS_AT])

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

        from pyharness.methods import solve as solve_by_name

        scene = replace(self._scene, omega=three("omega0", omega0))
        method = "taylor" if self._asked == "quick" else self._asked
        return solve_by_name(scene, times, method, self._tolerance)


def prepare(scene: Scene, method: str = "auto", tolerance: Number = 1e-12) -> Solver:
    """Prepare a solver.

    Parameters
    ----------
    scene : Scene
        What to solve. Its step size is that of the methods with a fixed step.
    method : str
        A name in `PREPARED`; `auto` takes the fastest that meets the tolerance.
    tolerance : float
        Largest error at the end over the largest angular velocity on the way; the methods with
        a fixed step do not look at it. Where small differences grow by a factor K on the way, no
        method keeps less than some 1e-15 K.

    Returns
    -------
    Solver
        Ready to be called.

    Raises
    ------
    InputError
        For an unknown method, one that can't take the scene, or a tolerance out of range.
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
    return Solver(scene, plan(scene, method, tolerance), tolerance, method)


def solve(
    scene: Scene, times: Number | Numbers, method: str = "auto", tolerance: Number = 1e-12
) -> Trajectory:
    """Solve a scene.

    Parameters
    ----------
    scene : Scene
        What to solve.
    times : float or iterable of float, shape (n,)
        Where the result is wanted (s): strictly monotonic. On both sides of 0 the scene is solved
        twice, from 0 backward and from 0 forward.
    method : str
        A name in `pyharness.methods.METHODS`.
    tolerance : float
        Largest error at `times`, relative to the largest angular velocity.

    Returns
    -------
    Trajectory
        One row per time, in the order of `times`; fewer where the solution overflows: those between
        0 and the overflow, on either side. Steps and evaluations are of both sides together.

    Raises
    ------
    InputError
        For an unknown method, one that can't take the scene, times out of order, or a tolerance
        that the method can't meet.

    Examples
    --------
    >>> from pyharness import case_scene, solve
    >>> solve(case_scene(1), [1.0, 2.0]).omega
    array([[3.5, 3.5, 3.5],
           [6. , 6. , 6. ]])
    """
    from pyharness.methods import solve as solve_by_name

    return solve_by_name(scene, times, method, tolerance)


def _code(chosen: Plan, asked: str) -> int:
    """Return the number by which the kernel knows what was decided."""
    if chosen.method == "closed-form":
        if chosen.closed_form == "sphere":
            return _CODES["sphere"]
        # A disturbance too faint to square: then the series, if that is not against the order.
        return _FREE_OR_SERIES if asked == "auto" else _CODES["closed-form"]
    return _CODES[chosen.method]


def _pack(scene: Scene, code: int, tolerance: float) -> Array:
    coefficients, constant, rate, sines, cosines = normalized(scene)
    # A wave without amplitude has no effect, and would cost its sine and cosine.
    sines, cosines = (waves[:, waves[:3].any(axis=0)] for waves in (sines, cosines))
    # Four places more than the waves need: the kernel names where the cosines would begin.
    packed = np.zeros(_WAVES_AT + sines.size + cosines.size + 4)
    packed[0] = code
    packed[1:5] = tolerance, scene.step_size, sines.shape[1], cosines.shape[1]
    packed[5:14] = np.concatenate([coefficients, constant, rate])
    packed[_WAVES_AT : _WAVES_AT + sines.size] = sines.T.ravel()
    packed[_WAVES_AT + sines.size : -4] = cosines.T.ravel()
    return packed
