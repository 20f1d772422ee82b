"""Estimated errors at single times of a trajectory, which is solved again until these times."""

from typing import TYPE_CHECKING

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.values import finite

if TYPE_CHECKING:
    from pyharness.model.trajectory import Trajectory

# The attribute with a function of times and tolerance that solves again; files do not keep it.
AGAIN = "_again"


def error_at(found: "Trajectory", time: float) -> float | None:
    time = finite("error_at: time", time)
    start = 0.0 if found.scene is None else found.scene.t0
    low, high = np.min(found.time, initial=start), np.max(found.time, initial=start)
    if not low <= time <= high:
        raise InputError(f"error_at: {time:g} s; allowed: times from {low:.16g} to {high:.16g} s")
    if len(found.time) == 1 and time == found.time[0]:
        return found.error
    again = found.__dict__.get(AGAIN)
    if again is None or found.tolerance is None:
        return None
    try:
        error: float | None = again([time], found.tolerance).error
    except InputError:
        return None
    return error


def trusted_until(found: "Trajectory") -> float | None:
    start = 0.0 if found.scene is None else found.scene.t0
    times = found.time[np.argsort(np.abs(found.time - start))].tolist()
    tolerance = found.tolerance
    if not times or tolerance is None or min(times) < start < max(times):
        return None
    if found.ended == "complete":
        return float(times[-1])
    if found.error is None or AGAIN not in found.__dict__:
        return None
    # Errors grow, and short spans take less time: the span is doubled, then bisected.
    good, bad, row = -1, len(times), 0
    while bad - good > 1:
        error = error_at(found, times[row])
        if error is not None and error <= tolerance:
            good = row
            row = min(2 * row + 1, len(times) - 1) if bad == len(times) else (good + bad) // 2
        else:
            bad = row
            row = (good + bad) // 2
    return float(times[good]) if good >= 0 else start
