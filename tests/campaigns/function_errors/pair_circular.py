"""Proved bounds of the errors of sine and cosine that are computed as sums of two numbers.

These are the functions of fortran/original/wide_functions.f90 (binary128) and of
web/programs/circular.js (binary64). Both subtract a multiple of pi/2, which is the sum of three
numbers, and sum a Taylor series. Relative errors of the operations are bounds of the literature
(see `pair_operations`), so that the analysis has no intervals.
"""

import math
import re
from dataclasses import dataclass
from fractions import Fraction

from tests.campaigns.function_errors import pair_operations
from tests.campaigns.function_errors.nearness import exponent, half_pi, least_distance
from tests.campaigns.function_errors.pair_operations import rounded_up
from tests.campaigns.function_errors.sources import fortran_numbers, javascript_numbers


@dataclass(frozen=True)
class Method:
    """The constants of one of both functions."""

    digits: int  # bits of a number
    limit: int  # angles are below 2**limit rad
    least: int  # a smaller angle than 2**least rad is its own sine
    terms: int  # of the series after the first
    parts: list[Fraction]  # of pi/2
    quarters: Fraction  # 2/pi
    sums: int  # additions of pairs for each part of pi/2
    divided: bool  # whether each term is divided by its factors, or multiplied by stored quotients


def of_fortran(text: str, limit: int) -> Method:
    """Return the constants of the functions of binary128; `limit` is ANGLE_BITS of model.codes."""
    digits = 113
    terms = re.search(r"N_TERMS = (\d+)", text)
    least = re.search(r"LEAST = 2\.0_wp\*\*\((-\d+)\)", text)
    assert terms
    assert least
    parts = fortran_numbers(text, "HALF_PI", digits)
    quarters = fortran_numbers(text, "QUARTERS", digits)[0]
    return Method(digits, limit, int(least[1]), int(terms[1]), parts, quarters, 1, True)


def of_javascript(text: str) -> Method:
    """Return the constants of the functions in JavaScript."""
    length = re.search(r"terms\.length < (\d+)", text)
    assert length
    limit, least = (exponent(javascript_numbers(text, name)[0]) for name in ("LARGEST", "SMALLEST"))
    parts = javascript_numbers(text, "QUARTER_TURN")
    quarters = javascript_numbers(text, "TWO_OVER_PI")[0]
    return Method(53, limit, least, int(length[1]) - 1, parts, quarters, 2, False)


@dataclass(frozen=True)
class Bound:
    """Proved bounds for all angles below the limit."""

    reduced: Fraction  # relative error of the reduced angle
    relative: Fraction  # of the sum of two numbers, before it is rounded to one
    ulps: Fraction  # of the result, in units in the last place
    decided: int  # bits after the last place; if they decide the rounding, the result is nearest


def bound(method: Method) -> Bound:
    """Return bounds of the errors of sine and cosine."""
    u = Fraction(1, 2**method.digits)
    reduced, widest = _reduced(method, u)
    relative = max(_series(method, u, reduced, widest, odd) for odd in (0, 1))
    # A small angle differs from its sine by less than its cube over 6, and 1 from the cosine by
    # less than half of the square: a quarter of a unit in the last place, or half a unit below 1.
    small = Fraction(2) ** (2 * method.least)
    assert small / 6 < u / 2
    assert small / 2 <= u / 2
    ulps = Fraction(1, 2) + relative * 2**method.digits
    bits = -exponent(relative) - method.digits
    return Bound(reduced, relative, ulps, bits)


def _reduced(method: Method, u: Fraction) -> tuple[Fraction, Fraction]:
    """Return bounds of the relative error and of the magnitude of the reduced angle.

    Each sum of pairs has a relative error, which counts against the angle that remains at last. The
    products of the number of right angles and a part of pi/2 are exact.
    """
    low, high = half_pi()
    each = pair_operations.accurate_sum(u)
    of_sums = rounded_up(method.sums * each * (1 + each) ** method.sums)
    worst = widest = Fraction(0)
    for n in range(method.limit + 1):
        # Above pi/4 there may be a right angle to subtract. Angles up to pi/4 remain as they are.
        angle = Fraction(2) ** n
        distance = least_distance(method.digits, n)
        quarters = angle / low
        off = angle * max(abs(method.quarters - 1 / end) for end in (low, high))
        off += 2 * u * quarters + u
        widest = max(widest, (Fraction(1, 2) + off) * high)
        turns = quarters + 1
        error = Fraction(0)
        for k, part in enumerate(method.parts):
            missing = turns * max(abs(end - sum(method.parts[: k + 1])) for end in (low, high))
            # Between two sums of pairs the low part of the product is still to be subtracted.
            between = turns * part * u if method.sums > 1 else Fraction(0)
            error = rounded_up(error + of_sums * (distance + missing + abs(between) + error))
        worst = max(worst, (error + missing) / distance)
    return rounded_up(worst), rounded_up(widest)


def _series(method: Method, u: Fraction, reduced: Fraction, widest: Fraction, odd: int) -> Fraction:
    """Return a bound of the relative error of the sine (odd = 1) or cosine of the reduced angle."""
    added = pair_operations.accurate_sum(u)
    multiplied = pair_operations.normalized_product(u)
    divided = pair_operations.quotient_by_number(u)
    square = rounded_up(widest**2)
    of_square = rounded_up((1 + reduced) ** 2 * (1 + multiplied) - 1)
    least = 1 - square / (2 if not odd else 6)
    if method.divided:
        error = Fraction(0)
        for k in range(method.terms, 0, -1):
            factor = (2 * k - 1 + odd) * (2 * k + odd)
            term = (1 + of_square) * (1 + error) * (1 + multiplied) * (1 + divided) - 1
            part = square / factor
            error = rounded_up((part * term / (1 - part)) * (1 + added) + added)
    else:
        total = Fraction(0)
        for k in range(method.terms, -1, -1):
            size = Fraction(1, math.factorial(2 * k + odd))
            stored = (1 + divided) ** (2 * k + odd) - 1
            after = square * Fraction(1, math.factorial(2 * k + 2 + odd))
            product = ((1 + of_square) * (1 + multiplied) - 1) * (after + square * total)
            total = size * stored + product + square * total
            total = rounded_up(total + added * (size + after + total))
        error = total / least
    # The first term of the Taylor series that is omitted.
    omitted = square ** (method.terms + 1) / math.factorial(2 * method.terms + 2 + odd)
    error = (1 + error) * (1 + omitted / least) - 1
    if odd:
        error = (1 + error) * (1 + reduced) * (1 + multiplied) - 1
    return rounded_up(error)
