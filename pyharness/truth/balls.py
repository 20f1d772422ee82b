"""Numbers of the enclosures: balls, power series of balls, complex balls, and derivatives of these.

A ball is an interval given by its middle and its radius. Every operation of python-flint returns a
ball that contains the exact result for all numbers in its operands.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import acb, arb

from pyharness.model.tape import Functions, Table
from pyharness.truth.enclosed import Balls


def ball(x: Fraction) -> Any:
    """Return a ball that contains a fraction, and that is exact if the precision suffices."""
    return arb(x.numerator) / arb(x.denominator)


def fraction(x: Any) -> Fraction:
    """Return the middle of a ball exactly."""
    mantissa, exponent = x.mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def balls(row: Sequence[Any]) -> Balls:
    """Return the balls of a row with their exact middles, and with the largest of their radii."""
    return Balls(tuple(map(fraction, row)), max(fraction(x.rad()) for x in row))


class Dual:
    """A number, and its derivatives with respect to some unknowns; numbers of any kind."""

    def __init__(self, value: Any, slopes: Sequence[Any]) -> None:
        self.value, self.slopes = value, slopes

    def chained(self, value: Any, slope: Any) -> "Dual":
        """Return a function of this number, from its value and its derivative."""
        return Dual(value, [slope * each for each in self.slopes])

    def __add__(self, other: Any) -> "Dual":
        """Return the sum with a number or a dual."""
        if not isinstance(other, Dual):
            return Dual(self.value + other, self.slopes)
        slopes = [x + y for x, y in zip(self.slopes, other.slopes, strict=True)]
        return Dual(self.value + other.value, slopes)

    __radd__ = __add__

    def __neg__(self) -> "Dual":
        """Return the opposite."""
        return Dual(-self.value, [-x for x in self.slopes])

    def __sub__(self, other: Any) -> "Dual":
        """Return the difference from a number or a dual."""
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> "Dual":
        """Return the difference of a number and this one."""
        return self.__neg__().__add__(other)

    def __mul__(self, other: Any) -> "Dual":
        """Return the product with a number or a dual."""
        if not isinstance(other, Dual):
            return Dual(self.value * other, [x * other for x in self.slopes])
        slopes = [
            x * other.value + self.value * y for x, y in zip(self.slopes, other.slopes, strict=True)
        ]
        return Dual(self.value * other.value, slopes)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Dual":
        """Return the quotient by a number or a dual."""
        if not isinstance(other, Dual):
            return Dual(self.value / other, [x / other for x in self.slopes])
        quotient = self.value / other.value
        slopes = [
            (x - quotient * y) / other.value for x, y in zip(self.slopes, other.slopes, strict=True)
        ]
        return Dual(quotient, slopes)

    def __rtruediv__(self, other: Any) -> "Dual":
        """Return the quotient of a number and this one."""
        quotient = other / self.value
        return self.chained(quotient, -quotient / self.value)


def _sqrt(x: Any) -> Any:
    if isinstance(x, Dual):
        root = _sqrt(x.value)
        return x.chained(root, 1 / (2 * root))
    # Where a complex ball meets the branch cut, the result is not finite.
    return x.sqrt(analytic=True) if isinstance(x, acb) else x.sqrt()


def _exp(x: Any) -> Any:
    if isinstance(x, Dual):
        value = _exp(x.value)
        return x.chained(value, value)
    return x.exp()


def _tanh(x: Any) -> Any:
    # Power series have no method for it.
    return 1 - 2 / (_exp(2 * x) + 1)


def _sine(x: Any) -> Any:
    return x.chained(_sine(x.value), _cosine(x.value)) if isinstance(x, Dual) else x.sin()


def _cosine(x: Any) -> Any:
    return x.chained(_cosine(x.value), -_sine(x.value)) if isinstance(x, Dual) else x.cos()


def functions_at(time: Fraction, forward: bool) -> Functions[Any]:
    """Return the functions of a tape, with the pieces of its tables that hold from `time` (s) on.

    If `forward` is false, these are the pieces that hold before `time`.
    """

    def table(each: Table, at: Any) -> Any:
        # The comparison of a fraction with a binary64 number is exact.
        place = (bisect_right if forward else bisect_left)(each.breaks, time)
        piece = max(0, place - 1)
        c0, c1, c2, c3 = map(arb, each.pieces[piece])
        s = at - arb(each.breaks[piece])
        return c0 + s * (c1 + s * (c2 + s * c3))

    return Functions(arb, _sqrt, _exp, _tanh, _sine, _cosine, table)
