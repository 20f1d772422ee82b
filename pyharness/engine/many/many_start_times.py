"""Many scenes that begin at other times than 0."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.engine.events.event_functions import event_functions
from pyharness.engine.solve import ascending_times
from pyharness.engine.start_time import events_from_zero, from_zero
from pyharness.model.arrays import check_rows, rows_of
from pyharness.model.ensemble import Ensemble
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene


def starts_later(scenes: Scene | Sequence[Scene]) -> bool:
    every = [scenes] if isinstance(scenes, Scene) else scenes
    return any(getattr(each, "t0", 0.0) for each in every)


def solve_many_from_zero(
    scenes: Scene | Sequence[Scene], t_end: Any, times: Any, events: object,
    solve: Callable[..., Ensemble],
) -> Ensemble:  # fmt: skip
    """Solve scenes with `t0` by a function for scenes without."""
    given: Any = scenes
    is_one = isinstance(scenes, Scene)
    every: list[Scene] = [given] if is_one else list(given)
    starts = np.array([each.t0 for each in every])
    has_one_start = (starts == starts[0]).all()
    if not has_one_start and (times is not None or events is not None):
        what = "events" if times is None else "times"
        raise InputError(f"{what}: the scenes differ in t0; allowed: scenes with the same t0")
    by = starts[:1] if has_one_start else starts
    more: dict[str, Any] = {}
    if events is not None:
        functions = event_functions(events, every[0].has_attitude, every[0].states)
        more["events"] = events_from_zero(functions, float(by[0]))
    moved = [from_zero(each) if each.t0 else each for each in every]
    scene = moved[0] if is_one else moved
    if times is not None:
        values, turned = ascending_times(times)
        rows = np.array(values[::-1] if turned else values)
        return _shifted(solve(scene, times=rows - by, **more), by, rows)
    ends = rows_of("t_end", t_end)
    if not is_one:
        check_rows("t_end", ends, len(every))
    found = _shifted(solve(scene, ends - by, **more), by, None)
    object.__setattr__(found, "t_end", np.broadcast_to(ends, len(found.omega)))
    return found


def _shifted(found: Ensemble, by: Any, times: Any) -> Ensemble:
    if found.t_events is not None:
        rows = [[None if x is None else x + by[0] for x in each] for each in found.t_events]
        found = replace(found, t_events=rows)
    return found if times is None else replace(found, times=times)
