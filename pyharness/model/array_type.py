"""The type of the arrays of numbers in binary64, for annotations."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
