"""Random batches of `solve_many` with arrays of parameters, compared with `solve` of each body.

The command is ``python -m tests.campaigns.many_campaign COUNT SEED [FIRST]``. The limit of the
difference, relative to the largest |omega|, is twice the tolerance, and 1e-14 times the error
amplification. Both must end alike; but kernels estimate errors differently, so that one of two
results may be `sensitive`. Batches may be refused for a reason in `_REFUSALS`.
"""

import re
import sys
from random import Random
from typing import Any

import numpy as np

from pyharness import Ensemble, InputError, Scene, Trajectory, solve, solve_many
from pyharness.model.errors import TimedError
from pyharness.model.extension import ENDS
from tests.campaigns import driver
from tests.campaigns.many_batches import KINDS, Batch, draw

MODULE = "tests.campaigns.many_campaign"
_OF_GROWTH = 1e-14  # limit of a relative difference, times the error amplification
_OF_SLOPES = 1e-6  # limit of a relative difference of derivatives
_SAMPLES = 25  # times at which |omega| is computed
_WITH_RESULT = {"complete", "sensitive"}
# Why no step is short enough, which `solve` finds out by another integration.
_BECAUSE = {"overflow", "singular"}
# Combinations that `solve_many` refuses. Functions of own states have no parameters.
_REFUSALS = {
    "method": "method gauss-4 has no prepared solver for .*; allowed: auto, taylor, .*",
    "parameters of wheels": "parameters: '[abc]'; allowed: .*: none here",
    "derivatives of a method": "sensitivities: the method is gauss-4; allowed: .*",
    "with states": "(sensitivities|compiled): the scene has states of its own; allowed: solve",
}


def try_batch(tally: driver.Tally) -> None:
    """Compare a random batch with its bodies alone."""
    kind = KINDS[tally.number % len(KINDS)]
    batch = draw(Random(f"many {tally.seed} {tally.number}"), kind)
    try:
        found = solve_many(batch.scene, **batch.arguments)
    except InputError as refusal:
        text = str(refusal)
        for reason, pattern in _REFUSALS.items():
            if re.fullmatch(pattern, text):
                tally.counts[f"refused: {reason}"] += 1
                return
        tally.fault(f"{kind}: refused: {text}")
        return
    tally.counts["batches"] += 1
    for i in range(len(found.omega)):
        _compare(tally, batch, found, i)
        if found.sensitivities is not None and found.has_result[i].all():
            _judge_slopes(tally, batch, found, i)


def _compare(tally: driver.Tally, batch: Batch, found: Ensemble, i: int) -> None:
    times, requested = batch.arguments.get("times"), _times_of(batch, i)
    rows: list[Any] = [i] if times is None else [(i, j) for j in range(len(times))]
    # Bodies with own states have all times in one solution.
    calls = [(requested, rows)] if batch.scene.states else [
        (requested[[j]], [row]) for j, row in enumerate(rows)
    ]  # fmt: skip
    for each, places in calls:
        ended, one, scene = _alone(batch, i, each)
        endings = {ENDS[found.status[row]] for row in places}
        # Rows before the end of a motion are complete.
        if len(places) > 1 and ended not in _WITH_RESULT:
            endings.discard("complete")
        more = f", body {i}, t = {each.tolist()}"
        tally.counts[f"ended {ended}"] += 1
        if endings == {ended} == {"sensitive"}:
            continue
        if one is not None and scene is not None and {ended, *endings} <= _WITH_RESULT:
            if endings != {ended}:
                tally.counts["complete beside sensitive"] += 1
            _judge(tally, batch, found, places, one, scene, more)
        elif endings - {ended} and (endings != {"stalled"} or ended not in _BECAUSE):
            tally.fault(f"{batch.kind}: ended {', '.join(endings)}; alone: {ended}{more}")


def _times_of(batch: Batch, i: int) -> Any:
    if "times" in batch.arguments:
        return batch.arguments["times"]
    ends = np.asarray(batch.arguments["t_end"])
    return np.atleast_1d(ends[i] if ends.ndim else ends)


def _alone(batch: Batch, i: int, times: Any) -> tuple[str, Trajectory | None, Scene | None]:
    given = {name: batch.arguments[name] for name in ("method", "tolerance", "effort")}
    try:
        scene = batch.alone(i)
        one = solve(scene, times, **given)
    except TimedError:
        return "gave up", None, None
    except InputError:
        return "refused", None, None
    return one.ended, one, scene


def _judge(
    tally: driver.Tally, batch: Batch, found: Ensemble, places: list[Any], one: Trajectory,
    scene: Scene, more: str,
) -> None:  # fmt: skip
    tolerance, last = batch.arguments["tolerance"], max(one.time.tolist(), key=abs)
    samples = np.linspace(0.0, last, _SAMPLES) if last else [0.0]
    path: Any = solve(scene, samples, tolerance=1e-6)
    limit = 2.0 * tolerance + _OF_GROWTH * (one.growth or 1.0)
    pairs: list[Any] = [("omega", found.omega, one.omega, np.abs(path.omega).max())]
    if found.attitude is not None:
        assert one.attitude is not None
        pairs.append(("attitude", found.attitude, one.attitude, 0.5))
    if found.own is not None:
        pairs.append(("states", found.own, one.own, np.abs(path.own).max()))
    for name, ours, theirs, scale in pairs:
        apart = np.abs(np.array([ours[row] for row in places]) - theirs).max()
        tally.judge(f"{batch.kind}: {name}", apart / (scale or 1.0), limit, more)


def _judge_slopes(tally: driver.Tally, batch: Batch, found: Ensemble, i: int) -> None:
    refusals, names = found.refusals or {}, ("method", "tolerance", "effort", "sensitivities")
    given = {name: batch.arguments[name] for name in names}
    try:
        slopes: Any = solve(batch.alone(i), _times_of(batch, i), **given).sensitivities
    except InputError as refusal:
        if i not in refusals:
            tally.fault(f"{batch.kind}: derivatives of body {i} alone: {refusal}")
        return
    if i in refusals:
        tally.fault(f"{batch.kind}: derivatives of body {i}: {refusals[i]}")
        return
    assert found.sensitivities is not None
    for name, theirs in slopes.items():
        apart = np.abs(found.sensitivities[name][i] - theirs).max()
        size = np.abs(theirs).max(initial=_OF_SLOPES)
        tally.judge(f"{batch.kind}: derivatives", apart / size, _OF_SLOPES, f", body {i}, {name}")


if __name__ == "__main__":
    sys.exit(driver.run(MODULE, try_batch, sys.argv[1:]))
