"""Types for annotations: binary64 arrays, and values that may be None."""

from typing import TYPE_CHECKING, Any, Optional, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
T = TypeVar("T")
# A result that is None unless requested. Which arguments request it depends on the scene, so that
# type checkers can't know; with Any instead of None they accept `found.attitude[-1]`.
if TYPE_CHECKING:
    Maybe: TypeAlias = T | Any
else:
    Maybe = Optional
