"""The numbers that Python and the kernels share: fortran/make_codes.py writes them in Fortran."""


class Statuses:
    """How a computation ended; counted from 0."""

    COMPLETE = 0  # every row is a result
    STOPPED = 1  # the Lipschitz test ended the run
    OVERFLOW = 2  # an angular velocity left the range of numbers
    REFUSED = 3  # the method can't take these coefficients
    GAVE_UP = 4  # no digit of the phase is left, or too many steps
    INTERRUPTED = 5  # by the user; an exception is set
    SENSITIVE = 6  # every row is a result, but rounding times growth exceeds the tolerance


class Methods:
    """What the kernel of a prepared solver may be asked for."""

    CLOSED_FORM = 1  # without torque
    SPHERE = 2
    TAYLOR = 3
    IMPROVED_EULER = 4
    TAYLOR_3 = 5
    RK4 = 6
    QUICK = 7  # Runge-Kutta for few digits
    QUICK_OR_TAYLOR = 8  # whichever takes fewer operations
    CLOSED_FORM_OR_TAYLOR = 9  # the series where the closed form refuses
    GAUSS = 10  # and the number of stages, 8 at the most
    SPACE_TORQUE = 19  # the series of a torque about the axes of space, with attitude


class Places:
    """Where in the packed array of a prepared solver something stands, from 0."""

    METHOD = 0
    TOLERANCE = 1  # relative, of the series
    STEP = 2  # s, of the methods with a fixed step
    N_SINES = 3
    N_COSINES = 4
    COEFFICIENTS = 5  # three
    CONSTANT = 8  # three, 1/s2
    RATE = 11  # three, 1/s3
    EFFORT = 14  # factor on the limits
    COEFFICIENTS_LOW = 15  # three: what rounding took off, for the closed form
    MOMENTS = 18  # three: of the closed form with attitude, and where the torque is in space
    MOMENTS_LOW = 21  # three: what rounding took off them
    WAVES = 24  # four for each sine, then for each cosine


class Series:
    """Limits of the Taylor series."""

    LEAST_ORDER = 12
    MOST_ORDER = 24
    LEAST_LOCAL_TOLERANCE = 1e-19  # part of omega that a step may leave out, well below rounding
    SLACK = 16.0  # times that part, before a step does not pass


class Waves:
    """Of our own sine in binary128 (`wide_functions.f90`)."""

    ANGLE_BITS = 60  # of angles from 2 to this power on, rad, quarters are not counted


class Blocks:
    """How many bodies go side by side through the programs of the appendix."""

    LANE_COUNT = 32  # so that while one register waits there are others to go on with
