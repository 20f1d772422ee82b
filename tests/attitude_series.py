"""`python -m tests.attitude_series 3000`: check that the joint series meets its tolerance.

The series integrates omega and attitude of random scenes of `verify`, plain and nasty, with torque
or not, each to a tolerance from `TOLERANCES`. The truth is the same series at 1e-14, which
`tests/methods/test_attitude.py` compares with SciPy's solution of all seven unknowns.
"""

import sys
from collections import Counter
from dataclasses import replace

import numpy as np

from pyharness import InputError, solve
from pyharness.model.attitude import angle_between
from pyharness.scenes.random_scenes import draw

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
_MOST_GROWTH = 1e6
_ROUNDING = 1e-15  # rounding error for each unit of error amplification


def main(count: int, seed: str) -> int:
    """Print the outcomes of `count` scenes; return exit status 1 if one exceeds its tolerance."""
    said: Counter[str] = Counter()
    shares: list[float] = []
    for number in range(count):
        drawn = draw(seed, number)
        tolerance = TOLERANCES[number % len(TOLERANCES)]
        times = [0.4 * drawn.time, drawn.time]
        scene = replace(drawn.scene, attitude=(0.5, -0.1, 0.7, 0.5))
        try:
            fine = solve(scene, times, "taylor", 1e-14, attitude=True)
            found = solve(scene, times, "taylor", tolerance, attitude=True)
        except InputError:
            said["refused"] += 1
            continue
        if not (found.has_all_rows and fine.has_all_rows) or fine.growth is None:
            said[found.ended] += 1
            continue
        if fine.growth > _MOST_GROWTH:
            said["growth beyond 1e6"] += 1
            continue
        assert found.attitude is not None
        assert fine.attitude is not None
        largest = max(float(np.abs(fine.omega).max()), *map(abs, scene.omega), 1e-300)
        error = max(
            float(angle_between(found.attitude, fine.attitude).max()),
            float(np.abs(found.omega - fine.omega).max()) / largest,
        )
        share = error / (tolerance + _ROUNDING * fine.growth)
        shares.append(share)
        if share > 1.0:
            said["exceeds"] += 1
            print(f"draw {number} of seed {seed} ({scene.name}) at {tolerance:g}: {error:.1e}")
        said["held" if share <= 1.0 else "too large"] += 1
    print(f"{count} scenes of seed {seed}: {dict(said)}")
    quantiles = np.quantile(shares, [0.5, 0.99, 1.0])
    print("error over tolerance, median, 99 %, most: " + ", ".join(f"{x:.2g}" for x in quantiles))
    return 1 if said["exceeds"] else 0


if __name__ == "__main__":
    number, seed = [*sys.argv[1:], *("300", "attitude")[len(sys.argv) - 1 :]]
    sys.exit(main(int(number), seed))
