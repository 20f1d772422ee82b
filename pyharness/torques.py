"""Ready terms: predefined torques that depend on time and state.

A sum of terms, torque laws and Python functions is a torque for `pyharness.Scene`. One side of
each + must be a term, or a sum with a term.
"""

from pyharness.engine.torques import field_terms, table_terms, terms, wheel_terms
from pyharness.engine.torques.field_terms import *  # noqa: F403
from pyharness.engine.torques.table_terms import *  # noqa: F403
from pyharness.engine.torques.terms import *  # noqa: F403
from pyharness.engine.torques.wheel_terms import *  # noqa: F403
from pyharness.model.state_torque import opaque, recorded

__all__ = ["opaque", "recorded"]
__all__ += terms.__all__
__all__ += wheel_terms.__all__
__all__ += field_terms.__all__
__all__ += table_terms.__all__
