from collections.abc import Callable
from typing import Any, Self

from pyharness.model.attitude import Quaternion, Rotation
from pyharness.model.trajectory import Array
from pyharness.model.values import Number, Numbers, Triple

SOLVE_AT: int

class BoundKernel:
    def __new__(
        cls,
        kernel: Callable[..., tuple[Array, int, int, Array]],
        packed: Array,
        check: Callable[[object, object, object], tuple[Triple, float]],
        packed_with_gil: Array | None = None,
    ) -> Self: ...
    def __call__(self, omega0: Numbers, t_end: Number, *, out: Array | None = None) -> Array: ...
    @property
    def capsule(self) -> Any: ...
    @property
    def _address(self) -> int: ...
    @property
    def _ending(self) -> tuple[int, int, float, float, Triple, float] | None: ...

class BoundAttitudeKernel:
    def __new__(
        cls,
        kernel: Callable[..., tuple[Array, int, int, Array]],
        packed: Array,
        check: Callable[[object, object, object], tuple[tuple[float, ...], float]],
        packed_with_gil: Array | None,
        attitude: Quaternion,
    ) -> Self: ...
    def __call__(
        self, omega0: Numbers, t_end: Number, attitude0: Numbers | Rotation | None = None
    ) -> tuple[Array, Array]: ...
    @property
    def capsule(self) -> Any: ...
    @property
    def _address(self) -> int: ...
    @property
    def _ending(self) -> tuple[int, int, float, float, Triple, float] | None: ...
