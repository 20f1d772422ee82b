"""Numbers of the enclosures: balls, power series of balls, complex balls, and functions.

A ball is an interval given by its middle and its radius. Each operation of python-flint returns a
ball that contains the exact result for all numbers in its operands.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import acb, arb, fmpq

from pyharness.model.dual import Dual
from pyharness.model.tape import Functions, Table
from pyharness.truth.enclosed import Balls


def ball(x: Fraction) -> Any:
    """Return a ball that contains a fraction; it is exact if the precision suffices."""
    return arb(fmpq(x.numerator, x.denominator))


def fraction(x: Any) -> Fraction:
    """Return the middle of a ball exactly."""
    mantissa, exponent = x.mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def balls(row: Sequence[Any]) -> Balls:
    """Return a row's exact middles, with the largest of their radii."""
    return Balls(tuple(map(fraction, row)), max(fraction(x.rad()) for x in row))


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
    return x.chained(_cosine(x.value), -1.0 * _sine(x.value)) if isinstance(x, Dual) else x.cos()


def functions_at(time: Fraction, forward: bool) -> Functions[Any]:
    """Return a tape's functions, with the pieces of its tables that hold after `time` (s).

    Before `time`, if `forward` is false.
    """

    def table(each: Table, at: Any) -> Any:
        # The comparison of a fraction with a binary64 number is exact.
        place = (bisect_right if forward else bisect_left)(each.breaks, time)
        piece = max(0, place - 1)
        c0, c1, c2, c3 = map(arb, each.pieces[piece])
        s = at - arb(each.breaks[piece])
        return c0 + s * (c1 + s * (c2 + s * c3))

    return Functions(arb, _sqrt, _exp, _tanh, _sine, _cosine, table)
