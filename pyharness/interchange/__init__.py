"""Attitudes in the files of other programs: CCSDS attitude ephemerides, and C-kernels of SPICE."""

from pyharness.interchange.aem import AttitudeEphemeris, read_aem, write_aem
from pyharness.interchange.ck import write_ck
from pyharness.interchange.knots import interpolation_times

__all__ = ["AttitudeEphemeris", "interpolation_times", "read_aem", "write_aem", "write_ck"]
