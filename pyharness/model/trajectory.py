"""Trajectories, which are the results of a method or a program for a scene."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Array as Array
from pyharness.model.changing import Changing, ChangingInertia, ChangingMoments
from pyharness.model.conversions import Conversions
from pyharness.model.errors import InputError, unknown
from pyharness.model.shown import short_repr
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import Triple

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from pyharness.model.scene import Scene

# Largest relative rounding error of a number in binary64.
ROUNDING = 2.0**-53
# The ways to end a run (`Trajectory.ended`) with all requested rows present.
WITH_ALL_ROWS = ("complete", "sensitive")
ENDINGS = (*WITH_ALL_ROWS, "stopped", "overflow")
FRAMES = ("body", "space")
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
class Trajectory(Conversions):
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
        The number of steps, and the number of evaluations of the right-hand side.
    ended : {"complete", "sensitive", "stopped", "overflow"}
        How the integration ended. "stopped" means that the Lipschitz test ended it. After an
        "overflow" the rows end before the first omega that is not finite. "sensitive" means that
        all rows are present, but the rounding error, amplified by the motion, exceeds the requested
        tolerance.
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
    attitude: Array | None = None
    moments: tuple[float, float, float] | ChangingMoments | ChangingInertia | None = None
    axes: Array | None = None
    exact: NDArray[np.object_] | None = None
    tolerance: float | None = None
    scene: "Scene | None" = field(default=None, repr=False)

    __repr__ = short_repr

    def rotation(self) -> "Rotation":
        """Return the attitudes as SciPy rotations, which rotate vectors from body to space.

        Returns
        -------
        scipy.spatial.transform.Rotation
            One rotation for each row (time) of the trajectory.

        Raises
        ------
        InputError
            If the attitude was not requested.
        """
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self._attitudes()[:, [1, 2, 3, 0]])

    def angular_momentum(self, frame: str = "body") -> Array:
        """Return the angular momentum in each of n rows, about the axes of the body or of space.

        An inertia that changes with time is that at the time of the row.

        Parameters
        ----------
        frame : {"body", "space"}
            The axes of the components.

        Returns
        -------
        ndarray, shape (n, 3)
            The angular momentum, kg m2/s.

        Raises
        ------
        InputError
            If the body was specified without moments of inertia. Also for an unknown frame, or the
            axes of space if the attitude was not requested.
        """
        if frame not in FRAMES:
            raise unknown("frame", str(frame), FRAMES)
        momentum = self._momentum(self.omega)
        return momentum if frame == "body" else turned_to_space(self._attitudes(), momentum)

    def energy(self) -> Array:
        """Return the kinetic energy of the rotation in each of the n rows of the trajectory.

        An inertia that changes with time is that at the time of the row.

        Returns
        -------
        ndarray, shape (n,)
            The energy, J.

        Raises
        ------
        InputError
            If the body was specified without moments of inertia.
        """
        energy: Array = 0.5 * (self.omega * self._momentum(self.omega)).sum(axis=1)
        return energy

    def power(self) -> Array:
        """Return the power of the torque in each of the n rows of the trajectory.

        The power is the scalar product of the torque and omega. It is positive while the torque
        increases the kinetic energy of the body.

        Returns
        -------
        ndarray, shape (n,)
            The power, W. It is NaN where the torque is singular.

        Raises
        ------
        InputError
            If the body was specified without moments of inertia, or if the trajectory is not a
            result of the function `solve`.

        References
        ----------
        H. Goldstein, C. Poole and J. Safko, Classical Mechanics, 3rd edition, 2002, section 5.3.

        Examples
        --------
        >>> from pyharness import Scene, solve
        >>> from pyharness.torques import damping
        >>> scene = Scene("damped", (0, 0, 2), moments=(3, 2, 1), torque=damping(0.5))
        >>> solve(scene, [0.0, 2.0]).power().round(6)
        array([-2.      , -0.270671])
        """
        self._checked_moments()
        torque = self._scene_of_solve().torque
        if isinstance(torque, TorqueLaw):
            values = np.array([torque.at(time) for time in self.time.tolist()]).reshape(-1, 3)
            along = torque.in_space
            omega = turned_to_space(self._attitudes(), self.omega) if along else self.omega
        else:
            # A torque that does not depend on the attitude accepts any.
            needed = torque.needs_attitude
            attitudes = self._attitudes() if needed else np.eye(4)[[0] * len(self.time)]
            rows = zip(self.time.tolist(), self.omega.tolist(), attitudes.tolist(), strict=True)
            values = np.array([torque.at(*row) for row in rows]).reshape(-1, 3)
            omega = self.omega
        power: Array = (values * omega).sum(axis=1)
        return power

    def work(self) -> Array:
        """Return the work that the torque has done on the body from time 0 to each of the n rows.

        The work is the change of the kinetic energy since time 0. At negative times it has the
        opposite sign of the work from that time until time 0. The wheels of the ready term `wheels`
        are no part of the body; the energy of their motors is therefore not included.

        The work is computed as (omega - omega0) . I (omega + omega0) / 2, where I is the inertia
        and omega0 is omega at time 0. Unlike a difference of two energies, this product loses no
        digits to rounding where all components of omega have changed little. Its error is then that
        of omega, multiplied by the angular momentum.

        Returns
        -------
        ndarray, shape (n,)
            The work, J.

        Raises
        ------
        InputError
            If the body was specified without moments of inertia, if the inertia changes with time,
            or if the trajectory is not a result of the function `solve`.

        References
        ----------
        H. Goldstein, C. Poole and J. Safko, Classical Mechanics, 3rd edition, 2002, sections 1.1
        and 5.3.

        Examples
        --------
        >>> from pyharness import Scene, solve
        >>> from pyharness.torques import damping
        >>> scene = Scene("damped", (0, 0, 2), moments=(3, 2, 1), torque=damping(0.5))
        >>> solve(scene, [0.0, 2.0]).work().round(6)
        array([ 0.      , -1.729329])
        """
        if isinstance(self._checked_moments(), Changing):
            # The forces that change the inertia change the kinetic energy too.
            raise InputError(
                "work: the inertia changes with time; allowed: a constant inertia; `power` is "
                "available for both"
            )
        start = np.array(self._scene_of_solve().omega)
        work: Array = 0.5 * ((self.omega - start) * self._momentum(self.omega + start)).sum(axis=1)
        return work

    def _momentum(self, omega: Array) -> Array:
        """Return the product of the inertia (kg m2) and each row of `omega` (rad/s)."""
        moments = self._checked_moments()
        if isinstance(moments, Changing):
            return moments.momentum(self.time, omega)
        axes = np.eye(3) if self.axes is None else self.axes
        # The rounding of a matrix product may depend on the order of the elements in memory, which
        # a file does not preserve in full.
        ordered = np.ascontiguousarray(omega)
        momentum: Array = ((ordered @ axes) * np.array(moments)) @ axes.T
        return momentum

    def _checked_moments(self) -> Triple | ChangingMoments | ChangingInertia:
        if self.moments is None:
            raise InputError(
                "the body is given by coefficients, and the result needs its moments; give moments"
            )
        return self.moments

    def _scene_of_solve(self) -> "Scene":
        if self.scene is None:
            raise InputError(
                "the trajectory has no scene; allowed: a trajectory that solve has returned"
            )
        return self.scene

    def _attitudes(self) -> Array:
        if self.attitude is None:
            raise InputError("the trajectory has no attitude; request it with attitude=True")
        return self.attitude

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


def turned_to_space(attitude: Array, vectors: Array) -> Array:
    """Transform n vectors from body-axis components to components along the axes of space.

    `attitude` has a unit quaternion, from body to space, for each vector, shape (n, 4). `vectors`
    and the result have the shape (n, 3).
    """
    scalar, vector = attitude[:, :1], attitude[:, 1:]
    twice = 2.0 * np.cross(vector, vectors)
    return vectors + scalar * twice + np.cross(vector, twice)


def digits_left(error: float | None) -> float | None:
    """Return the number of correct decimal digits of a result with the relative error `error`.

    It is at least 0, and at most 15.95, the number of digits of binary64. It is None if `error` is
    None.
    """
    return None if error is None else max(0.0, -math.log10(max(error, ROUNDING)))
