"""Words: floating-point formats of p bits with a rounding rule, for runs of the Python twins.

A number of a word behaves like a float: it has operators, comparisons, `abs` and `float`. The other
operand may be a number of the same word, an integer or a float. A float is treated as a literal of
a source text, as in 0.1. Therefore its shortest decimal representation is rounded to the word, and
not its exact binary value.
"""

import math
import operator
from collections.abc import Callable
from fractions import Fraction
from typing import Any, ClassVar

from pyharness.model.errors import InputError, unknown
from pyharness.original.cdc import cdc
from pyharness.original.rounding import Pair, Rules, ieee

RULES = ("nearest-even", "chop", "FX", "RX")
# Additional bits with which a sine or cosine is computed before it is rounded to the word.
_GUARD_BITS = 40


class Number:
    """An immutable number of a word, which is a floating-point format: `m` times 2**`e`.

    `m` and `e` are integers. If `m` is 0, `e` is instead the value as a float: 0.0, -0.0, inf, -inf
    or nan. `Word` makes a subclass of Number for each word.
    """

    __slots__ = ("e", "m")
    word: ClassVar["Word"]
    rules: ClassVar[Rules]

    def __init__(self, m: int, e: Any) -> None:
        """Store `m` and `e` of a number m 2**e that the word can represent; nothing is rounded."""
        self.m, self.e = m, e

    def __add__(self, other: Any) -> "Number":
        """Return the sum of this number and `other`, rounded by the rounding rule of the word."""
        own = self.__class__
        if other.__class__ is not own:
            other = own.word(other)
        if self.m and other.m:
            return own(*own.rules.add(self.m, self.e, other.m, other.e))
        return self._special(operator.add, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Number":
        """Return this number minus `other`, computed as the sum with the negative of `other`."""
        own = self.__class__
        if other.__class__ is not own:
            other = own.word(other)
        if self.m and other.m:
            return own(*own.rules.add(self.m, self.e, -other.m, other.e))
        return self._special(operator.add, -other)

    def __rsub__(self, other: Any) -> "Number":
        """Return `other` minus this number; `other` is first converted to this number's format."""
        return self.word(other) - self

    def __mul__(self, other: Any) -> "Number":
        """Return this number times `other`, rounded by the rounding rule of the word."""
        own = self.__class__
        if other.__class__ is not own:
            other = own.word(other)
        if self.m and other.m:
            return own(*own.rules.multiply(self.m, self.e, other.m, other.e))
        return self._special(operator.mul, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Number":
        """Return this number divided by `other`, rounded by the rounding rule of the word.

        A nonzero number divided by zero is infinite; zero divided by zero is nan.
        """
        own = self.__class__
        if other.__class__ is not own:
            other = own.word(other)
        if self.m and other.m:
            return own(*own.rules.divide(self.m, self.e, other.m, other.e))
        return self._special(_quotient, other)

    def __rtruediv__(self, other: Any) -> "Number":
        """Return `other`, converted to this number's format, divided by this number."""
        return self.word(other) / self

    def __neg__(self) -> "Number":
        """Return this number with the opposite sign."""
        return self.__class__(-self.m, self.e) if self.m else self._plain(-self.e)

    def __abs__(self) -> "Number":
        """Return the magnitude of this number."""
        return self.__class__(abs(self.m), self.e if self.m else abs(self.e))

    def __bool__(self) -> bool:
        """Return whether the number differs from zero; True for nan."""
        return bool(self.m or self.e)

    def __eq__(self, other: object) -> bool:
        """Return whether the difference from `other`, computed in the word's arithmetic, is zero.

        In a CDC word the computed difference of two different, neighbouring numbers can be zero.
        Such numbers are regarded as equal.
        """
        x, y = self, self.word(other)
        if x.m and y.m:
            m, e = self.rules.difference(x.m, x.e, -y.m, y.e)
            return not m and bool(e == 0.0)
        return x._shadow == y._shadow

    __hash__ = None  # type: ignore[assignment]

    def __lt__(self, other: Any) -> bool:
        """Return whether the exact difference, this number minus `other`, is below zero."""
        return self._order(other) < 0

    def __gt__(self, other: Any) -> bool:
        """Return whether the exact difference, this number minus `other`, is above zero."""
        return self._order(other) > 0

    def __le__(self, other: Any) -> bool:
        """Return whether this number minus `other` is exactly zero or below; False for nan."""
        return self._order(other) <= 0

    def __ge__(self, other: Any) -> bool:
        """Return whether this number minus `other` is exactly zero or above; False for nan."""
        return self._order(other) >= 0

    def __float__(self) -> float:
        """Return the nearest float; beyond the range of floats, infinity with the same sign."""
        if not self.m:
            return float(self.e)
        try:
            return float(self.m << self.e) if self.e >= 0 else self.m / (1 << -self.e)
        except OverflowError:
            return math.copysign(math.inf, self.m)

    def __repr__(self) -> str:
        """Return the word (the format) and the value as text: ``Word(48, 'FX')(m * 2**e)``."""
        value = f"{self.m} * 2**{self.e}" if self.m else str(self.e)
        return f"{self.word}({value})"

    @property
    def is_finite(self) -> bool:
        """Return whether the number is neither nan nor infinite."""
        return bool(self.m) or self.e == 0.0

    def fraction(self) -> Fraction:
        """Return the exact value of a finite number as a fraction."""
        return Fraction(self.m) * Fraction(2) ** self.e if self.m else Fraction(self.e)

    def sqrt(self) -> "Number":
        """Return the square root of this number, correctly rounded to nearest.

        It is rounded to nearest even if the other operations of the word truncate. The root of a
        number below zero is nan.
        """
        if self.m <= 0:
            return self._plain(self.e if not self.m and not self.e < 0.0 else math.nan)
        shift = 2 * self.word.p + 4 + (self.e & 1)
        root = math.isqrt(self.m << shift)
        rest = root * root != self.m << shift
        return self.__class__(*self.rules.nearest(root << 1 | rest, (self.e - shift) // 2 - 1))

    def sin(self) -> "Number":
        """Return the sine of this number (rad), rounded to nearest.

        It is rounded to nearest even if the other operations of the word truncate.
        """
        return self._wave("mpf_sin")

    def cos(self) -> "Number":
        """Return the cosine of this number (rad), rounded to nearest.

        It is rounded to nearest even if the other operations of the word truncate.
        """
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
        """Return the result of an operation in which an operand is zero, infinite or nan.

        The operands are this number and `other`. `operation` is the same operation on floats, such
        as their sum. It is applied to a float for each operand: the same zero, infinity or nan, or
        1.0 or -1.0 for any other number. If this yields zero, infinity or nan, the result has this
        value. Otherwise zero was added to a number, and the result is the other operand of the sum.
        """
        found = operation(self._shadow, other._shadow)
        if found and math.isfinite(found):
            return self if self.m else other  # a zero was added
        return self._plain(found)

    def _plain(self, value: float) -> "Number":
        return self.__class__(0, value if value or self.rules.signed_zero else 0.0)

    @property
    def _shadow(self) -> float:
        """Return a float of the same sign and kind (zero, finite, infinite or nan) as this number.

        The float is 1.0 or -1.0 if the number is finite and not zero. Otherwise it is the zero,
        infinity or nan that the number represents.
        """
        if self.m:
            return 1.0 if self.m > 0 else -1.0
        return float(self.e)

    def _order(self, other: Any) -> float:
        """Return a number with the sign of the exact difference, this number minus `other`.

        The result is nan if this number or `other` is nan.
        """
        x, y = self, self.word(other)
        if not (x.m and y.m):
            return 0.0 if x._shadow == y._shadow else x._shadow - y._shadow
        apart: int = x.e - y.e
        return (x.m << apart) - y.m if apart >= 0 else x.m - (y.m << -apart)


def _quotient(x: float, y: float) -> float:
    if y:
        return x / y
    return math.nan if math.isnan(x) or not x else math.copysign(math.inf, x) * math.copysign(1, y)


class Word:
    """A floating-point format with its arithmetic: a number of bits p, and a rounding rule.

    A word is called like a function, with a float, an integer, a fraction or the text of a decimal.
    It returns this value as a `Number` of the word.

    Parameters
    ----------
    p : int
        Number of bits of the coefficient (significand).
    rule : {"nearest-even", "chop", "FX", "RX"}
        Rounding to nearest with ties to even; truncation towards zero; or the rules of the CDC's
        instructions FX, which truncate, and RX, which round.
    largest : int, optional
        Largest exponent for the rules `nearest-even` and `chop`: numbers are below
        2**(largest + 1), and the smallest exponent follows as in IEEE 754. By default it is the
        largest exponent of binary64 if p is at most 53, else of binary128. It has no effect on `FX`
        and `RX`, which have the exponents of CDC words.
    cut_literals : bool
        Whether a value that is converted to the word is truncated towards zero, instead of rounded
        to the nearest number.

    Raises
    ------
    InputError
        If the rule is unknown, or if p is below 4.
    """

    def __init__(
        self,
        p: int,
        rule: str = "nearest-even",
        largest: int | None = None,
        cut_literals: bool = False,
    ) -> None:
        """Select the arithmetic for p bits and the rounding rule; make the word's class of numbers.

        A word is a floating-point format. `largest` is its largest exponent, and `cut_literals`
        says whether values that are converted to the format are truncated.
        """
        if rule not in RULES:
            raise unknown("rounding", rule, RULES)
        if p < 4:
            raise InputError(f"word: {p} bits; allowed: 4 or more")
        self.p, self.rule = p, rule
        if rule in ("FX", "RX"):
            rules = cdc(p, rounds=rule == "RX")
        else:
            exponent = largest or (1023 if p <= 53 else 16383)
            rules = ieee(p, exponent, cut=rule == "chop")
        self.rules = rules
        self._literal = rules.cut if cut_literals else rules.nearest
        fields = {"__slots__": (), "word": self, "rules": rules}
        self.number: type[Number] = type("Number", (Number,), fields)
        self._literals: dict[float, Number] = {}

    def __repr__(self) -> str:
        """Return the format's number of bits and rounding rule as text: ``Word(48, 'FX')``."""
        return f"Word({self.p}, {self.rule!r})"

    def __call__(self, value: Any) -> Number:
        """Return `value` as a number of the word, which is a floating-point format.

        The value is truncated if the word was made with `cut_literals`, and rounded to nearest
        otherwise. `value` is a float, which is converted from its shortest decimal representation,
        an integer, a fraction, the text of a decimal, or a number of this word. Raise TypeError for
        any other type, and for a number of another word.
        """
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
