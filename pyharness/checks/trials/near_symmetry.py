"""Trial of bodies with two or three equal or nearly equal moments of inertia."""

from collections.abc import Iterator
from functools import partial

from pyharness.checks.check import Attempt, Name
from pyharness.checks.hold import FORMS, check_all, check_methods, truth_of
from pyharness.checks.judge import unknown_flow
from pyharness.checks.scenes.extreme import LONG, SYMMETRIC_START
from pyharness.checks.stress import Trial

# The long time is for closed forms only, whose limits need no error amplification.
_UNKNOWN = unknown_flow(max(map(abs, SYMMETRIC_START)))


def _checks_at(name: Name, time: float) -> Iterator[Attempt]:
    if time == LONG:
        return check_methods(name, time, FORMS, partial(truth_of, flow=_UNKNOWN))
    return check_methods(name, time)


TRIAL = Trial(
    "near-symmetry",
    "moments that differ by 1e-1 to 1e-16 of their size, two equal moments, and the sphere",
    "As in the trial separatrix. The difference of two nearly equal moments is exact, so that no "
    "digits are lost.",
    lambda only: check_all("near-symmetry", _checks_at, lambda each: each.time != LONG),
)
