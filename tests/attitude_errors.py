"""`python -m tests.attitude_errors N [SEED]`: the largest errors of the attitude by kind of body.

It draws N random bodies of each kind, with initial conditions and times up to 1e6 s. The results
are compared with the series in integer arithmetic of `tests.exact_attitude`.
"""

import math
import random
import sys

import mpmath
import numpy as np

from pyharness.model.extension import extension
from pyharness.model.trajectory import Array
from tests.exact_attitude import DIGITS, exact

Motion = tuple[list[float], list[float], list[float], float]

KINDS = (
    "generic",
    "near symmetry",
    "near separatrix",
    "middle axis",
    "any axis",
    "flat",
    "needle",
    "symmetric",
    "steady",
    "sphere",
)


def draw(source: random.Random, kind: str, longest: float = 6.0) -> Motion:
    """Return moments, omega, attitude and a time up to 10**`longest` s, with axes in any order."""
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


def errors(motion: Motion) -> tuple[float, float]:
    """Return the largest error of the attitude, and of omega relative to its largest component."""
    moments, omega, attitude, time = motion
    rows, attitudes, n_rows, status = extension().torque_free_attitude_solution(
        moments, omega, attitude, [time]
    )
    assert (n_rows, status) == (1, 0), motion
    exact_omega, exact_attitude = exact(moments, omega, attitude, time)
    largest = max(*map(abs, omega), *(abs(float(x)) for x in exact_omega))
    return (
        largest_error(attitudes[:, 0], exact_attitude),
        largest_error(rows[:, 0], exact_omega) / (largest or 1.0),
    )


def largest_error(found: Array, wanted: list[mpmath.mpf]) -> float:
    """Return the largest error of any component."""
    with mpmath.workdps(DIGITS):
        pairs = zip(found, wanted, strict=True)
        return max(abs(float(mpmath.mpf(float(x)) - y)) for x, y in pairs)


def main(count: int, seed: str = "1") -> None:
    """Print a row of statistics for each kind."""
    print("kind               n  attitude: median      99 %   largest    omega: 99 %   largest")
    for kind in KINDS:
        source = random.Random(f"{kind} {seed}")
        found = np.array([errors(draw(source, kind)) for _ in range(count)])
        middle, most = np.percentile(found, [50, 99], axis=0)
        print(
            f"{kind:15}{count:5}{middle[0]:18.1e}{most[0]:10.1e}{found[:, 0].max():10.1e}"
            f"{most[1]:15.1e}{found[:, 1].max():10.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]), *sys.argv[2:])
