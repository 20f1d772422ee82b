"""Floating-point formats of p bits with a rounding rule (words), for runs of the Python ports.

A number has the operators of a float. A float operand is converted from its shortest decimal
representation, like a literal.

Arithmetic functions take integers m, e for a number m 2**e; m has p bits, fewer if subnormal. In
results, m may be 0; then e is the value as a float: 0.0, -0.0, inf, -inf or nan.
"""

import math
import operator
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from typing import Any, ClassVar, NamedTuple

from pyharness.model.errors import InputError, unknown

# To nearest, ties to even; towards zero; the CDC's truncating and rounding instructions.
RULES = ("nearest-even", "chop", "FX", "RX")
# Number of additional bits of a sine or cosine before rounding.
_GUARD_BITS = 40
Pair = tuple[int, Any]
Rounding = Callable[[int, int], Pair]
Operation = Callable[[int, int, int, int], Pair]
# Exponents of an integer coefficient for the exponent fields 0000 and 3776 (octal) of a CDC word.
_LEAST, _MOST = -1023, 1022


class Rules(NamedTuple):
    """The arithmetic of a format, as functions of integers m and e."""

    nearest: Rounding  # ties to even; for square roots, sines, cosines and literals
    cut: Rounding  # towards zero; for literals if the format truncates them
    add: Operation
    multiply: Operation
    divide: Operation
    difference: Operation  # a sum, only for tests of equality
    signed_zero: bool


def rounding(p: int, least: int, most: int, cut: bool, gradual: bool) -> Rounding:
    """Return a function that rounds m 2**e to a p-bit integer times 2**k, k = `least` to `most`."""
    shortened = _cut if cut else _to_even

    def rounded(m: int, e: int) -> Pair:
        if not m:
            return 0, 0.0
        shift = m.bit_length() - p
        if e + shift < least:
            return small(m, e)
        if shift > 0:
            m = shortened(m, shift)
            if m.bit_length() > p:
                m >>= 1
                e += 1
        elif shift:
            m <<= -shift
        e += shift
        return (m, e) if e <= most else (0, math.copysign(math.inf, m))

    def small(m: int, e: int) -> Pair:
        if not gradual:
            return 0, 0.0
        # A multiple of 2**least, like the subnormal numbers of IEEE 754.
        short = shortened(m, least - e) if e < least else m << (e - least)
        return (short, least) if short else (0, math.copysign(0.0, m))

    return rounded


def _cut(m: int, shift: int) -> int:
    return m >> shift if m > 0 else -(-m >> shift)


def _to_even(m: int, shift: int) -> int:
    return (m + (1 << shift - 1) - 1 + (m >> shift & 1)) >> shift


def ieee(p: int, largest: int, cut: bool) -> Rules:
    """Return the rules of IEEE 754 for p-bit coefficients and numbers below 2**(largest + 1).

    If `cut`, operations truncate towards zero.
    """
    # Truncated results that are too large are infinite; IEEE 754 requires the largest number.
    least, most = 2 - largest - p, largest - p + 1
    fit = rounding(p, least, most, cut, gradual=True)

    def add(xm: int, xe: int, ym: int, ye: int) -> Pair:
        if xe < ye:
            xm, xe, ym, ye = ym, ye, xm, xe
        apart = xe - ye
        if apart > p + 2:
            # All y of one sign below an eighth of the last unit of x have the same effect.
            return fit((xm << 3) + (1 if ym > 0 else -1), xe - 3)
        return fit((xm << apart) + ym, ye)

    def multiply(xm: int, xe: int, ym: int, ye: int) -> Pair:
        return fit(xm * ym, xe + ye)

    def divide(xm: int, xe: int, ym: int, ye: int) -> Pair:
        shift = p + 2 + ym.bit_length() - xm.bit_length()
        quotient, rest = divmod(abs(xm) << shift, abs(ym))
        quotient = quotient << 1 | (rest > 0)
        return fit(quotient if (xm < 0) == (ym < 0) else -quotient, xe - ye - shift - 1)

    nearest, towards_zero = (rounding(p, least, most, each, gradual=True) for each in (False, True))
    return Rules(nearest, towards_zero, add, multiply, divide, add, signed_zero=True)


def cdc(p: int, rounds: bool) -> Rules:
    """Return the arithmetic of CDC 6600 and CYBER 70 for p-bit coefficients.

    `rounds` selects rounding instructions (RX) instead of truncating ones (FX).
    """
    # By the CYBER 170 hardware reference, CDC 60463560. In the order +, -, *, /, the instructions
    # FX are octal 30, 31, 40 and 44, RX 34, 35, 41 and 45; NX, octal 24, normalises a sum.
    settled = rounding(p, _LEAST, _MOST, cut=True, gradual=False)
    quarter = 1 << p - 2 if rounds else 0
    third = (1 << p) // 3 if rounds else 0

    def multiply(xm: int, xe: int, ym: int, ye: int) -> Pair:
        product = abs(xm * ym) + quarter
        return settled(product if (xm < 0) == (ym < 0) else -product, xe + ye)

    def divide(xm: int, xe: int, ym: int, ye: int) -> Pair:
        quotient = ((abs(xm) << p) + third) // abs(ym)
        return settled(quotient if (xm < 0) == (ym < 0) else -quotient, xe - ye - p)

    def add(rounds: bool, xm: int, xe: int, ym: int, ye: int) -> Pair:
        frame, e = framed(p, rounds, xm, xe, ym, ye)
        # Without a guard bit, bits below the last unit of the larger operand are truncated.
        return settled(_cut(frame, p), e)

    # Rounding of literals is an assumption, because no source states the rule of CDC's FTN.
    nearest = rounding(p, _LEAST, _MOST, cut=False, gradual=False)
    total, plain = partial(add, rounds), partial(add, False)
    return Rules(nearest, settled, total, multiply, divide, plain, signed_zero=False)


def framed(p: int, rounds: bool, xm: int, xe: int, ym: int, ye: int) -> tuple[int, int]:
    """Return (frame, e) of a CDC sum frame 2**(e - p) before normalisation.

    The frame has 2 p bits.
    """
    if xe <= ye:
        xm, xe, ym, ye = ym, ye, xm, xe
    apart = xe - ye
    large, small = abs(xm) << p, abs(ym) << p >> apart
    if rounds:  # RX first adds half a unit in the last place to each operand
        half = 1 << p - 1
        large += half
        small += half >> apart
    return (large if xm > 0 else -large) + (small if ym > 0 else -small), xe


def _quotient(x: float, y: float) -> float:
    if y:
        return x / y
    return math.nan if math.isnan(x) or not x else math.copysign(math.inf, x) * math.copysign(1, y)


def _operator(
    rule: str, of_floats: Callable[[float, float], float], negates: bool = False
) -> Callable[["Number", Any], "Number"]:
    """Return the operator of `rule`, a field of Rules; `negates` negates the second operand."""

    def operate(self: "Number", other: Any) -> "Number":
        own = self.__class__
        if other.__class__ is not own:
            other = own.word(other)
        if self.m and other.m:
            m = -other.m if negates else other.m
            return own(*getattr(own.rules, rule)(self.m, self.e, m, other.e))
        return self._special(of_floats, -other if negates else other)

    return operate


def _comparison(compare: Callable[[float, float], bool]) -> Callable[["Number", Any], bool]:
    return lambda number, other: compare(number._order(other), 0.0)


class Number:
    """A number of a floating-point format: the integer `m` times 2**`e`.

    If `m` is 0, `e` is the value as a float.
    """

    __slots__ = ("e", "m")
    word: ClassVar["Word"]
    rules: ClassVar[Rules]

    def __init__(self, m: int, e: Any) -> None:
        self.m, self.e = m, e

    __add__ = __radd__ = _operator("add", operator.add)
    __sub__ = _operator("add", operator.add, negates=True)
    __mul__ = __rmul__ = _operator("multiply", operator.mul)
    __truediv__ = _operator("divide", _quotient)

    def __rsub__(self, other: Any) -> "Number":
        return self.word(other) - self

    def __rtruediv__(self, other: Any) -> "Number":
        return self.word(other) / self

    def __neg__(self) -> "Number":
        return self.__class__(-self.m, self.e) if self.m else self._without_sign_of_zero(-self.e)

    def __abs__(self) -> "Number":
        return self.__class__(abs(self.m), self.e if self.m else abs(self.e))

    def __bool__(self) -> bool:
        return bool(self.m or self.e)

    def __eq__(self, other: object) -> bool:
        """Return whether the difference, computed in this format, is zero.

        The difference of two neighbouring CDC numbers may be zero.
        """
        x, y = self, self.word(other)
        if x.m and y.m:
            m, e = self.rules.difference(x.m, x.e, -y.m, y.e)
            return not m and bool(e == 0.0)
        return x._shadow == y._shadow

    __hash__ = None  # type: ignore[assignment]

    # Comparisons use the exact difference; all are false for nan.
    __lt__, __le__ = _comparison(operator.lt), _comparison(operator.le)
    __gt__, __ge__ = _comparison(operator.gt), _comparison(operator.ge)

    def __float__(self) -> float:
        if not self.m:
            return float(self.e)
        try:
            return float(self.m << self.e) if self.e >= 0 else self.m / (1 << -self.e)
        except OverflowError:
            return math.copysign(math.inf, self.m)

    def __repr__(self) -> str:
        value = f"{self.m} * 2**{self.e}" if self.m else str(self.e)
        return f"{self.word}({value})"

    @property
    def is_finite(self) -> bool:
        return bool(self.m) or self.e == 0.0

    def fraction(self) -> Fraction:
        return Fraction(self.m) * Fraction(2) ** self.e if self.m else Fraction(self.e)

    def sqrt(self) -> "Number":
        """Return the square root, rounded to nearest, or nan for a negative number."""
        if self.m <= 0:
            return self._without_sign_of_zero(
                self.e if not self.m and not self.e < 0.0 else math.nan
            )
        shift = 2 * self.word.p + 4 + (self.e & 1)
        root = math.isqrt(self.m << shift)
        rest = root * root != self.m << shift
        return self.__class__(*self.rules.nearest(root << 1 | rest, (self.e - shift) // 2 - 1))

    def sin(self) -> "Number":
        return self._wave("mpf_sin")

    def cos(self) -> "Number":
        return self._wave("mpf_cos")

    def _wave(self, name: str) -> "Number":
        if not self.m:
            at_zero = self.e if name == "mpf_sin" else 1.0
            return self.word(at_zero if self.e == 0.0 else math.nan)
        from mpmath import libmp

        function = getattr(libmp, name)
        angle = libmp.from_man_exp(self.m, self.e)
        sign, m, e, _ = function(angle, self.word.p + _GUARD_BITS)
        return self.__class__(*self.rules.nearest(-int(m) if sign else int(m), e))

    def _special(self, operation: Callable[[float, float], float], other: "Number") -> "Number":
        """Return the result of an operation with an operand that is zero, infinite or nan."""
        # If the shadows' result is finite and not 0, one operand is 0, and the other is the result.
        found = operation(self._shadow, other._shadow)
        if found and math.isfinite(found):
            return self if self.m else other
        return self._without_sign_of_zero(found)

    def _without_sign_of_zero(self, value: float) -> "Number":
        return self.__class__(0, value if value or self.rules.signed_zero else 0.0)

    @property
    def _shadow(self) -> float:
        """Return zero, infinity and nan as a float, other numbers as their sign."""
        if self.m:
            return 1.0 if self.m > 0 else -1.0
        return float(self.e)

    def _order(self, other: Any) -> float:
        """Return a number with the exact sign of self - other, or nan if an operand is nan."""
        x, y = self, self.word(other)
        if not (x.m and y.m):
            return 0.0 if x._shadow == y._shadow else x._shadow - y._shadow
        apart: int = x.e - y.e
        return (x.m << apart) - y.m if apart >= 0 else x.m - (y.m << -apart)


class Word:
    """A floating-point format of p bits with a rounding rule.

    Numbers of IEEE formats are below 2**(largest + 1); `cut_literals` truncates converted values.
    """

    def __init__(
        self,
        p: int,
        rule: str = "nearest-even",
        largest: int | None = None,
        cut_literals: bool = False,
    ) -> None:
        if rule not in RULES:
            raise unknown("rounding", rule, RULES)
        if p < 4:
            raise InputError(f"word: {p} bits; allowed: 4 or more")
        self.p, self.rule = p, rule
        if rule in ("FX", "RX"):
            rules = cdc(p, rounds=rule == "RX")
        else:
            # The default is the largest exponent of binary64 or binary128.
            exponent = largest or (1023 if p <= 53 else 16383)
            rules = ieee(p, exponent, cut=rule == "chop")
        self.rules = rules
        self._literal = rules.cut if cut_literals else rules.nearest
        fields = {"__slots__": (), "word": self, "rules": rules}
        self.number: type[Number] = type("Number", (Number,), fields)
        self._literals: dict[float, Number] = {}

    def __repr__(self) -> str:
        return f"Word({self.p}, {self.rule!r})"

    def __call__(self, value: Any) -> Number:
        """Return a float, integer, fraction or decimal text as a number of this format."""
        if isinstance(value, Number) and value.word is self:
            return value
        if isinstance(value, float):
            known = self._literals.get(value) if value else None
            if known is None:
                known = self.number(*self._nearest(value))
                if value and math.isfinite(value):
                    self._literals[value] = known
            return known
        if isinstance(value, int):
            return self.number(*self._literal(value, 0))
        if isinstance(value, Fraction | str):
            return self.number(*self._of_fraction(Fraction(value)))
        raise TypeError(f"{value!r} is no number of {self}")

    def _nearest(self, value: float) -> Pair:
        if not value or not math.isfinite(value):
            return 0, value if value or self.rules.signed_zero else 0.0
        return self._of_fraction(Fraction(float.__repr__(value)))

    def _of_fraction(self, value: Fraction) -> Pair:
        above, below = abs(value.numerator), value.denominator
        shift = max(0, self.p + 2 + below.bit_length() - above.bit_length())
        quotient, rest = divmod(above << shift, below)
        quotient = quotient << 1 | (rest > 0)
        return self._literal(quotient if value > 0 else -quotient, -shift - 1)


WORDS: dict[str, Word] = {
    "binary64": Word(53),
    "binary32": Word(24, largest=127),
    "binary128": Word(113),
    "cdc48": Word(48, "FX"),
    "cdc48-rounded": Word(48, "RX"),
}
