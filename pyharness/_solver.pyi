from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pyharness.trajectory import Array

class BoundKernel:
    def __new__(
        cls,
        kernel: Callable[..., tuple[Array, int, int]],
        packed: Array,
        check: Callable[[object, object, object], tuple[Array, float]],
    ) -> Self: ...
    def __call__(
        self, omega0: Any, t_end: Any, *, out: Any = None
    ) -> Array: ...
    @property
    def _ending(self) -> tuple[int, int]: ...
