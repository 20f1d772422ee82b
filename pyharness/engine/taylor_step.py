"""One step of a differential equation by its Taylor series."""

from typing import NamedTuple

from pyharness.model.codes import Statuses
from pyharness.model.errors import SLIDING, TimedError
from pyharness.model.extension import COMPLETE, extension
from pyharness.model.trajectory import Array

# The largest order in fortran/modern/tape_series.f90, plus 1.
_N_TERMS = 29
# The first trial step, in the user's unit of time. Its length hardly matters, because the series
# gives any shorter step, or one up to 16 times longer.
LONGEST_TRIAL = 1e3


class Step(NamedTuple):
    """A step of length `h`, 0 if no step is short enough.

    `terms`, shape (order + 1, n), include powers of `h`; `state`, shape (n,), is their sum.
    `expansions` is the number of series computed.
    """

    h: float
    terms: Array
    state: Array
    expansions: int


def taylor_step(
    tape: Array,
    t: float,
    state: Array,
    tolerances: Array,
    relative: float,
    trial: float,
    longest: float,
) -> Step:
    """Return a step of the equation y' = tape(t, y) from the time `t` and the state, shape (n,).

    `tolerances`, shape (n,), are the largest errors of the components; the relative tolerance
    determines the order. `trial` is a guess of the step, with the sign of the `longest` step. Raise
    InputError where a switch would change back and forth without end.
    """
    h, terms, end, order, expansions, status = extension().tape_step(
        tape, t, state, tolerances, relative, trial, longest, _N_TERMS
    )
    if status == Statuses.SLIDING:
        raise TimedError(SLIDING, t)
    if status != COMPLETE:
        h = 0.0
    return Step(h, terms[: order + 1], end, expansions)
