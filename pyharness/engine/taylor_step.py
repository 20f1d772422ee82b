"""One step of a differential equation by its Taylor series."""

from typing import NamedTuple

from pyharness.model.extension import COMPLETE, extension
from pyharness.model.trajectory import Array

# The largest order, of fortran/modern/tape_series.f90, plus 1.
_N_TERMS = 29
# The first step that is tried, in the user's unit of time. Its length hardly matters: the series
# tells how much shorter, or up to 16 times longer, the step will be.
LONGEST_TRIAL = 1e3


class Step(NamedTuple):
    """A step that was taken, or tried: its length `h` is 0 if no step is short enough.

    `terms`, shape (order + 1, n), include powers of `h`; `state` is their sum. `expansions` is the
    number of series.
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

    `tolerances` are the largest errors of the components; `relative` decides the order; `trial` is
    a guess, with the sign of the `longest` step, which ends at t + longest, rounded.
    """
    h, terms, end, order, expansions, status = extension().tape_step(
        tape, t, state, tolerances, relative, trial, longest, _N_TERMS
    )
    if status != COMPLETE:
        h = 0.0
    return Step(h, terms[: order + 1], end, expansions)
