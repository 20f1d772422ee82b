"""A second implementation of the arithmetic of words: exact rationals, then the rounding rule.

It shares no code with `pyharness.thesis.word`. A number is a fraction, and its unit is found by
comparison with powers of two.
"""

import math
import operator
from collections.abc import Callable
from fractions import Fraction
from random import Random
from typing import Any

from pyharness.thesis.word import Word

OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
}  # fmt: skip


def exact(p: int, rule: str, name: str, x: Fraction, y: Fraction) -> Fraction:
    """Return an operation's result in p bits for two non-zero numbers; exponents have no limit."""
    value: Fraction = OPERATIONS[name](x, y)
    if rule == "chop":
        return _towards_zero(value, unit(value, p))
    if rule == "nearest-even":
        return Fraction(round(value / unit(value, p))) * unit(value, p) if value else value
    if name in "+-":
        return _cdc_sum(p, rule == "RX", x, y if name == "+" else -y)
    if name == "*":
        return _cdc_product(p, rule == "RX", x, y)
    return _cdc_quotient(p, rule == "RX", x, y)


def unit(value: Fraction, p: int) -> Fraction:
    """Return the weight of the last of p bits; for zero, any weight."""
    if not value:
        return Fraction(1)
    power = math.floor(math.log2(abs(value.numerator)) - math.log2(value.denominator))
    while Fraction(2) ** power > abs(value):
        power -= 1
    while Fraction(2) ** (power + 1) <= abs(value):
        power += 1
    return Fraction(2) ** (power + 1 - p)


def _towards_zero(value: Fraction, step: Fraction) -> Fraction:
    return math.trunc(value / step) * step


def _cdc_sum(p: int, rounds: bool, x: Fraction, y: Fraction) -> Fraction:
    """Truncate both to a register of 2 p bits below the larger; then truncate the sum to p bits."""
    # Of two with one exponent the second counts as the larger.
    large, small = (x, y) if unit(x, p) > unit(y, p) else (y, x)
    step = unit(large, p)
    last = step / 2**p
    kept = _towards_zero(small, last)
    if rounds:
        half = step / 2
        large += half if large > 0 else -half
        ratio = step / unit(small, p)
        if ratio < 2**p:
            more = _towards_zero(half / ratio, last)
            kept += more if small > 0 else -more
    cut = _towards_zero(large + kept, step)
    return _towards_zero(cut, unit(cut, p)) if cut else cut


def _cdc_product(p: int, rounds: bool, x: Fraction, y: Fraction) -> Fraction:
    """Add half a unit to a product of the smaller of two lengths, else a quarter; then truncate."""
    units = unit(x, p) * unit(y, p)
    more = units * 2 ** (p - 2) if rounds else Fraction(0)
    value = abs(x * y) + more
    cut = _towards_zero(value, unit(value, p))
    return cut if (x > 0) == (y > 0) else -cut


def _cdc_quotient(p: int, rounds: bool, x: Fraction, y: Fraction) -> Fraction:
    """If the rule rounds, append a third of a unit, truncated to p bits, to the dividend."""
    more = Fraction(2**p // 3, 2**p) * unit(x, p) if rounds else Fraction(0)
    value = (abs(x) + more) / abs(y)
    cut = _towards_zero(value, unit(value, p))
    return cut if (x > 0) == (y > 0) else -cut


def drawn(random: Random, p: int) -> tuple[int, int, int, int]:
    """Return coefficients of p bits and exponents of two numbers, most of them critical."""
    low, high = 1 << p - 1, (1 << p) - 1

    def coefficient() -> int:
        kind = random.randrange(4)
        if kind == 0:
            return random.randint(low, high)
        near = random.choice((0, 1, 2, 3, 1 << random.randrange(p - 1)))
        return low + near if kind == 1 else high - near if kind == 2 else low | near

    x, y = coefficient(), coefficient()
    if random.random() < 0.3:
        y = min(max(x + random.randint(-3, 3), low), high)
    e = random.randint(-60, 60)
    any_ = random.randint(0, 2 * p + 3)
    apart = random.choice((0, 1, 1, 2, 3, p - 1, p, p + 1, 2 * p - 1, 2 * p, any_))
    signs = random.choice((1, -1)), random.choice((1, -1))
    return signs[0] * x, e, signs[1] * y, e + random.choice((1, -1)) * apart


def disagreements(p: int, rule: str, count: int, seed: str) -> list[str]:
    """Return descriptions of operations on drawn pairs whose result is not the exact one."""
    word, random = Word(p, rule), Random(f"{seed} {p} {rule}")
    found = []
    for _ in range(count):
        xm, xe, ym, ye = drawn(random, p)
        name = random.choice("++--*/")
        x, y = word.number(xm, xe), word.number(ym, ye)
        ours: Fraction = OPERATIONS[name](x, y).fraction()
        due = exact(p, rule, name, x.fraction(), y.fraction())
        if ours != due:
            found.append(f"{x!r} {name} {y!r}: {ours}, due {due}")
    return found
