"""A campaign of random recorded torques: compiled leaves against the interpreter.

The command is ``python -m tests.campaigns.leaf_campaign COUNT SEED [FIRST]``. Both compute the
terms of the Taylor series in one step. The terms of an unknown may differ by 4 units in the last
place of its largest term or, if larger, of the step times the summands of its derivative.
"""

import sys
from random import Random

import numpy as np

from pyharness.checks.scenes.state_scenes import (
    READY,
    STEADY,
    SUDDEN,
    TIMED,
    TURNING,
    draw,
    draw_ready,
)
from pyharness.engine.leaf_cache import leaves_of
from pyharness.engine.recorded import Step, inputs_of, kernel_tape, system_of, taylor_step
from pyharness.model.constant_body import with_constant_body
from pyharness.model.tape import Tape, slot_values
from pyharness.model.tape_arrays import ARRAYS
from pyharness.model.trajectory import Array
from tests.campaigns import driver
from tests.campaigns.driver import Tally

_UNITS = 4.0
_LEAVES = 7  # the place of the address of leaves in a tape's array


def one_step(tape: Tape, address: int, t: float, state: Array, h: float) -> Step:
    """Return a step of at most `h` (s), with the leaves at an address, or 0."""
    array = kernel_tape(tape).copy()
    array[_LEAVES : _LEAVES + 1].view(np.int64)[:] = address
    allowed = 1e-9 * np.abs(state).max() * np.ones(len(state))
    return taylor_step(array, t, state, allowed, 1e-12, h, h)


def try_torque(tally: Tally) -> None:
    """Compare the terms of one step."""
    source = Random(f"leaves {tally.seed} {tally.number}")
    if source.random() < 0.3:
        scene, time = draw_ready(source, READY + TIMED)
    else:
        scene, time = draw(source, STEADY + TURNING + SUDDEN)
    tape = system_of(with_constant_body(scene))
    address, leaves = leaves_of(tape)
    if not address:
        tally.counts[leaves] += 1
        return
    state = np.array([*scene.omega, *(scene.attitude or ())])
    h = 10.0 ** source.uniform(-3.0, 0.0) / max(map(abs, scene.omega))
    t = source.random() * time
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


if __name__ == "__main__":
    sys.exit(driver.run("tests.campaigns.leaf_campaign", try_torque, sys.argv[1:]))
