"""Random motions without torque, of several named kinds, for the closed forms."""

import math
from random import Random

from pyharness.model.scene import Triple

Motion = tuple[list[float], list[float], list[float], float]
"""Moments (kg m2), omega (rad/s), attitude (not normalised) and a time (s)."""

KINDS = (
    "generic", "near symmetry", "near separatrix", "middle axis", "any axis", "flat", "needle",
    "symmetric", "steady", "sphere",
)  # fmt: skip


def draw(source: Random, kind: str, longest: float = 6.0) -> Motion:
    """Return a random motion of a kind in `KINDS`, for at most 10**`longest` s."""
    moments = [10 ** source.uniform(-0.5, 0.5) for _ in range(3)]
    omega = [source.choice((-1, 1)) * 10 ** source.uniform(-1, 1) for _ in range(3)]
    low, middle, high = sorted(range(3), key=lambda axis: moments[axis])
    extreme = source.choice((low, high))
    if kind == "near symmetry":
        moments[extreme] = moments[middle] * (
            1.0 + source.choice((-1, 1)) * 10 ** source.uniform(-15, -2)
        )
    elif kind == "near separatrix":
        ratio = moments[high] * (moments[high] - moments[middle])
        ratio /= moments[low] * (moments[middle] - moments[low])
        omega[low] = math.copysign(omega[high] * math.sqrt(ratio), omega[low])
        omega[low] *= 1.0 + source.choice((-1, 1)) * 10 ** source.uniform(-15, -1)
    elif kind in ("middle axis", "any axis", "steady"):
        along = middle if kind == "middle axis" else source.randrange(3)
        for axis in {0, 1, 2} - {along}:
            size = 0.0 if kind == "steady" else 10 ** source.uniform(-12, -1)
            omega[axis] = math.copysign(size, omega[axis])
    elif kind == "flat":
        moments[high] = (moments[low] + moments[middle]) * (1.0 - 10 ** source.uniform(-16, -1))
    elif kind == "needle":
        moments[low] *= 10 ** source.uniform(-10, -1)
    elif kind == "symmetric":
        moments[extreme] = moments[middle]
    elif kind == "sphere":
        moments = [moments[0]] * 3
    attitude = [source.gauss(0.0, 1.0) for _ in range(4)]
    return moments, omega, attitude, source.choice((-1, 1)) * 10 ** source.uniform(-3, longest)


def draw_top(source: Random, kind: str) -> tuple[Triple, Triple, float]:
    """Return random coefficients A, B, C of Euler's equations, omega (rad/s) and a time (s).

    The body rotates by at most about 1e4 radians. `kind` is ``plain``, ``middle axis``, ``near
    symmetry``, ``near separatrix`` or ``wild``.
    """
    width = 3.0 if kind == "wild" else 0.5
    sign = source.choice((1.0, -1.0))
    a = [s * sign * 10 ** source.uniform(-width, width) for s in (1.0, -1.0, 1.0)]
    w = [source.choice((-1.0, 1.0)) * 10 ** source.uniform(-1, 1) for _ in range(3)]
    if kind == "middle axis":
        w[0] = math.copysign(10 ** source.uniform(-15, -1), w[0])
        w[2] = math.copysign(10 ** source.uniform(-15, -1), w[2])
    elif kind == "near symmetry":
        a[2] *= 10 ** source.uniform(-16, -1)
    elif kind == "near separatrix":
        w[2] = w[0] * math.sqrt(a[2] / a[0]) * (1.0 + 10 ** source.uniform(-15, -1))
    turn = source.randrange(3)
    a, w = a[turn:] + a[:turn], w[turn:] + w[:turn]
    rate = max(map(abs, a)) * max(map(abs, w))
    time = source.choice((-1.0, 1.0)) * 10 ** source.uniform(-2, 4) / rate
    return (a[0], a[1], a[2]), (w[0], w[1], w[2]), time
