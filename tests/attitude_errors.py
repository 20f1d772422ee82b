"""`python -m tests.attitude_errors N [SEED]`: the largest errors of the attitude by kind of body.

It draws N random bodies of each kind, with initial conditions and times up to 1e6 s. The results
are compared with the enclosures of `tests.exact_attitude`.
"""

import random
import sys

import mpmath
import numpy as np

from pyharness.model.extension import extension
from pyharness.model.trajectory import Array
from tests.checks.scenes.free_motions import KINDS, Motion, draw
from tests.exact_attitude import DIGITS, exact


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
    with mpmath.workdps(DIGITS):
        pairs = zip(found, wanted, strict=True)
        return max(abs(float(mpmath.mpf(float(x)) - y)) for x, y in pairs)


def main(count: int, seed: str = "1") -> None:
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
