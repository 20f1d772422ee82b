"""One step of an ordinary differential equation by its Taylor series, for callers that step."""

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

    The sum of the time at its beginning and `h` is not rounded. `terms` are the terms of the
    series, shape (order + 1, n); a term includes its power of `h`. `state` is their sum, the state
    at the end, shape (n,). `expansions` counts the series that were computed for it.
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

    `tape` is the array that `kernel_tape` returns. The step is as long as `tolerances` allow, shape
    (n,): the largest errors of the components in this step. `relative` is the relative tolerance
    that decides the order. `trial` is a first guess of the step, with the sign of `longest`, the
    longest step that is allowed. A step as long as that ends at t + longest, which is rounded.
    """
    h, terms, end, order, expansions, status = extension().tape_step(
        tape, t, state, tolerances, relative, trial, longest, _N_TERMS
    )
    if status != COMPLETE:
        h = 0.0
    return Step(h, terms[: order + 1], end, expansions)
