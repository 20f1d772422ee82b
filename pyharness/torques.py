"""Ready terms: predefined torques that depend on time and state.

A sum of terms, torque laws and Python functions is a torque for `pyharness.Scene`. One side of
each + must be a term, or a sum with a term.
"""

from pyharness.engine.field_terms import (
    gravity_gradient,
    in_space,
    magnetic_damping,
    magnetic_dipole,
)
from pyharness.engine.table_terms import pulses, table
from pyharness.engine.terms import attitude_control, damping, drag, rate_control, wheels
from pyharness.model.state_torque import opaque, recorded

__all__ = [
    "attitude_control",
    "damping",
    "drag",
    "gravity_gradient",
    "in_space",
    "magnetic_damping",
    "magnetic_dipole",
    "opaque",
    "pulses",
    "rate_control",
    "recorded",
    "table",
    "wheels",
]
