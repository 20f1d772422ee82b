"""Units in which proofs measure errors of omega.

They are the square roots of abs(A), abs(B) and abs(C) over the largest, and at least 0.01. The
logarithmic norm is then 0 for rotations about the axes of the largest and smallest moment, unless a
unit is 0.01.
"""

import math
from collections.abc import Sequence
from fractions import Fraction

_LEAST = 1e-4  # of the square of the largest unit


def scales_of(coefficients: Sequence[Fraction]) -> list[float]:
    """Return the units of the three components of omega, the largest of them 1."""
    sizes = [abs(x) for x in coefficients]
    largest = max(sizes) or Fraction(1)
    return [math.sqrt(max(float(x / largest), _LEAST)) for x in sizes]
