"""Ready events for `solve`, which finds them along a trajectory.

An event is an element of the argument ``events=[...]`` of `pyharness.solve`. A Python function of
time and omega can also be an event.
"""

from pyharness.engine.event_functions import Event
from pyharness.engine.ready_events import crosses, extremum, flip, rest, tilt

__all__ = ["Event", "crosses", "extremum", "flip", "rest", "tilt"]
