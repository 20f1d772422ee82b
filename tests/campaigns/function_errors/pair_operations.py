"""Double-double operations: bounds of their errors, and tests of the bounds at low precision.

A pair is a sum high + low with |low| <= u |high|, where u = 2**-p and p is the number of bits of a
number (53 in binary64). There is no overflow and no underflow. Bounds are relative unless stated
otherwise. JMP is Joldes, Muller, Popescu, ACM TOMS 44(2), 2017. MR is Muller, Rideau, ACM TOMS
48(1), 2022, which has formal proofs. The sources of our routines are translated from Fortran, so
that the tests see a change of any of them.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tests.campaigns.function_errors.nearness import exponent
from tests.campaigns.function_errors.sources import TWO_WORDS, WIDE, WORD_PAIRS, Pair, translate

Numbers = NDArray[np.float64]


def rounded_up(x: Fraction) -> Fraction:
    """Return a slightly larger number of 80 bits, so that computations with it are faster."""
    unit = Fraction(2) ** (exponent(x) - 80)
    return math.ceil(x / unit) * unit


def accurate_sum(u: Fraction) -> Fraction:
    """Return the bound of AccurateDWPlusDW (JMP, algorithm 6, with the constant of MR)."""
    return 3 * u**2 / (1 - 4 * u)


def normalized_product(u: Fraction) -> Fraction:
    """Return the bound of DWTimesDW1 (MR; 7 u**2 in JMP)."""
    return 5 * u**2


def quotient_by_number(u: Fraction) -> Fraction:
    """Return the bound of DWDivFP3 (JMP)."""
    return 3 * u**2


def truncated_product(u: Fraction) -> Fraction:
    """Return the bound of two_product of two_words.f90, without a fused multiply-add.

    Let 1 <= x, y < 2 and p odd. The low halves have (p + 1)/2 bits, so that their product is an
    integer below 2**(p + 1) times 4 u**2. It is rounded by at most 4 u**2; all else is exact.
    """
    return 4 * u**2


def sloppy_sum(u: Fraction) -> Fraction:
    """Return the bound of sum_of_pairs of word_pairs.f90, relative to |x| + |y|.

    It is SloppyDWPlusDW of JMP: 3 u**2 if both pairs have the same sign. If the signs differ, two
    roundings remain, of x.low + y.low and of `rest`; if `rest` is larger than `total`, the last two
    sums add an error of at most u |rest| (1 + 7 u).
    """
    lows = u
    first = u * lows
    second = u * (u + lows * (1 + u))
    third = u * (1 + 7 * u) * lows * (1 + u) ** 4
    return (first + second + third) / (1 - u)


# In the next functions `product` is the bound of the product of two numbers, 0 if it is exact.


def scaled_pair(u: Fraction, product: Fraction | None = None) -> Fraction:
    """Return the bound of scaled: DWTimesFP2 of JMP, but with truncated_product."""
    product = truncated_product(u) if product is None else product
    last = u + product + u * (1 + u)
    return (product + u * u + u * last) / (1 - u)


def product_of_pairs(u: Fraction, product: Fraction | None = None) -> Fraction:
    """Return the bound of product_of_pairs: DWTimesDW1 of JMP, but with truncated_product.

    Neglected: x.low y.low. Rounded: two products of a high and a low part, their sum, the last sum.
    """
    product = truncated_product(u) if product is None else product
    cross = 2 * u * (1 + u)
    last = u + product + cross * (1 + u)
    return (product + u**2 + 2 * u**2 + u * cross + u * last) / (1 - u) ** 2


def quotient_of_pairs(u: Fraction, product: Fraction | None = None) -> Fraction:
    """Return the bound of quotient_of_pairs, by the size of each rounded result over |x.high|."""
    product = truncated_product(u) if product is None else product
    first = u + (u + product) * (1 + u)  # x.low - rest
    second = u * (1 + u)  # found.high y.low
    third = first * (1 + u) + second * (1 + u)  # their difference
    remainder = u + u + u * (1 + u)  # x - found.high y
    errors = product * (1 + u) + u * (first + second + third)
    fourth = remainder + errors  # of which x.high - product is exact
    errors += u * fourth
    errors += u * fourth * (1 + u)  # the division
    errors += remainder * u / (1 - u)  # by y.high instead of y
    return errors * (1 + u) / (1 - u)


def root_of_pair(u: Fraction, product: Fraction | None = None) -> Fraction:
    """Return the bound of square_root, by the size of each rounded result over x.

    With the relative remainder d = x/root**2 - 1, Newton's step omits at most d**2/8.
    """
    product = truncated_product(u) if product is None else product
    lows = u + u * (1 + u) ** 2 + product * (1 + u) ** 2  # x_low - square_low
    errors = product * (1 + u) ** 2 + u * lows
    last = 2 * u + u**2 + u + errors  # the remainder x - root**2
    errors += u * last + u * last * (1 + u)  # the last sum and the division
    omitted = (last / (1 - u) ** 3) ** 2 / 8
    return (errors / 2 + omitted) / (1 - u) ** 3


def longer_product(u: Fraction) -> Fraction:
    """Return the bound of longer_product, relative to |x(1) y|, if |x(k + 1)| <= u |x(k)|.

    Rounded: x(3) y, its sum with `rest`, and the last sum, of which `left` is at most u times the
    sum of `first` and `middle`.
    """
    third, rest = u**2, u**2
    inner = rest + third * (1 + u)
    left = u * (u + u * (1 + u))
    return (u * third + u * inner + u * (left + inner * (1 + u))) / (1 - u - u**2)


class Operation(NamedTuple):
    """A routine with its bound."""

    name: str
    source: Any
    bound: Callable[[Fraction], Fraction]
    operands: str  # n: a number, p: a pair, s: a pair of any exponent and sign
    residual: Callable[..., Any]  # computed error, times a known factor, and that factor


def _value(x: Any) -> Any:
    return x.high + x.low if isinstance(x, Pair) else x


@dataclass
class Small:
    """An array of numbers of `digits` bits, whose operations are rounded to nearest, ties to even.

    With at most 8 bits the results of binary64 are exact, or far from a tie, before the rounding.
    """

    values: Numbers
    digits: int

    def _of(self, values: Numbers) -> "Small":
        fraction, power = np.frexp(values)
        return Small(
            np.ldexp(np.rint(fraction * 2.0**self.digits), power - self.digits), self.digits
        )

    def _other(self, other: Any) -> Numbers:
        return other.values if isinstance(other, Small) else np.array(float(other))

    def __add__(self, other: Any) -> "Small":
        """Return the rounded sum."""
        return self._of(self.values + self._other(other))

    def __sub__(self, other: Any) -> "Small":
        """Return the rounded difference."""
        return self._of(self.values - self._other(other))

    def __mul__(self, other: Any) -> "Small":
        """Return the rounded product."""
        return self._of(self.values * self._other(other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Small":
        """Return the rounded quotient."""
        return self._of(self.values / self._other(other))

    def __neg__(self) -> "Small":
        """Return the negative."""
        return Small(-self.values, self.digits)

    def sqrt(self) -> "Small":
        """Return the rounded square root."""
        return self._of(np.sqrt(self.values))

    def truncated(self) -> "Small":
        """Return the number without the last (digits + 1)/2 bits."""
        fraction, power = np.frexp(self.values)
        kept = self.digits - (self.digits + 1) // 2
        return Small(np.ldexp(np.trunc(fraction * 2.0**kept), power - kept), self.digits)


def _truncated(x: Any) -> Any:
    if isinstance(x, Small):
        return x.truncated()
    return (np.asarray(x).view(np.int64) & np.int64(-(2**27))).view(np.float64)


def _root(x: Any) -> Any:
    return x.sqrt() if isinstance(x, Small) else np.sqrt(x)


def routines(digits: int, texts: dict[Any, str] | None = None) -> dict[Any, dict[str, Any]]:
    """Return the translated routines of each Fortran source, for numbers of `digits` bits."""
    given = {path: path.read_text() for path in (TWO_WORDS, WORD_PAIRS, WIDE)} | (texts or {})
    known: dict[str, Any] = {
        "pair_t": Pair,
        "SPLITTER": 2.0 ** ((digits + 1) // 2) + 1.0,
        "UPPER_BITS": None,
        "transfer": lambda x, _: x,
        "iand": lambda x, _: _truncated(x),
        "sqrt": _root,
    }
    wide = dict(known)
    for name in ("two_sum", "two_product", "scaled", "square_root"):
        translate(given[TWO_WORDS], name, known)
    for name in (
        "product_of", "difference_of", "exact_product", "longer_product", "sum_of_pairs",
        "difference_of_pairs", "product_of_pairs", "multiple_of_pair", "quotient_of_pairs", "root",
    ):  # fmt: skip
        translate(given[WORD_PAIRS], name, known)
    for name in ("sum_of", "product_of", "sum_of_pairs", "product_of_pairs", "quotient_of"):
        translate(given[WIDE], name, wide)
    return {WORD_PAIRS: known, WIDE: wide}


def _relative_to(exact: Callable[..., Any]) -> Callable[..., Any]:
    return lambda found, *given: (_value(found) - exact(*given), exact(*given))


OPERATIONS = (
    Operation("product_of", WORD_PAIRS, truncated_product, "nn", _relative_to(lambda x, y: x * y)),
    Operation(
        "sum_of_pairs", WORD_PAIRS, sloppy_sum, "ps",
        lambda z, x, y: (_value(z) - (_value(x) + _value(y)), abs(_value(x)) + abs(_value(y))),
    ),
    Operation(
        "multiple_of_pair", WORD_PAIRS, scaled_pair, "pn",
        _relative_to(lambda x, y: _value(x) * y),
    ),
    Operation(
        "product_of_pairs", WORD_PAIRS, product_of_pairs, "pp",
        _relative_to(lambda x, y: _value(x) * _value(y)),
    ),
    Operation(
        "quotient_of_pairs", WORD_PAIRS, quotient_of_pairs, "pp",
        lambda z, x, y: (_value(z) * _value(y) - _value(x), _value(x)),
    ),
    Operation(
        "root", WORD_PAIRS, root_of_pair, "r",
        lambda z, x: ((_value(z) * _value(z) - _value(x)) / 2, _value(x)),
    ),
    Operation(
        "sum_of_pairs", WIDE, accurate_sum, "ps",
        _relative_to(lambda x, y: _value(x) + _value(y)),
    ),
    Operation(
        "product_of_pairs", WIDE, normalized_product, "pp",
        _relative_to(lambda x, y: _value(x) * _value(y)),
    ),
    Operation(
        "quotient_of", WIDE, quotient_by_number, "pn",
        lambda z, x, y: (_value(z) * y - _value(x), _value(x)),
    ),
)  # fmt: skip


def _numbers(digits: int) -> Numbers:
    return np.arange(2.0 ** (digits - 1), 2.0**digits) / 2.0 ** (digits - 1)


def _pairs(digits: int, binades: int) -> NDArray[np.float64]:
    """Return all pairs with 1 <= high < 2 and low parts of `binades` binades or 0, shape (2, n)."""
    lows = [_numbers(digits) * 2.0 ** -(digits + 1 + n) for n in range(binades)]
    low = np.concatenate([[2.0**-digits, 0.0], *lows])
    high, low = (
        each.ravel() for each in np.meshgrid(_numbers(digits), np.concatenate([low, -low]))
    )
    total = high + low
    kept = Small(high, digits)._of(total).values == high
    return np.unique(np.array([high[kept], low[kept]]), axis=1)


def operands(kind: str, digits: int, binades: int) -> Iterator[tuple[Any, ...]]:
    """Yield all operands of an operation, in arrays; scale and common sign do not matter."""

    def small(values: Numbers) -> Small:
        return Small(values, digits)

    pairs = _pairs(digits, binades)
    if kind == "r":
        for scale in (1.0, 2.0):
            yield (Pair(small(pairs[0] * scale), small(pairs[1] * scale)),)
        return
    numbers = _numbers(digits)[None, :]
    first, second = (pairs if letter != "n" else numbers for letter in kind)
    i, j = (each.ravel() for each in np.mgrid[: first.shape[1], : second.shape[1]])
    shifts = range(-(2 * digits + 3), 1) if kind[1] == "s" else [0]
    for shift, sign in itertools.product(shifts, (1.0, -1.0) if kind[1] == "s" else (1.0,)):
        x, y = first[:, i], second[:, j] * (sign * 2.0**shift)
        yield tuple(
            Pair(small(each[0]), small(each[1])) if len(each) == 2 else small(each[0])
            for each in (x, y)
        )


def _plain(x: Any) -> Any:
    """Return the exact values of an operand or a result as binary64 arrays."""
    return Pair(_plain(x.high), _plain(x.low)) if isinstance(x, Pair) else x.values


def worst(operation: Operation, function: Any, digits: int, binades: int) -> float:
    """Return the largest error of an operation over all operands, in units of u**2.

    The errors are computed exactly in binary64, since all numbers have few bits.
    """
    found = 0.0
    for given in operands(operation.operands, digits, binades):
        error, size = operation.residual(_plain(function(*given)), *map(_plain, given))
        some = size != 0
        assert not np.any(error[~some])
        found = max(found, float(np.max(np.abs(error[some] / size[some]), initial=0.0)))
    return found * 4.0**digits
