"""Integers and other constants that Python and the Fortran kernels share.

The script fortran/make_codes.py writes each class as a Fortran module, so that both languages have
the same values.
"""


class Statuses:
    """The integers by which a kernel reports how a computation ended, counted from 0."""

    COMPLETE = 0  # all rows are results
    STOPPED = 1  # the Lipschitz test ended the run
    OVERFLOW = 2  # an angular velocity overflowed
    REFUSED = 3  # the method does not apply to these coefficients
    GAVE_UP = 4  # work limit exceeded, or no digit of the phase is left
    INTERRUPTED = 5  # by the user; a Python exception is set
    SENSITIVE = 6  # all rows are results, but the amplified rounding error exceeds the tolerance


class Methods:
    """The integers that select a method in the kernel of a prepared solver.

    A prepared solver solves one scene by one method, for many initial conditions.
    """

    CLOSED_FORM = 1  # for scenes without torque
    SPHERE = 2
    TAYLOR = 3
    IMPROVED_EULER = 4
    TAYLOR_3 = 5
    RK4 = 6
    QUICK = 7  # Runge-Kutta, for results of few digits
    QUICK_OR_TAYLOR = 8  # whichever needs fewer operations
    CLOSED_FORM_OR_TAYLOR = 9  # the series if the closed form ends as REFUSED
    GAUSS = 10  # Gauss collocation; GAUSS plus the number of stages, 1 to 8
    SPACE_TORQUE = 19  # the series for a torque about the axes of space, with attitude


class Places:
    """Indices, from 0, of the quantities in the array that a prepared solver gives its kernel."""

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
    """Limits of the order and of the local tolerance of the Taylor method."""

    LEAST_ORDER = 12
    MOST_ORDER = 24
    LEAST_LOCAL_TOLERANCE = 1e-19  # relative to omega: size of the last Taylor terms of a step
    SLACK = 16.0  # a step is shortened if its last Taylor terms exceed this many local tolerances


class Waves:
    """The limit of our sine function in binary128 (`wide_functions.f90`)."""

    ANGLE_BITS = 60  # an angle must be below 2 to this power, rad; else its sine is NaN


class Blocks:
    """The number of bodies that the compiled programs of the appendix process in parallel lanes."""

    LANE_COUNT = 32  # enough that some registers can proceed while others wait
