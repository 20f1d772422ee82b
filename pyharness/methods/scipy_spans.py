"""The spans of an integration by SciPy under a recorded torque, each with its longest step.

SciPy's methods see a torque only where they evaluate it, and may pass a short change of it. The
steps of its Taylor series are as short as the torque demands, so that they bound SciPy's steps.
"""

import math
from typing import NamedTuple

from pyharness.methods.stepper import step_lengths
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque

# SciPy's longest step over the steps of the series. LSODA evaluates a torque once in a step.
_PART = 0.5
# Of the series: stiff equations, which SciPy's implicit methods solve, have too many.
_MOST_STEPS = 20_000
# Largest ratio of the steps of the series in a span.
_RATIO = 8.0


class Span(NamedTuple):
    """A part of an integration: the time at its end (s), and its longest step (s)."""

    end: float
    longest: float


def spans_of(scene: Scene, end: float, tolerance: float) -> tuple[list[Span], bool]:
    """Return the spans from time 0 to `end` (s), and whether the series reaches `end`.

    A span ends where a table of the torque changes.
    """
    torque = scene.torque
    assert isinstance(torque, StateTorque)
    assert torque.tape is not None
    inside = {time for time in torque.tape.breaks if 0.0 < time / (end or 1.0) < 1.0}
    bounds = sorted({*inside, end}, key=abs)
    attitude = scene.attitude is not None
    lengths, reached = step_lengths(scene, attitude, end, tolerance, bounds, _MOST_STEPS)
    if reached != end:
        return [Span(time, math.inf) for time in bounds], False
    spans: list[Span] = []
    least, most, last = math.inf, 0.0, 0.0
    for time in sorted({*lengths, *bounds}, key=abs):
        # A step that a bound has cut says nothing.
        length = lengths.get(time, least)
        if max(most, length) > _RATIO * min(least, length) and last:
            spans.append(Span(last, _PART * least))
            least, most = math.inf, 0.0
            length = lengths.get(time, math.inf)
        least, most, last = min(least, length), max(most, length), time
        if time in bounds:
            spans.append(Span(time, _PART * least))
            least, most, last = math.inf, 0.0, 0.0
    return spans, True
