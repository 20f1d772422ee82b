"""Random controlled bodies, against an integration in 32 digits that locates the switches itself.

The command is ``python -m tests.campaigns.switch_campaign COUNT SEED [FIRST]``. Of twelve numbers
one slides, one grazes a level, and ten have one to three elements of a controller, such as a
saturation or a relay. The limit of an error is the tolerance plus 4e-15 K.
"""

import math
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from random import Random
from typing import Any

import numpy as np

from pyharness import InputError, Trajectory, solve
from tests.campaigns import driver
from tests.campaigns.entries import Result, Truth, results
from tests.campaigns.switched import SlidingError, integrated
from tests.campaigns.switched_scenes import Controlled, controlled, grazing, sliding

MODULE = "tests.campaigns.switch_campaign"
_PERTURBATION = 1e-10  # rad/s
_SLOW = 0.2  # s: limit of the run time of a scene that slides


def truth_of(body: Controlled, times: list[float]) -> tuple[Truth, Any, int]:
    """Return the true motion, the states with their sizes, and the number of crossings."""
    start = [*body.omega, *([1.0, 0.0, 0.0, 0.0] if body.turning else []), *body.states.values()]
    rows, largest, crossings = integrated(body.expanded, list(map(Decimal, start)), times)
    found, n = np.array(rows, dtype=float), 7 if body.turning else 3
    turned = None
    if body.turning:
        turned = found[:, 3:7] / np.linalg.norm(found[:, 3:7], axis=1)[:, None]
    states = found[:, n:], [float(x) or 1.0 for x in largest[n:]]
    return Truth(times, found[:, :3], turned, float(max(largest[:3]))), states, crossings


def amplified(body: Controlled, truth: Truth, axis: int) -> float:
    """Return the largest change of omega at the times by a perturbation of its start."""
    omega = [x + _PERTURBATION * (k == axis) for k, x in enumerate(body.omega)]
    moved = truth_of(replace(body, omega=omega), truth.times)[0]
    change = np.linalg.norm(moved.omega - truth.omega, axis=1).max()
    return float(change / (omega[axis] - body.omega[axis]))


def try_scene(tally: driver.Tally) -> None:
    """Solve one random scene with one tolerance by every entry point."""
    source = Random(f"switches {tally.seed} {tally.number}")
    tolerance = 10.0 ** source.uniform(-12.0, -3.0)
    names = {0: "sliding", 1: "grazing"}
    if tally.number % 12 == 0:
        kind, body = "sliding", sliding(source)
    elif tally.number % 12 == 1:
        kind, body = "grazing", grazing(source)
    else:
        kind, body = controlled(source)
    group = names.get(tally.number % 12, "controlled")
    times = [part * body.end for part in (0.23, 0.61, 1.0)]
    scene = body.scene()
    more = f", tolerance {tolerance:.3g}, {kind}"
    started = time.perf_counter()
    try:
        found: Any = solve(scene, times, tolerance=tolerance, attitude=body.turning)
    except InputError:
        tally.counts[f"{group}: work limit"] += 1  # an omega that grows crosses ever more levels
        return
    taken = time.perf_counter() - started
    tally.counts[f"{group}: {found.ended}"] += 1
    try:
        truth, states, crossings = truth_of(body, times)
    except OverflowError:
        tally.counts["no truth"] += 1
        return
    except SlidingError as error:
        if group == "sliding":
            tally.judge("sliding: run time", taken, _SLOW, more)
        tally.counts["truth slides"] += 1
        reported = re.search(r"t = (\S+) s", str(found.reason))
        limit = max(1e-5, 10.0 * tolerance) * abs(body.end)
        if not reported or abs(float(reported[1]) - error.args[0]) > limit:
            tally.fault(f"{found.ended}, {found.reason}, but slides from {error} s on{more}")
        return
    tally.counts["crossings"] += crossings
    if found.ended not in ("complete", "sensitive"):
        tally.fault(f"{found.ended} {found.reason}{more}")
        return
    _judge(tally, group, (truth, states), found, tolerance, more)
    if found.ended == "complete" and found.growth < 1e6 and tally.number % 3 == 2:
        change = amplified(body, truth, source.randrange(3))
        limit = math.sqrt(found.growth**2 + len(found.y) - 1)
        tally.judge("amplification", change, 1.02 * limit, more)
    if not body.states:
        for each in results(scene, times, tolerance):
            _judge_other(tally, truth, each, tolerance, found.growth, more)


def _judge(
    tally: driver.Tally, group: str, truth: tuple[Truth, Any], found: Trajectory, tolerance: float,
    more: str,
) -> None:  # fmt: skip
    wanted, states = truth
    error = wanted.error(found.omega, found.attitude, False)
    for n, values in enumerate(found.states.values()):
        error = max(error, float(np.abs(values - states[0][:, n]).max()) / states[1][n])
    assert found.growth is not None
    assert found.error is not None
    more += f", K {found.growth:.3g}, estimate {found.error:.3g}, {found.ended}"
    if found.ended == "complete":
        tally.judge(f"{group}: error", error, tolerance + 4e-15 * found.growth, more)
    else:
        tally.record(f"{group}: error if sensitive", error / tolerance)
    if error > 100.0 * found.error + 1e-15:
        tally.fault(f"estimate {found.error:.3g} for the error {error:.3g}{more}")


def _judge_other(
    tally: driver.Tally, truth: Truth, found: Result, tolerance: float, growth: float, more: str
) -> None:
    tally.counts[f"{found.entry}: {found.ended.partition(':')[0]}"] += 1
    if found.ended != "complete":
        return
    error = truth.error(found.omega, found.attitude, found.last_only)
    tally.judge(found.entry, error, tolerance + 4e-15 * growth, f"{more}, K {growth:.3g}")


def main(arguments: Sequence[str]) -> int:
    return driver.run(MODULE, try_scene, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
