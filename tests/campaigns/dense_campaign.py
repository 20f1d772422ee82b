"""A campaign of random scenes, whose dense output is compared with results at random times.

The command is ``python -m tests.campaigns.dense_campaign COUNT SEED``. Each of COUNT scenes is
solved by one of several methods and with one of several tolerances. Its dense output at 500 random
times is compared with a result that is accurate to 1e-14. The limit of an error is the tolerance
plus 4e-15 K, where the error amplification K is below 1e6. The command prints a line for each scene
in which an error exceeds the limit, then the number of times and the largest ratio of an error to
its limit, by method. It returns exit status 1 if an error exceeds its limit.
"""

import math
import sys
from collections.abc import Sequence
from random import Random

import numpy as np

from pyharness import InputError, Scene, solve
from pyharness.model.attitude import angle_between
from pyharness.scenes.random_scenes import draw as draw_law
from pyharness.scenes.state_scenes import SUDDEN, draw, draw_ready

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


def ratio(seed: str, number: int) -> tuple[str, float]:
    """Return a method, and the largest error of its dense output over the limit.

    The ratio is NaN if the scene is not counted, because its solution is infinite before the end,
    it amplifies errors too much, the method refuses it, or the method's own result at the end is
    wrong: SciPy's methods may miss a pulse of the torque.
    """
    source = Random(f"dense {seed} {number}")
    scene, time = drawn(source, seed, number)
    name = source.choice(("auto", "auto", "taylor", "dop853", "rk45", "lsoda"))
    tolerance = max(METHODS[name], 10.0 ** -source.randrange(3, 14))
    turning = scene.torque.needs_attitude or source.random() < 0.3
    times = sorted({source.uniform(0.0, time) for _ in range(TIMES)}, key=abs)
    try:
        truth = solve(scene, [*times, time], tolerance=1e-14, attitude=turning)
        found = solve(scene, time, name, tolerance, attitude=turning, dense_output=True)
    except InputError:
        return name, math.nan
    growth = solve(scene, time, tolerance=1e-9, attitude=turning).growth
    if not (truth.has_all_rows and found.has_all_rows and growth and growth < MOST_GROWTH):
        return name, math.nan
    assert found.sol is not None
    # The results that are compared with have errors too.
    limit = tolerance + 8e-15 * growth
    scale = np.abs(truth.omega).max()
    if np.abs(found.omega[0] - truth.omega[-1]).max() > limit * scale:
        return name, math.nan
    state = found.sol(truth.time).T
    error = float(np.abs(state[:, :3] - truth.omega).max() / scale)
    if truth.attitude is not None:
        error = max(error, float(angle_between(state[:, 3:], truth.attitude).max()))
    return name, error / limit


def main(arguments: Sequence[str]) -> int:
    """Run the campaign of the command line; return 1 if an error exceeds its limit."""
    count, seed = arguments
    largest: dict[str, float] = {}
    counted = 0
    for number in range(int(count)):
        name, found = ratio(seed, number)
        if math.isnan(found):
            continue
        counted += 1
        largest[name] = max(found, largest.get(name, 0.0))
        if found > 1.0:
            print(f"scene {number} of seed {seed}: {name}, {found:.3g} times the limit")
    print(f"{counted} scenes, {counted * TIMES} times")
    for name, value in sorted(largest.items()):
        print(f"{name:8} largest error over limit {value:.2g}")
    return 1 if max(largest.values(), default=0.0) > 1.0 else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
