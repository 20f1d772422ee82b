"""Decimals of the balls of python-flint."""

import math
from typing import Any

from pyharness.truth.balls import fraction


def decimals(interval: Any, places: int) -> tuple[str, str]:
    """Return the bounds of an `arb` with some decimals, rounded outward."""
    middle, radius = fraction(interval), fraction(interval.rad())

    def written(number: int) -> str:
        whole, rest = divmod(abs(number), 10**places)
        return f"{'-' if number < 0 else ''}{whole}.{rest:0{places}}"

    low, high = ((middle + sign * radius) * 10**places for sign in (-1, 1))
    return written(math.floor(low)), written(math.ceil(high))
