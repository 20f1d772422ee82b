"""Trajectories, which are the results of a method or a program for a scene."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Array as Array
from pyharness.model.changing import ChangingInertia, ChangingMoments
from pyharness.model.conversions import Conversions
from pyharness.model.mechanics import Mechanics
from pyharness.model.mechanics import turned_to_space as turned_to_space
from pyharness.model.shown import short_repr

if TYPE_CHECKING:
    from pyharness.model.dense_output import DenseOutput
    from pyharness.model.scene import Scene

# Largest relative rounding error of a number in binary64.
ROUNDING = 2.0**-53
# The ways to end a run (`Trajectory.ended`) with all requested rows present.
WITH_ALL_ROWS = ("complete", "sensitive", "unchecked")
ENDINGS = (*WITH_ALL_ROWS, "stopped", "overflow", "singular", "event")
STOP_VARIABLES = ("U1", "U2", "U3", "V1", "V2", "V3", "U", "UV")


@dataclass(frozen=True)
class Stop:
    """The point at which the Lipschitz test of the Runge-Kutta program ended a run.

    Attributes
    ----------
    step : int
        The number of the step, from 1. The last row of the trajectory is the result of this step.
    variable : str
        The variable that failed the test: `U1` to `U3` (omega), `V1` to `V3` (translational
        velocity), or a norm: `U` (of omega), `UV` (of omega and velocity together).
    quotient : float
        The Lipschitz quotient (1/s): the change of the derivative between two stages of the step,
        divided by the change of the variable. It is infinite if the variable did not change.

    Examples
    --------
    >>> from pyharness import case_scene, run_program, subset
    >>> stop = run_program(case_scene(2), subset("runge-kutta"), implementation="python").stop
    >>> stop.step, stop.variable
    (25, 'V2')
    """

    step: int
    variable: str
    quotient: float


@dataclass(frozen=True, eq=False)
class Trajectory(Mechanics, Conversions):
    """The results of an integration, one row for each time, and how the integration ended.

    Attributes
    ----------
    time : ndarray, shape (n,)
        The true time of each row, s.
    recorded_time : ndarray, shape (n,)
        The variable TIME that a program writes to its output file TAPE5, s. A defect may make it
        differ from `time`. For methods, the modern solvers of this package, it is the same as
        `time`.
    omega : ndarray, shape (n, 3)
        Angular velocity about the body axes, rad/s.
    velocity : ndarray, shape (n, 3), or None
        Translational velocity along the body axes, m/s. None if it was not computed.
    steps, evaluations : int
        The number of steps, and the number of evaluations of the right-hand side. SciPy's methods
        and the reference count their rows as steps.
    ended : {"complete", "sensitive", "unchecked", "stopped", "overflow", "singular", "event"}
        How the integration ended. "stopped" means that the Lipschitz test ended it. After an
        "overflow" the rows end before the first omega that is not finite, and if it is "singular"
        before a time at which a recorded torque is not defined (`reason`). "event" means that a
        terminal event ended it, and that rows after it are not present. In two cases all rows are
        present: "sensitive" means that the rounding error, amplified by the motion, exceeds the
        requested tolerance, and "unchecked" that a method of SciPy may have passed a short change
        of a recorded torque, because the series that bounds its steps does not reach the end.
    stop : Stop or None
        The point at which the Lipschitz test ended the run; None if the test did not end it.
    ier : ndarray of int, shape (n,), or None
        The error code of the linear solver in each step, as the collocation programs print it: 129
        for a singular matrix. None for other programs and for methods.
    error : float or None
        Estimated error of any component at the requested times, relative to the largest component
        of omega along the trajectory. None if the method does not estimate it, and after an
        overflow.
    growth : float or None
        The error amplification: the largest norm of the state-transition matrix of omega from any
        earlier time to the end. None if it is unknown.
    reason : str or None
        The time at which a recorded torque is not defined, and the operation; None if it is.
    attitude : ndarray, shape (n, 4), or None
        Quaternions from body to space, scalar first, with continuous signs. None if they were not
        requested.
    moments : tuple of three floats, ChangingMoments, ChangingInertia, or None
        Principal moments of the body, kg m2, or its inertia if that changes with time; None if the
        body has only coefficients.
    axes : ndarray, shape (3, 3), or None
        The principal axes, in columns; None if they are the body's own axes.
    exact : ndarray of object, shape (n, 8), or None
        Rows of a program that ran in another arithmetic than binary64: `time`, `recorded_time`,
        `omega` and `velocity` as numbers of this arithmetic. The attributes of these names have the
        nearest floats. None for binary64, and if there are no rows.
    tolerance : float or None
        The tolerance to which a method integrated the scene. None for programs and for methods
        with a fixed step, which have no tolerance.
    scene : Scene or None
        The scene that the function `solve` solved. None for programs.
    sol : DenseOutput or None
        The solution as a function of time, if it was requested. It is not saved in a file.
    t_events : list of ndarray, or None
        For each function of events the times (s) of its events, in the order of `time`; None if no
        events were requested.
    y_events : list of ndarray, or None
        For each function of events omega (rad/s), and the attitude if it was requested, with one
        row for each event: shape (k, 3) or (k, 7).
    sensitivities : dict of ndarray, or None
        The derivatives of omega (rad/s), and of the attitude's quaternion if it was requested, at
        `time` with respect to parameters. For each requested name the array has shape (n, 3, m) or
        (n, 7, m), where m is the number of values of the parameter.

    Examples
    --------
    >>> from pyharness import case_scene, solve
    >>> found = solve(case_scene(2), [0.5, 1.0])
    >>> found.ended, found.omega.shape
    ('complete', (2, 3))
    """

    time: Array
    recorded_time: Array
    omega: Array
    velocity: Array | None
    steps: int
    evaluations: int
    ended: str = "complete"
    stop: Stop | None = None
    ier: NDArray[np.int32] | None = None
    error: float | None = None
    growth: float | None = None
    reason: str | None = field(default=None, repr=False)
    attitude: Array | None = None
    moments: tuple[float, float, float] | ChangingMoments | ChangingInertia | None = None
    axes: Array | None = None
    exact: NDArray[np.object_] | None = None
    tolerance: float | None = None
    scene: "Scene | None" = field(default=None, repr=False)
    sol: "DenseOutput | None" = field(default=None, repr=False)
    t_events: list[Array] | None = field(default=None, repr=False)
    y_events: list[Array] | None = field(default=None, repr=False)
    sensitivities: dict[str, Array] | None = field(default=None, repr=False)

    __repr__ = short_repr

    @property
    def digits(self) -> float | None:
        """The number of correct decimal digits of omega; None if it is unknown.

        It is computed from the estimated relative error, the attribute `error`.
        """
        return digits_left(self.error)

    @property
    def has_all_rows(self) -> bool:
        """Whether all requested rows are present in the trajectory.

        A trajectory that is reported as sensitive has all rows too. In such a trajectory the
        amplified rounding error exceeds the tolerance.
        """
        return self.ended in WITH_ALL_ROWS


def digits_left(error: float | None) -> float | None:
    """Return the number of correct decimal digits of a result with the relative error `error`.

    It is at least 0, and at most 15.95, the number of digits of binary64. It is None if `error` is
    None.
    """
    return None if error is None else max(0.0, -math.log10(max(error, ROUNDING)))
