from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.trajectory import Array

class ManyStarts:
    def __new__(
        cls,
        kernel: Callable[..., int],
        packed: Array,
        packed_with_gil: Array | None,
        slowly: Callable[..., tuple[Array, NDArray[np.int8]]],
    ) -> ManyStarts: ...
    def __call__(
        self, omega: Any, t_end: Any, *, threads: int = 1, out: Array | None = None
    ) -> tuple[Array, NDArray[np.int8]]: ...
