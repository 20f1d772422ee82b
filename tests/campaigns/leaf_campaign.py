"""A campaign of random recorded torques: compiled leaves against the interpreter.

The command is ``python -m tests.campaigns.leaf_campaign COUNT SEED [FIRST]``. Both compute the
terms of the Taylor series in one step. The terms of an unknown may differ by 4 units in the last
place of its largest term or, if larger, of the step times the summands of its derivative. Five
bodies side by side may differ by the sum of their estimated errors, and these by a tenth.
"""

import sys
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np

from pyharness import Scene, solve_many
from pyharness.checks.scenes import state_scenes
from pyharness.engine.system.leaf_cache import leaves_of
from pyharness.engine.system.recorded import Step, inputs_of, kernel_tape, system_of, taylor_step
from pyharness.model.constant_body import with_constant_body
from pyharness.model.tape import Tape, slot_values
from pyharness.model.tape_arrays import ARRAYS
from pyharness.model.trajectory import Array
from tests.campaigns import driver
from tests.campaigns.driver import Tally

_UNITS = 4.0
_CHANGED = 0.1  # relative change of an estimated error
_LEAVES = 7  # the place of the address of leaves in a tape's array


def one_step(tape: Tape, address: int, t: float, state: Array, h: float) -> Step:
    """Return a step of at most `h` (s), with the leaves at an address, or 0."""
    array = kernel_tape(tape).copy()
    array[_LEAVES : _LEAVES + 1].view(np.int64)[:] = address
    allowed = 1e-9 * np.abs(state).max() * np.ones(len(state))
    return taylor_step(array, t, state, allowed, 1e-12, abs(h), t + h)


def try_torque(tally: Tally) -> None:
    """Compare the terms of one step."""
    source = Random(f"leaves {tally.seed} {tally.number}")
    if source.random() < 0.3:
        scene, time = state_scenes.draw_ready(source, state_scenes.READY + state_scenes.TIMED)
    else:
        scene, time = state_scenes.draw(
            source, state_scenes.STEADY + state_scenes.TURNING + state_scenes.SUDDEN
        )
    tape = system_of(with_constant_body(scene))
    address, leaves = leaves_of(tape)
    if not address:
        tally.counts[leaves] += 1
        return
    compare_many(tally, scene, time, source)
    compare_terms(tally, scene, tape, address, source.random() * time, source)


def compare_terms(
    tally: Tally, scene: Scene, tape: Tape, address: int, t: float, source: Random
) -> None:
    """Compare the terms of a step at time `t`."""
    state = np.array([*scene.omega, *(scene.attitude or ())])
    h = 10.0 ** source.uniform(-3.0, 0.0) / max(map(abs, scene.omega))
    interpreted, compiled = (one_step(tape, each, t, state, h) for each in (0, address))
    if interpreted.h == compiled.h == 0.0:
        tally.counts["singular"] += 1
        return
    # The length of a step depends on the rounding errors of its last terms.
    powers = (interpreted.h / compiled.h) ** np.arange(len(compiled.terms))
    difference = np.abs(compiled.terms * powers[:, None] - interpreted.terms)
    inputs = inputs_of(np.array([t]), state[None])
    values = np.array([np.ravel(each)[0] for each in slot_values(tape, inputs, ARRAYS)])
    summands = [[factor * values[slot] for slot, factor in rate.terms] for rate in tape.outputs]
    parts = [abs(interpreted.h) * np.abs(each).sum() for each in summands]
    sizes = np.maximum(np.abs(interpreted.terms).max(axis=0), parts)
    tally.judge("difference", (difference / np.spacing(sizes)).max(), _UNITS, f", {scene.name}")


def compare_many(tally: Tally, scene: Scene, time: float, source: Random) -> None:
    """Compare the states of bodies side by side."""
    start = np.array(scene.omega)
    omega = np.array([start * (1.0 + 0.2 * source.random()) for _ in range(5)])
    tolerance = 10.0 ** source.uniform(-12.0, -3.0)
    found: list[Any] = [
        solve_many(
            replace(scene), time, omega=omega, tolerance=tolerance, estimates=True, compiled=each
        )
        for each in (False, True)
    ]
    tally.counts[str(found[1].leaves)] += 1
    both = found[0].has_result & found[1].has_result
    sizes = np.maximum(np.abs(omega), np.abs(found[0].omega)).max(axis=1)
    apart = np.abs(found[0].omega - found[1].omega).max(axis=1) / sizes
    errors = [each.error for each in found]
    for k in np.flatnonzero(both & np.isfinite(errors[0] + errors[1])):
        allowed = max(tolerance, 4e-15 * found[0].growth[k])
        tally.judge("many, tolerances", apart[k] / allowed, 1.0, f", {scene.name}")
        tally.judge("many, errors", apart[k] / (errors[0] + errors[1])[k], 1.0, f", {scene.name}")
        changed = abs(errors[1][k] / errors[0][k] - 1.0)
        tally.judge("many, estimates", changed, _CHANGED, f", {scene.name}")


if __name__ == "__main__":
    sys.exit(driver.run("tests.campaigns.leaf_campaign", try_torque, sys.argv[1:]))
