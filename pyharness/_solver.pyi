from collections.abc import Callable
from typing import Any, Generic, Self

from typing_extensions import TypeVar

from pyharness.model.attitude import Quaternion, Rotation
from pyharness.model.trajectory import Array
from pyharness.model.values import Number, Numbers, Triple

SOLVE_AT: int
Result = TypeVar("Result", default=Array)

class BoundKernel(Generic[Result]):
    def __new__(
        cls,
        kernel: Callable[..., tuple[Array, int, int, Array]],
        packed: Array,
        check: Callable[[object, object, object], tuple[tuple[float, ...], float]],
        packed_with_gil: Array | None = None,
        attitude: Quaternion | None = None,
        span: tuple[float, float] = ...,
        axes: tuple[tuple[Array, ...], Quaternion] | None = None,
    ) -> Self: ...
    def __call__(
        self,
        omega: Numbers,
        t_end: Number,
        attitude: Numbers | Rotation | None = None,
        *,
        out: Array | None = None,
    ) -> Result: ...
    @property
    def capsule(self) -> Any: ...
    @property
    def _address(self) -> int: ...
    @property
    def _ending(self) -> tuple[int, int, float, float, float, Triple, float] | None: ...
