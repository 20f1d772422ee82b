"""Functions of a number, asked of the number itself.

Floats are asked of the C library. Numbers of another word (`pyharness.original.word`) answer
themselves, correctly rounded to the nearest number of that word.
"""

import math
from typing import Any


def is_finite(x: Any) -> bool:
    """Whether a number is neither nan nor infinite."""
    return math.isfinite(x) if isinstance(x, float) else x.is_finite


def square_root(x: Any) -> Any:
    """Return the square root; ValueError for a float below zero."""
    return math.sqrt(x) if isinstance(x, float) else x.sqrt()


def sine(angle: Any) -> Any:
    """Return the sine of an angle (rad)."""
    if not isinstance(angle, float):
        return angle.sin()
    # Python raises for an infinite angle where Fortran, like IEEE 754, answers NaN.
    return math.sin(angle) if math.isfinite(angle) else math.nan


def cosine(angle: Any) -> Any:
    """Return the cosine of an angle (rad)."""
    if not isinstance(angle, float):
        return angle.cos()
    return math.cos(angle) if math.isfinite(angle) else math.nan
