"""Dual numbers: values with their derivatives, by forward differentiation."""

from collections.abc import Sequence
from typing import Any


class Dual:
    """A value in any arithmetic, with its derivatives with respect to some unknowns."""

    def __init__(self, value: Any, slopes: Sequence[Any]) -> None:
        self.value, self.slopes = value, slopes

    def chained(self, value: Any, slope: Any) -> "Dual":
        """Return a function of this number, from its value and its derivative (chain rule)."""
        return Dual(value, [slope * each for each in self.slopes])

    def __add__(self, other: Any) -> "Dual":
        """Return the sum with any number."""
        second = dual(other, len(self.slopes))
        slopes = [x + y for x, y in zip(self.slopes, second.slopes, strict=True)]
        return Dual(self.value + second.value, slopes)

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Dual":
        """Return the difference from any number."""
        return self.__add__(-1.0 * other)

    def __rsub__(self, other: Any) -> "Dual":
        """Return a number minus this one."""
        return self.__mul__(-1.0).__add__(other)

    def __mul__(self, other: Any) -> "Dual":
        """Return the product with any number."""
        second = dual(other, len(self.slopes))
        slopes = [
            x * second.value + self.value * y
            for x, y in zip(self.slopes, second.slopes, strict=True)
        ]
        return Dual(self.value * second.value, slopes)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Dual":
        """Return the quotient by any number."""
        second = dual(other, len(self.slopes))
        quotient = self.value / second.value
        slopes = [
            (x + -1.0 * quotient * y) / second.value
            for x, y in zip(self.slopes, second.slopes, strict=True)
        ]
        return Dual(quotient, slopes)

    def __rtruediv__(self, other: Any) -> "Dual":
        """Return a number divided by this one."""
        return dual(other, len(self.slopes)) / self


def dual(value: Any, count: int) -> Dual:
    """Return a number as a dual number; a plain one has `count` derivatives of 0."""
    return value if isinstance(value, Dual) else Dual(value, [0.0] * count)
