"""What stands for a claim in the tests."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.methods.batch import Batch

CLAIMS = {"stays": "tests.ensembles.claims:stays"}


def stays(batch: Batch) -> NDArray[Any]:
    """Whether the middle component is at the end what it was, to a tenth; silent where it was 0."""
    before = batch.omega0[:, 1]
    holds = np.abs(batch.omega[:, 1] - before) <= 0.1 * np.abs(before)
    return np.where(before == 0.0, 2, holds)
