"""`python -m tests.attitude_series 3000 [SEED]`: check that the joint series meets its tolerance.

The series integrates omega and attitude of random scenes of `verify`, each to a tolerance from
`TOLERANCES`. The truth is the same series at 1e-14, which `tests/engine/test_attitude.py` compares
with SciPy's solution of all seven unknowns.
"""

import sys
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness import InputError, solve
from pyharness.checks.scenes.random_scenes import draw
from pyharness.model.attitude import angle_between
from tests.campaigns import driver

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
_MOST_GROWTH = 1e6
_ROUNDING = 1e-15  # rounding error for each unit of error amplification


def try_scene(tally: driver.Tally) -> None:
    """Compare the solution of one scene at its tolerance with the truth."""
    drawn = draw(tally.seed, tally.number)
    tolerance = TOLERANCES[tally.number % len(TOLERANCES)]
    times = [0.4 * drawn.time, drawn.time]
    scene = replace(drawn.scene, attitude=(0.5, -0.1, 0.7, 0.5))
    try:
        fine: Any = solve(scene, times, "taylor", 1e-14, attitude=True)
        found: Any = solve(scene, times, "taylor", tolerance, attitude=True)
    except InputError:
        tally.counts["refused"] += 1
        return
    if not (found.has_all_rows and fine.has_all_rows) or fine.growth is None:
        tally.counts[found.ended] += 1
        return
    if fine.growth > _MOST_GROWTH:
        tally.counts["growth beyond 1e6"] += 1
        return
    largest = max(float(np.abs(fine.omega).max()), *map(abs, scene.omega), 1e-300)
    error = max(
        float(angle_between(found.attitude, fine.attitude).max()),
        float(np.abs(found.omega - fine.omega).max()) / largest,
    )
    more = f", {scene.name}, tolerance {tolerance:g}"
    tally.judge("series", error, tolerance + _ROUNDING * fine.growth, more)


if __name__ == "__main__":
    given = [*sys.argv[1:], *("300", "attitude")[len(sys.argv) - 1 :]]
    sys.exit(driver.run("tests.attitude_series", try_scene, given))
