"""Constants that Python and the Fortran kernels share.

fortran/make_codes.py writes each class as a Fortran module.
"""


class Statuses:
    """The codes by which a kernel reports how its run ended."""

    COMPLETE = 0  # all requested rows are present
    STOPPED = 1  # the Lipschitz test ended the run
    OVERFLOW = 2  # an angular velocity overflowed
    REFUSED = 3  # the method does not apply to the input
    GAVE_UP = 4  # work limit exceeded, or no correct digit of the phase is left
    INTERRUPTED = 5  # the user interrupted it; a Python exception is set
    SENSITIVE = 6  # all rows are present, but the amplified rounding error exceeds the tolerance
    UNCHECKED = 7  # all rows are present; SciPy may have stepped over a short change of the torque
    SINGULAR = 8  # the torque is undefined at the last time, but torque and omega are not infinite
    SLIDING = 9  # a switch of the torque would change back and forth without end
    STALLED = 10  # no step is short enough, but omega does not become infinite


class Methods:
    """The codes of a prepared solver's methods."""

    TAPE = 0  # the Taylor series of a recorded torque
    CLOSED_FORM = 1  # for scenes without torque
    SPHERE = 2  # for bodies with three equal moments
    TAYLOR = 3
    QUICK = 4  # Runge-Kutta, for results of few digits
    QUICK_OR_TAYLOR = 5  # QUICK or TAYLOR, whichever needs fewer operations
    CLOSED_FORM_OR_TAYLOR = 6  # the Taylor series if the status of the closed form is REFUSED
    GAUSS = 10  # Gauss collocation has the code GAUSS plus its number of stages, 1 to 8
    FIXED = 100  # each of pyharness/model/fixed_steps.py has FIXED plus its number, from 1


class Places:
    """Indices of the array that a prepared kernel reads."""

    METHOD = 0
    TOLERANCE = 1  # relative; for methods that have a tolerance
    STEP = 2  # s; for Gauss collocation and the methods with a fixed step
    N_SINES = 3
    N_COSINES = 4
    COEFFICIENTS = 5  # three: A, B, C
    CONSTANT = 8  # three, rad/s2: constant term of torque over moment
    RATE = 11  # three, rad/s3: factor of time of torque over moment
    EFFORT = 14  # factor on the work limits
    COEFFICIENTS_LOW = 15  # three: exact minus rounded A, B, C, for the closed form
    MOMENTS = 18  # three, kg m2: for the closed form with attitude
    MOMENTS_LOW = 21  # three, kg m2: exact minus rounded moments
    ROUNDED = 24  # 1: the initial omega was rounded after a rotation to principal axes; else 0
    WAVES = 25  # four numbers for each sine, then four for each cosine; or a tape


class Series:
    """Limits of order and local tolerance of the Taylor method."""

    LEAST_ORDER = 12
    MOST_ORDER = 24
    LEAST_LOCAL_TOLERANCE = 1e-19  # relative to omega: size of the last Taylor terms of a step
    SLACK = 16.0  # a step is shortened if its last Taylor terms exceed this many local tolerances
    # Phase (rad) of the fastest perturbation. Beyond it, inaccurate perturbations lose their phase,
    # and the error amplification computed from them is too small.
    LONG = 5000.0


class Waves:
    """The largest angle for our sine function in binary128."""

    ANGLE_BITS = 60  # the angle must be below 2**ANGLE_BITS rad; otherwise its sine is NaN


class Blocks:
    """The number of bodies that a program integrates together."""

    LANE_COUNT = 32  # several vector registers, so that some compute while others wait


class Storage:
    """The lengths of the kernels' arrays for Taylor series of slots (variables)."""

    SERIES_LENGTH = 40  # terms of a slot's series
    LANE_TERMS = 28  # the same, for many bodies at once
    PERTURBATION_LENGTH = 29  # terms of a perturbation
    MOST_UNKNOWNS = 15
    AT_ONCE = 16  # nodes of a step, without the first, that are evaluated together


class Operations:
    """The codes of recorded operations.

    A weighted term is a term of a Taylor series times its order.
    """

    LINEAR = 1  # a constant plus a linear combination of operands
    PRODUCT = 2
    QUOTIENT = 3
    SQRT = 4
    EXP = 5  # results: the exponential, and the weighted terms of its argument
    SINE_COSINE = 6  # results: the sine, the cosine, and the weighted terms of their argument
    TABLE = 7  # cubic polynomials of time between breakpoints
    TANH = 8  # results: the function, its derivative, and the weighted terms of its argument
    # The result is constant in a step.
    SWITCH = 9  # 1 where the operand is positive, else 0
    FLOOR = 10
    # Operand 2 is the number of a linear combination. The result is this combination where operand
    # 1 is not 0, else the next combination.
    SELECT = 11
    # Operand 2 is the derivative. Results: the function, and the weighted terms of its argument.
    # These kinds are the last ones.
    LOG = 12
    LOG1P = 13
    LOG2 = 14
    LOG10 = 15
    ATAN = 16
    ASIN = 17
    ACOS = 18
    ASINH = 19
    ACOSH = 20
    ATANH = 21
    CBRT = 22
    # The same, with one result.
    EXPM1 = 23
    EXP2 = 24
