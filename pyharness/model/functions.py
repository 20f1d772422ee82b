"""Elementary functions of floats and of the numbers of `pyharness.thesis.word`.

Floats use the C library; results for other numbers are correctly rounded.
"""

import math
from typing import Any


def is_finite(x: Any) -> bool:
    return math.isfinite(x) if isinstance(x, float) else x.is_finite


def square_root(x: Any) -> Any:
    return math.sqrt(x) if isinstance(x, float) else x.sqrt()


def sine(angle: Any) -> Any:
    if not isinstance(angle, float):
        return angle.sin()
    # Python raises an error for an infinite angle; Fortran, like IEEE 754, returns NaN.
    return math.sin(angle) if math.isfinite(angle) else math.nan


def cosine(angle: Any) -> Any:
    if not isinstance(angle, float):
        return angle.cos()
    return math.cos(angle) if math.isfinite(angle) else math.nan
