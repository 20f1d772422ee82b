"""Sine, cosine, pi, series, vectors and fractions in the current decimal context."""

import decimal
import math
from collections.abc import Callable, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import cache
from operator import mul
from typing import Any

Row = list[Decimal]


def sine_cosine(angle: Decimal) -> tuple[Decimal, Decimal]:
    """Return sine and cosine of an angle (rad) of any size."""
    with decimal.localcontext() as context:
        context.prec += 12 + max(0, angle.adjusted())
        angle = angle.remainder_near(2 * pi(context.prec))
        halvings = 8
        x = angle / 2**halvings
        square = x * x
        sine = _alternating(x, square, 1)
        # The versine, 1 - cosine, loses no digits if the cosine is near 1.
        versine = _alternating(square / 2, square, 2)
        for _ in range(halvings):
            sine, versine = 2 * sine * (1 - versine), 2 * versine * (2 - versine)
        cosine = 1 - versine
    return +sine, +cosine


def _alternating(term: Decimal, square: Decimal, n: int) -> Decimal:
    """Return term - term x**2/((n + 1) (n + 2)) + ..., where `square` is x**2."""
    total = term
    while abs(term) > Decimal(1).scaleb(-decimal.getcontext().prec):
        n += 2
        term = -term * square / (n * (n - 1))
        total += term
    return total


def arctan(x: Decimal) -> Decimal:
    with decimal.localcontext() as context:
        context.prec += 10
        angle = Decimal(math.atan(x))
        # Each step doubles the number of correct digits, at first 16.
        digits = 15
        while digits < context.prec:
            sine, cosine = sine_cosine(angle)
            angle += (x * cosine - sine) / (cosine + x * sine)
            digits *= 2
    return +angle


def arcsin(x: Decimal) -> Decimal:
    """Return the angle (rad) whose sine is x; raise ArithmeticError if abs(x) > 1."""
    if abs(x) >= 1:
        if abs(x) > 1:
            raise decimal.InvalidOperation
        return (pi(decimal.getcontext().prec) / 2).copy_sign(x)
    with decimal.localcontext() as context:
        context.prec += 10
        angle = arctan(x / (1 - x * x).sqrt())
    return +angle


def arccos(x: Decimal) -> Decimal:
    if x <= -1:
        return pi(decimal.getcontext().prec) + arcsin(-1 - x)  # which fails below -1
    with decimal.localcontext() as context:
        context.prec += 10
        angle = 2 * arctan(((1 - x) / (1 + x)).sqrt())
    return +angle


def _with_digits(function: Callable[[Decimal], Decimal], zero: int = 0) -> Callable[..., Decimal]:
    """Return a function with the digits that its formula loses of small or large x - `zero`."""

    def called(x: Decimal) -> Decimal:
        with decimal.localcontext() as context:
            context.prec += 10 + abs((x - zero).adjusted())
            found = function(x)
        return +found

    return called


def _arsinh(x: Decimal) -> Decimal:
    return (abs(x) + (x * x + 1).sqrt()).ln().copy_sign(x)


# By the kind of the recorded operation.
ELEMENTARY: dict[str, Callable[[Decimal], Decimal]] = {
    "log": Decimal.ln,
    "log1p": _with_digits(lambda x: (1 + x).ln()),
    "log2": _with_digits(lambda x: x.ln() / Decimal(2).ln()),
    "log10": Decimal.log10,
    "atan": arctan,
    "asin": arcsin,
    "acos": arccos,
    "asinh": _with_digits(_arsinh),
    "acosh": _with_digits(lambda x: (x + (x * x - 1).sqrt()).ln(), 1),
    "atanh": _with_digits(lambda x: ((1 + x) / (1 - x)).ln() / 2),
    "cbrt": _with_digits(lambda x: (x.ln() / 3).exp()),
    "expm1": _with_digits(lambda x: x.exp() - 1),
    "exp2": _with_digits(lambda x: (x * Decimal(2).ln()).exp()),
}


def logarithm(number: int) -> Decimal:
    return _logarithm(number, decimal.getcontext().prec)


@cache
def _logarithm(number: int, digits: int) -> Decimal:
    with decimal.localcontext(prec=digits):
        return Decimal(number).ln()


@cache
def pi(digits: int) -> Decimal:
    """Return pi to `digits` significant digits, by Machin's formula."""
    with decimal.localcontext(prec=digits + 5):
        return 16 * _arctan_inverse(5) - 4 * _arctan_inverse(239)


def _arctan_inverse(n: int) -> Decimal:
    power = Decimal(1) / n
    total, k = power, 1
    while abs(power) > Decimal(1).scaleb(-decimal.getcontext().prec):
        power = -power / (n * n)
        k += 2
        total += power / k
    return total


def product(x: Row, reversed_y: Row) -> Decimal:
    """Return coefficient k of a product of two series, given coefficients 0 to k and k to 0."""
    if x and not x[-1]:
        # Series of polynomials end in many zeros, which change no digit of the sum.
        n = len(x) - 1
        while n and not x[n - 1]:
            n -= 1
        x = x[:n]
    return sum(map(mul, x, reversed_y), Decimal(0))


def value_at(series: Sequence[Any], offset: Any) -> Any:
    total: Any = 0
    for term in reversed(series):
        total = total * offset + term
    return total


def unit(row: Row) -> Row:
    length = sum((x * x for x in row), Decimal(0)).sqrt()
    return [x / length for x in row]


def to_decimal(x: Fraction) -> Decimal:
    return Decimal(x.numerator) / x.denominator
