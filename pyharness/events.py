"""Ready events: predefined functions whose roots `pyharness.solve` finds along a trajectory.

Pass one of them, or a list, as the argument `events`. A Python function of time and omega can also
be an event.
"""

from pyharness.engine.event_functions import Event
from pyharness.engine.ready_events import crosses, extremum, flip, rest, tilt

__all__ = ["Event", "crosses", "extremum", "flip", "rest", "tilt"]
