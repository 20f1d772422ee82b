"""Ready events: predefined functions whose roots `pyharness.solve` finds along a trajectory.

Pass one or more as the argument `events`, which also takes Python functions of time and omega.
"""

from pyharness.engine.event_functions import Event
from pyharness.engine.ready_events import crosses, extremum, flip, rest, tilt

__all__ = ["Event", "crosses", "extremum", "flip", "rest", "tilt"]
