"""Dense output and events of a trajectory."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.engine.events.event_fits import Solution
from pyharness.engine.events.event_functions import EventFunction
from pyharness.engine.events.events import FoundEvents, found_events, no_events
from pyharness.engine.events.periodic_events import PERIODS, are_of_omega
from pyharness.engine.methods.closed_form import period_of
from pyharness.engine.plan.registry import METHODS
from pyharness.engine.steps import dense
from pyharness.model.dense_output import DenseOutput, Pieces
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory


def solution_of(
    scene: Scene, found: Trajectory, rows: dense.Rows, method: str, tolerance: float
) -> DenseOutput:
    is_closed = not found.evaluations and method != "reference"
    return dense.dense_output(scene, found, rows, tolerance, METHODS[method].finest, is_closed)


def with_events(
    scene: Scene,
    found: Trajectory,
    sol: DenseOutput,
    functions: list[EventFunction],
    ends: tuple[float, float],
    rows: dense.Rows,
    method: str,
    tolerance: float,
) -> tuple[Trajectory, FoundEvents]:
    """Return a trajectory without times beyond a terminal event, and the events.

    `ends` are the first and last requested times (s).
    """
    events = no_events(len(functions), len(found.y))
    if sol.t_min < sol.t_max:
        pieces, period = sol.states, 0.0
        if not isinstance(pieces, Pieces):
            if are_of_omega(functions):
                period = period_of(scene)
            shown = _first_periods(found, rows, tolerance, period)
            pieces = dense.state_pieces(scene, shown, rows, tolerance, METHODS[method].finest)
        # The tolerance 1 means fixed steps.
        own = tolerance if tolerance < 1.0 else 0.0
        events = found_events(functions, Solution(pieces, sol, own), period)
    cut: dict[str, Any] = {}
    is_terminal = math.isfinite(events.first) or math.isfinite(events.last)
    if is_terminal:
        kept = (found.time >= events.first) & (found.time <= events.last)
        cut |= {name: each[kept] for name, each in found.with_rows().items()}
    # An overflow that no terminal event precedes remains the ending.
    overflowed = found.ended == "overflow" and (
        (events.first == -math.inf and ends[0] < min(found.time, default=0.0))
        or (events.last == math.inf and ends[1] > max(found.time, default=0.0))
    )
    if is_terminal and not overflowed:
        cut["ended"] = "event"
    if found.sol is not None:
        low, high = max(sol.t_min, events.first), min(sol.t_max, events.last)
        cut["sol"] = replace(sol, t_min=low, t_max=high)
    return replace(found, **cut, t_events=events.times, y_events=events.states), events


def _first_periods(
    found: Trajectory, rows: dense.Rows, tolerance: float, period: float
) -> Trajectory:
    """Return `found`, with three periods on a side of time 0 that has over six."""
    ends = found.time[[0, -1]]
    last = PERIODS * period
    # For little more than three periods, repetition would save nothing.
    if last == 0.0 or np.abs(ends).max() <= 2.0 * last:
        return found
    return rows(
        np.unique(np.where(np.abs(ends) > 2.0 * last, np.sign(ends) * last, ends)), tolerance
    )


def with_events_reversed(found: Trajectory) -> Trajectory:
    times, states = found.t_events or [], found.y_events or []
    return replace(found, t_events=[x[::-1] for x in times], y_events=[x[::-1] for x in states])
