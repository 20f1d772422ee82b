"""The Taylor series of a recorded torque, as a check of an integration by SciPy.

SciPy may step over a short change of the torque. If the results differ, the steps of the series
limit those of SciPy.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pyharness.engine.recorded import outputs_at
from pyharness.engine.stepper import steps_to
from pyharness.model.array_type import Array
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import N_INPUTS, SWITCHES, Linear, Tape

# SciPy's longest step over those of the series; LSODA evaluates the torque only once in a step.
_PART = 0.5
# Stiff equations, which need more steps of the series, are left to SciPy's implicit methods.
_MOST_STEPS = 20_000
# Largest ratio of the steps of the series in a span.
_RATIO = 8.0
# Tolerance of a step of the series, relative to that of the result.
_FINER = 0.01
_FINEST = 1e-13  # tolerance of the steps that end at switches


class Span(NamedTuple):
    """A part of an integration: its end (s), and SciPy's longest step in it (s)."""

    end: float
    longest: float


class Beside(NamedTuple):
    """The rows of a series, and spans with limits on SciPy's steps."""

    rows: Array  # shape (n, 3) or (n, 7)
    spans: list[Span]


def bounds_of(scene: Scene, end: float) -> list[float]:
    """Return the times (s) between 0 and `end` at which a table or switch changes, and `end`.

    Raise InputError where a switch would change back and forth without end.
    """
    torque = scene.torque
    assert isinstance(torque, StateTorque)
    breaks = [] if torque.tape is None else torque.tape.breaks
    if torque.tape is not None and torque.tape.n_switches:
        breaks = breaks + _crossings(scene, torque.tape, end)
    return sorted({*(time for time in breaks if 0.0 < time / (end or 1.0) < 1.0), end}, key=abs)


def _crossings(scene: Scene, tape: Tape, end: float) -> list[float]:
    """Return the times (s) of the series' steps at which the result of a switch changes."""
    slots = [slot for slot, each in enumerate(tape.operations, N_INPUTS) if each.kind in SWITCHES]
    results = replace(tape, outputs=tuple(Linear(0.0, ((slot, 1.0),)) for slot in slots))
    ends, middles, states = [], [], []
    attitude = scene.attitude is not None
    for before, stepper in steps_to(scene, attitude, end, _FINEST, _MOST_STEPS):
        ends.append(stepper.time)
        middles.append(0.5 * before + 0.5 * stepper.time)
        states.append(stepper.at(middles[-1]))
    if not ends:
        return []
    found = outputs_at(results, np.array(middles), np.array(states))
    changed = (found[1:] != found[:-1]).any(axis=1)
    return [time for time, each in zip(ends[:-1], changed.tolist(), strict=True) if each]


def series_beside(scene: Scene, times: Sequence[float], tolerance: float) -> Beside | None:
    """Return the series of a recorded torque at `times` (s); None if it does not reach the end."""
    end, bounds = times[-1], bounds_of(scene, times[-1])
    attitude = scene.attitude is not None
    rows = [[*scene.omega, *(scene.attitude or ())]] if times[0] == 0.0 else []
    lengths: dict[float, float] = {}
    reached = 0.0
    for before, stepper in steps_to(scene, attitude, end, _FINER * tolerance, _MOST_STEPS):
        reached = stepper.time
        lengths[reached] = abs(reached - before)
        after = len(rows)
        while after < len(times) and abs(times[after]) <= abs(reached):
            after += 1
        rows += stepper.at(times[len(rows) : after]).T.tolist()
    if reached != end:
        return None
    return Beside(np.array(rows), _spans(lengths, bounds))


def _spans(lengths: dict[float, float], bounds: Sequence[float]) -> list[Span]:
    spans: list[Span] = []
    least, most, last = math.inf, 0.0, 0.0
    for time, length in lengths.items():
        if time in bounds:
            # The step ends at a bound, and its length is no measure of the torque.
            spans.append(Span(time, _PART * (length if least == math.inf else least)))
            least, most, last = math.inf, 0.0, 0.0
            continue
        if max(most, length) > _RATIO * min(least, length) and last:
            spans.append(Span(last, _PART * least))
            least, most = math.inf, 0.0
        least, most, last = min(least, length), max(most, length), time
    return spans
