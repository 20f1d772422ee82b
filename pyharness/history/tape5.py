"""TAPE5, the file of unformatted sequential records that each program writes.

Each WRITE(5)TIME,U1,U2,U3,V1,V2,V3 is one record: its length in bytes, seven binary64 numbers, and
the length again. All are little-endian, as in today's Fortran compilers and `scipy.io.FortranFile`.
The author's tape had other record marks and, as we infer, words of 60 bits.
"""

import numpy as np

from pyharness.model.trajectory import Trajectory

_RECORD = np.dtype([("head", "<i4"), ("items", "<f8", (7,)), ("tail", "<i4")])


def records(trajectory: Trajectory) -> bytes:
    """Return the bytes of TAPE5 for a trajectory with translational velocities."""
    assert trajectory.velocity is not None
    result = np.empty(len(trajectory.time), dtype=_RECORD)
    result["head"] = result["tail"] = _RECORD["items"].itemsize
    result["items"][:, 0] = trajectory.recorded_time
    result["items"][:, 1:4] = trajectory.omega
    result["items"][:, 4:7] = trajectory.velocity
    return result.tobytes()
