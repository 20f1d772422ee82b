"""Trial of bodies with two or three moments of inertia that are equal or nearly equal."""

from collections.abc import Iterator
from functools import partial

from pyharness.checks.check import Attempt, Name
from pyharness.checks.hold import FORMS, check_all, check_methods, truth_of
from pyharness.checks.judge import unknown_flow
from pyharness.checks.stress import Trial
from pyharness.scenes.extreme import LONG, SYMMETRIC_START

# The long time is tried only with closed forms, because their limits need no bound on the error
# amplification.
_UNKNOWN = unknown_flow(max(map(abs, SYMMETRIC_START)))


def _checks_at(name: Name, time: float) -> Iterator[Attempt]:
    if time == LONG:
        return check_methods(name, time, FORMS, partial(truth_of, flow=_UNKNOWN))
    return check_methods(name, time)


TRIAL = Trial(
    "near-symmetry",
    "two moments, or all, that differ by 1e-1 to 1e-16 of their size, and equal ones",
    "as of the separatrix. The difference of two moments is exact, and so is no loss of digits.",
    lambda only: check_all("near-symmetry", _checks_at, lambda each: each.time != LONG),
)
