"""Ready events: predefined functions whose roots `pyharness.solve` finds along a trajectory.

Pass one or more as the argument `events`, which also takes Python functions of time and omega.
"""

from pyharness.engine.events import ready_events
from pyharness.engine.events.event_functions import Event
from pyharness.engine.events.ready_events import *  # noqa: F403

__all__ = ["Event"]
__all__ += ready_events.__all__
