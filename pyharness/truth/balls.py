"""Functions of balls, complex balls and their power series, for proved enclosures.

A ball is an interval, stored as middle and radius. Operations of python-flint return balls that
contain the exact results for all numbers in the operands.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import acb, arb, fmpq

from pyharness.model.dual import of_duals
from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.errors import InputError
from pyharness.model.tape import Functions, Table
from pyharness.truth.enclosed import Balls


def ball(x: Fraction) -> Any:
    """Return a ball that contains a fraction, and is exact if the precision suffices."""
    return arb(fmpq(x.numerator, x.denominator))


def fraction(x: Any) -> Fraction:
    """Return the exact middle of a ball."""
    mantissa, exponent = x.mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def balls(row: Sequence[Any]) -> Balls:
    """Return the exact middles of a row of balls, with their largest radius."""
    return Balls(tuple(map(fraction, row)), max(fraction(x.rad()) for x in row))


# Where a complex ball meets the branch cut of a root or logarithm, the result is not finite.
_sqrt = of_duals(
    lambda x: x.sqrt(analytic=True) if isinstance(x, acb) else x.sqrt(),
    lambda _, root: 1 / (2 * root),
)
_log = of_duals(
    lambda x: x.log(analytic=True) if isinstance(x, acb) else x.log(), lambda x, _: 1 / x
)
_exp = of_duals(lambda x: x.exp(), lambda _, value: value)
_sine: Any = of_duals(lambda x: x.sin(), lambda x, _: _cosine(x))
_cosine: Any = of_duals(lambda x: x.cos(), lambda x, _: -1.0 * _sine(x))


def _tanh(x: Any) -> Any:
    # python-flint has no hyperbolic tangent of power series.
    return 1 - 2 / (_exp(2 * x) + 1)


def _refuse(*_: Any) -> Any:
    raise InputError(
        "no enclosure is proved for a torque with arctan, arcsin, floor or a switch; allowed: "
        "other functions"
    )


# Formulas suffice: enclosures show the digits that they lose.
_ELEMENTARY: dict[str, Any] = dict.fromkeys(WITH_DERIVATIVE, _refuse) | {
    "log": _log,
    "log1p": lambda x: _log(1.0 + x),
    "log2": lambda x: _log(x) / arb(2).log(),
    "log10": lambda x: _log(x) / arb(10).log(),
    "asinh": lambda x: _log(x + _sqrt(x * x + 1.0)),
    "acosh": lambda x: _log(x + _sqrt(x * x - 1.0)),
    "atanh": lambda x: 0.5 * _log((1.0 + x) / (1.0 - x)),
    "expm1": lambda x: _exp(x) - 1.0,
    "exp2": lambda x: _exp(arb(2).log() * x),
}


def functions_at(time: Fraction, forward: bool) -> Functions[Any]:
    """Return the functions that evaluate tapes (recorded operations) in a step from `time` (s)."""

    def table(each: Table, at: Any) -> Any:
        # The comparison of a fraction with a binary64 number is exact.
        place = (bisect_right if forward else bisect_left)(each.breaks, time)
        piece = max(0, place - 1)
        c0, c1, c2, c3 = map(arb, each.pieces[piece].tolist())
        s = at - arb(float(each.breaks[piece]))
        return c0 + s * (c1 + s * (c2 + s * c3))

    functions = _sqrt, _exp, _tanh, _sine, _cosine, table, _ELEMENTARY
    return Functions(arb, *functions, *[_refuse] * 3)
