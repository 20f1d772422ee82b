"""Ready events, which the function `solve` finds along a trajectory.

An event is an argument of `pyharness.solve`, in ``events=[...]``. A Python function of time and
omega can be an event too.
"""

from pyharness.engine.event_functions import Event
from pyharness.engine.ready_events import crosses, extremum, flip, rest, tilt

__all__ = ["Event", "crosses", "extremum", "flip", "rest", "tilt"]
