"""The base class of results for many bodies."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pyharness.model.extension import ENDS
from pyharness.model.shown import short_repr
from pyharness.model.trajectory import WITH_ALL_ROWS, Array

_RESULTS = [ENDS.index(ending) for ending in WITH_ALL_ROWS]


@dataclass(frozen=True, eq=False, repr=False)
class BatchResult:
    """The angular velocities of n bodies, and how the computation of each body ended.

    `omega` (rad/s), shape (n, ..., 3), is NaN where there is no result. `status`, shape (n,), has
    integers of `pyharness.model.codes.Statuses`.
    """

    omega: Array
    status: NDArray[np.int8]

    __repr__ = short_repr

    @property
    def ended(self) -> NDArray[np.str_]:
        """The statuses as text, such as "complete", shape (n,)."""
        return np.array(ENDS)[self.status]

    @property
    def has_result(self) -> NDArray[np.bool_]:
        """Whether all results of each body are present, shape (n,)."""
        return np.isin(self.status, _RESULTS)
