"""A claim for the tests of sweeps."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.checks.compare.batch import Batch


def stays(batch: Batch) -> NDArray[Any]:
    """Return 1 if omega2 ends within a tenth of its initial value, 0 if not, 2 if that is 0."""
    before = batch.omega0[:, 1]
    holds = np.abs(batch.omega[:, 1] - before) <= 0.1 * np.abs(before)
    return np.where(before == 0.0, 2, holds)


CLAIMS = {"stays": stays}
