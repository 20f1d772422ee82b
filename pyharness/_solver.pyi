from collections.abc import Callable, Iterable
from typing import Self, SupportsFloat, SupportsIndex

from pyharness.scene import Triple
from pyharness.trajectory import Array

Number = SupportsFloat | SupportsIndex
Numbers = Iterable[Number]

class BoundKernel:
    def __new__(
        cls,
        kernel: Callable[..., tuple[Array, int, int]],
        packed: Array,
        check: Callable[[object, object, object], tuple[Triple, float]],
    ) -> Self: ...
    def __call__(self, omega0: Numbers, t_end: Number, *, out: Array | None = None) -> Array: ...
    @property
    def _ending(self) -> tuple[int, int]: ...
