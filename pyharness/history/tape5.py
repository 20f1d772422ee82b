"""TAPE5: a trajectory in, the unformatted sequential records of the programs out.

Each WRITE(5)TIME,U1,U2,U3,V1,V2,V3 is one record: its length in bytes, seven binary64 numbers,
the length again, all little-endian; today's Fortran compilers and `scipy.io.FortranFile` read it.
The author's tape had words of 60 bits, as is inferred, and marks of its own.
"""

import numpy as np

from pyharness.model.trajectory import Trajectory

_RECORD = np.dtype([("head", "<i4"), ("items", "<f8", (7,)), ("tail", "<i4")])


def records(trajectory: Trajectory) -> bytes:
    """Return the records of a program's trajectory, one for each row."""
    assert trajectory.velocity is not None
    result = np.empty(len(trajectory.time), dtype=_RECORD)
    result["head"] = result["tail"] = _RECORD["items"].itemsize
    result["items"][:, 0] = trajectory.recorded_time
    result["items"][:, 1:4] = trajectory.omega
    result["items"][:, 4:7] = trajectory.velocity
    return result.tobytes()
