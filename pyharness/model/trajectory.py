"""Trajectories: what a method makes of a scene."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
    ended : {"complete", "stopped", "overflow"}
        Why it ended; after an overflow the rows end before the first omega that is not finite.
    stop : Stop or None
        What the Lipschitz test found.
    ier : ndarray of int, shape (n,), or None
        IER as the collocation programs print it.
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
