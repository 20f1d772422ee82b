"""The results of many bodies, and the arrays that they are written into."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pyharness.model.arrays import buffer_of
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.shown import short_repr
from pyharness.model.trajectory import WITH_ALL_ROWS, Array

_RESULTS = [ENDS.index(ending) for ending in WITH_ALL_ROWS]


@dataclass(frozen=True, eq=False)
class Ensemble:
    """The ends of many scenes.

    Attributes
    ----------
    omega : ndarray, shape (n, 3)
        Angular velocity about the body axes, rad/s; NaN where there is no result.
    status : ndarray of int8, shape (n,)
        How each ended: 0 complete, 2 overflow, 3 refused, 4 gave up, 6 sensitive, which is a result
        too.
    attitude : ndarray, shape (n, 4), or None
        Quaternions from body to space, scalar first; None where they were not asked for.
    """

    omega: Array
    status: NDArray[np.int8]
    attitude: Array | None = None

    @property
    def ended(self) -> NDArray[np.str_]:
        """How each ended, in words: complete, sensitive, overflow, refused, gave up."""
        return np.array(ENDS)[self.status]

    __repr__ = short_repr

    @property
    def has_result(self) -> NDArray[np.bool_]:
        """Where there is one."""
        return np.isin(self.status, _RESULTS)


def place_for(out: "Ensemble | Array | None", n: int, with_attitude: bool) -> Ensemble:
    """Return arrays for the results of n bodies; InputError for others than fit."""
    shape = (n, 3)
    if out is None or isinstance(out, np.ndarray):
        omega = np.empty(shape) if out is None else buffer_of("out", out, shape, "d")
        attitude = np.empty((n, 4)) if with_attitude else None
        return Ensemble(omega, np.empty(n, np.int8), attitude)
    if not isinstance(out, Ensemble):
        raise InputError("out: allowed: an Ensemble, or an array of float64")
    buffer_of("out.omega", out.omega, shape, "d")
    buffer_of("out.status", out.status, (n,), "b")
    if (out.attitude is None) == with_attitude:
        raise InputError("out.attitude: allowed: an array where attitude0 is given, else None")
    if out.attitude is not None:
        buffer_of("out.attitude", out.attitude, (n, 4), "d")
    return out
