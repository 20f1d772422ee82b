"""Ready terms: predefined torques that depend on time and state.

A sum of terms, torque laws and Python functions is a torque for `pyharness.Scene`. One side of
each + must be a term, or a sum with a term.
"""

from pyharness.engine import field_terms, table_terms, terms, wheel_terms
from pyharness.engine.field_terms import *  # noqa: F403
from pyharness.engine.table_terms import *  # noqa: F403
from pyharness.engine.terms import *  # noqa: F403
from pyharness.engine.wheel_terms import *  # noqa: F403
from pyharness.model.state_torque import opaque, recorded

__all__ = ["opaque", "recorded"]
__all__ += terms.__all__
__all__ += wheel_terms.__all__
__all__ += field_terms.__all__
__all__ += table_terms.__all__
