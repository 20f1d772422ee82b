"""A campaign of random scenes, whose dense output is compared with results at random times.

The command is ``python -m tests.campaigns.dense_campaign COUNT SEED [FIRST]``. Each scene is solved
by one of several methods and with one of several tolerances. Its dense output at 500 random times
is compared with a result that is accurate to 1e-14. The limit of an error is the tolerance plus
8e-15 K, where the error amplification K is below 1e6.
"""

import sys
from collections.abc import Sequence
from random import Random

import numpy as np

from pyharness import InputError, Scene, solve
from pyharness.checks.scenes.random_scenes import draw as draw_law
from pyharness.checks.scenes.state_scenes import SUDDEN, draw, draw_ready
from pyharness.model.attitude import angle_between
from tests.campaigns import driver

TIMES = 500
MOST_GROWTH = 1e6
# The methods and their smallest tolerances.
METHODS = {"auto": 1e-13, "taylor": 1e-13, "dop853": 1e-9, "rk45": 1e-6, "lsoda": 1e-6}


def drawn(source: Random, seed: str, number: int) -> tuple[Scene, float]:
    """Return the random scene of a number, and its time (s)."""
    if number % 4 == 0:
        return draw_ready(source)
    if number % 4 == 1:
        return draw(source, (source.choice(SUDDEN),))
    if number % 4 == 2:
        return draw(source)
    return draw_law(f"dense {seed}", number).scene, source.uniform(-20.0, 20.0)


def try_scene(tally: driver.Tally) -> None:
    """Compare the dense output of a random scene.

    A scene is left out if its solution is infinite before the end, it amplifies errors too much,
    the method refuses it, or the method's own result at the end is wrong: SciPy's methods may miss
    a pulse of the torque.
    """
    source = Random(f"dense {tally.seed} {tally.number}")
    scene, time = drawn(source, tally.seed, tally.number)
    name = source.choice(("auto", "auto", "taylor", "dop853", "rk45", "lsoda"))
    tolerance = max(METHODS[name], 10.0 ** -source.randrange(3, 14))
    turning = scene.torque.needs_attitude or source.random() < 0.3
    times = sorted({source.uniform(0.0, time) for _ in range(TIMES)}, key=abs)
    tally.counts["left out"] += 1
    try:
        truth = solve(scene, [*times, time], tolerance=1e-14, attitude=turning)
        found = solve(scene, time, name, tolerance, attitude=turning, dense_output=True)
    except InputError:
        return
    growth = solve(scene, time, tolerance=1e-9, attitude=turning).growth
    if not (truth.has_all_rows and found.has_all_rows and growth and growth < MOST_GROWTH):
        return
    assert found.sol is not None
    # The results that are compared with have errors too.
    limit = tolerance + 8e-15 * growth
    scale = np.abs(truth.omega).max()
    if np.abs(found.omega[0] - truth.omega[-1]).max() > limit * scale:
        return
    state = found.sol(truth.time).T
    error = float(np.abs(state[:, :3] - truth.omega).max() / scale)
    if truth.attitude is not None:
        error = max(error, float(angle_between(state[:, 3:], truth.attitude).max()))
    tally.counts["left out"] -= 1
    tally.judge(name, error, limit)


def main(arguments: Sequence[str]) -> int:
    return driver.run("tests.campaigns.dense_campaign", try_scene, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
