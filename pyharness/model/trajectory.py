"""Trajectories: what a method makes of a scene."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pyharness.model.errors import InputError, unknown
from pyharness.model.shown import short_repr

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

# Of a number in binary64, relative.
ROUNDING = 2.0**-53
# Endings with every row that was asked for.
WITH_ALL_ROWS = ("complete", "sensitive")
FRAMES = ("body", "space")
STOP_VARIABLES = ("U1", "U2", "U3", "V1", "V2", "V3", "U", "UV")


@dataclass(frozen=True)
class Stop:
    """Where the Lipschitz test of the Runge-Kutta program ended a run.

    Attributes
    ----------
    step : int
        The step, from 1; its row is the last one.
    variable : str
        `U1` ... `V3`, or `U`, `UV` for the norms.
    quotient : float
        Change of K over change of U (1/s); infinite where U did not change.
    """

    step: int
    variable: str
    quotient: float


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Rows of results, and how they came about.

    Attributes
    ----------
    time : ndarray, shape (n,)
        True time, s.
    recorded_time : ndarray, shape (n,)
        The TIME that TAPE5 got, s; for other methods the same as `time`.
    omega : ndarray, shape (n, 3)
        Angular velocity about the body axes, rad/s.
    velocity : ndarray, shape (n, 3), or None
        Velocity along the body axes, m/s.
    steps, evaluations : int
        Steps taken, and right-hand sides evaluated.
    ended : {"complete", "sensitive", "stopped", "overflow"}
        Why it ended; after an overflow the rows end before the first omega that is not finite.
        Sensitive: every row is there, but what the motion makes of rounding exceeds the tolerance.
    stop : Stop or None
        What the Lipschitz test found.
    ier : ndarray of int, shape (n,), or None
        IER as the collocation programs print it.
    error : float or None
        Estimated error of any component at the times asked for, over the largest of omega on the
        way; None where the method estimates none, and after an overflow.
    tolerance : float or None
        The tolerance to which a method solved the scene; None for a program and for a method with
        a fixed step, which take none.
    growth : float or None
        Largest norm of the derivative of omega at the end by omega at any time before; None where
        it is unknown.
    attitude : ndarray, shape (n, 4), or None
        Quaternions from body to space, scalar first, their signs continuous; None where they were
        not asked for.
    moments : tuple of three floats, or None
        Of the body, kg m2; None where it has only coefficients.
    axes : ndarray, shape (3, 3), or None
        The axes of those moments, in columns; None where they are the body's own.
    exact : ndarray of object, shape (n, 8), or None
        Where a program ran in another word, and has rows: `time`, `recorded_time`, `omega` and
        `velocity` in its own numbers, of which these here are the nearest floats.
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
    moments: tuple[float, float, float] | None = None
    axes: Array | None = None
    exact: NDArray[np.object_] | None = None
    tolerance: float | None = None

    __repr__ = short_repr

    def rotation(self) -> "Rotation":
        """Return the attitudes as rotations of SciPy, which turn vectors from body to space.

        InputError where the attitude was not asked for.
        """
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self._attitudes()[:, [1, 2, 3, 0]])

    def angular_momentum(self, frame: str = "body") -> Array:
        """Return the angular momentum about the axes of `body` or `space`, shape (n, 3), kg m2/s.

        InputError for a body without moments, an unknown frame, or one in space whose attitude was
        not asked for.
        """
        if frame not in FRAMES:
            raise unknown("frame", str(frame), FRAMES)
        momentum = self._momentum()
        return momentum if frame == "body" else turned_to_space(self._attitudes(), momentum)

    def energy(self) -> Array:
        """Return the kinetic energy of the rotation, shape (n,), J.

        InputError for a body without moments.
        """
        energy: Array = 0.5 * (self.omega * self._momentum()).sum(axis=1)
        return energy

    def _momentum(self) -> Array:
        if self.moments is None:
            raise InputError("the body is given by coefficients; it takes moments to say that")
        axes = np.eye(3) if self.axes is None else self.axes
        momentum: Array = ((self.omega @ axes) * np.array(self.moments)) @ axes.T
        return momentum

    def _attitudes(self) -> Array:
        if self.attitude is None:
            raise InputError("the trajectory has no attitude; ask for it: attitude=True")
        return self.attitude

    @property
    def digits(self) -> float | None:
        """Decimal digits that are left at the end; None where the error is unknown."""
        return digits_left(self.error)

    @property
    def has_all_rows(self) -> bool:
        """Whether every row that was asked for is there, though it may be sensitive."""
        return self.ended in WITH_ALL_ROWS


def turned_to_space(attitude: Array, vectors: Array) -> Array:
    """Return vectors of the body, shape (n, 3), about the axes of space."""
    scalar, vector = attitude[:, :1], attitude[:, 1:]
    twice = 2.0 * np.cross(vector, vectors)
    return vectors + scalar * twice + np.cross(vector, twice)


def digits_left(error: float | None) -> float | None:
    """Return how many decimal digits an error (relative) leaves: 0 to 15.95, those of binary64."""
    return None if error is None else max(0.0, -math.log10(max(error, ROUNDING)))
