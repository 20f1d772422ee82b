"""Codes and constants that Python and the Fortran kernels share.

The script fortran/make_codes.py writes each class as a Fortran module.
"""


class Statuses:
    """Codes for how a computation ended, counted from 0."""

    COMPLETE = 0  # all rows are results
    STOPPED = 1  # the Lipschitz test ended the run
    OVERFLOW = 2  # an angular velocity overflowed
    REFUSED = 3  # the method does not apply to these coefficients
    GAVE_UP = 4  # work limit exceeded, or no digit of the phase is left
    INTERRUPTED = 5  # by the user; a Python exception is set
    SENSITIVE = 6  # all rows are results, but rounding times growth exceeds the tolerance


class Methods:
    """Codes of the methods in the kernel of a prepared solver."""

    CLOSED_FORM = 1  # for scenes without torque
    SPHERE = 2
    TAYLOR = 3
    IMPROVED_EULER = 4
    TAYLOR_3 = 5
    RK4 = 6
    QUICK = 7  # Runge-Kutta, for results of few digits
    QUICK_OR_TAYLOR = 8  # whichever needs fewer operations
    CLOSED_FORM_OR_TAYLOR = 9  # the series if the closed form ends as REFUSED
    GAUSS = 10  # Gauss collocation; the code is GAUSS plus the number of stages, 1 to 8
    SPACE_TORQUE = 19  # the series for a torque about the axes of space, with attitude


class Places:
    """Offsets of the entries in the packed array of a prepared solver, from 0."""

    METHOD = 0
    TOLERANCE = 1  # relative, of the methods that take one
    STEP = 2  # s, of Gauss collocation and the methods with a fixed step
    N_SINES = 3
    N_COSINES = 4
    COEFFICIENTS = 5  # three: A, B, C
    CONSTANT = 8  # three, 1/s2
    RATE = 11  # three, 1/s3
    EFFORT = 14  # factor on the work limits
    COEFFICIENTS_LOW = 15  # three: exact minus rounded A, B, C, for the closed form
    MOMENTS = 18  # three, kg m2: for the closed form with attitude, and for a torque in space
    MOMENTS_LOW = 21  # three, kg m2: exact minus rounded moments
    WAVES = 24  # four numbers for each sine, then four for each cosine


class Series:
    """Limits of order and local tolerance in the Taylor series."""

    LEAST_ORDER = 12
    MOST_ORDER = 24
    LEAST_LOCAL_TOLERANCE = 1e-19  # of omega: last terms of a step, well below rounding
    SLACK = 16.0  # a step is shortened if its last terms exceed this many local tolerances


class Waves:
    """Limits of our sine in binary128 (`wide_functions.f90`)."""

    ANGLE_BITS = 60  # an angle must be below 2 to this power, rad; else its sine is NaN


class Blocks:
    """Number of bodies that the compiled programs of the appendix process side by side."""

    LANE_COUNT = 32  # enough registers that some can proceed while others wait
