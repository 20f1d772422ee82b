"""Checks: what was held against what, whether it passed, and the command that replays it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

# How the note of a check begins whose method said that it can't, or that it would take too long.
REFUSED = "refused: "


@dataclass(frozen=True)
class Check:
    """One comparison."""

    # Kind, subject and circumstance, joined by slashes, as in ``cells/two-term/case-3/...``; no
    # two checks of a run have the same.
    id: str
    passed: bool
    value: float | None  # None where there is no one number
    limit: float | None  # of `value`; None where the check is yes or no, or only describes
    replay: str  # the command that makes this check alone
    note: str = ""  # what is wrong, or what was seen, in a few words

    @property
    def kind(self) -> str:
        """The first part of the name."""
        return self.id.partition("/")[0]


@dataclass(frozen=True)
class Sample(Check):
    """A check in a scene drawn at random, with what its limit is made of."""

    entrance: str = ""  # how the scene was solved
    tolerance: float = math.nan  # what was asked for
    growth: float = math.nan  # largest factor by which a small difference reaches the end


def bounded(id: str, value: float, limit: float, replay: str, note: str = "") -> Check:
    """Return the check that `value` does not exceed `limit`; NaN does."""
    # NumPy's numbers come here too, and are no JSON.
    found, allowed = float(value), float(limit)
    return Check(id, not math.isnan(found) and found <= allowed, found, allowed, replay, note)


def described(id: str, value: float | None, replay: str, note: str = "") -> Check:
    """Return a finding without a bound, which can't fail."""
    return Check(id, True, None if value is None else float(value), None, replay, note)


def severity(check: Check) -> tuple[bool, float]:
    """Return what orders checks: those that failed last, then by their share of the limit."""
    if check.value is None or check.limit is None or check.value == check.limit == 0.0:
        return not check.passed, 0.0
    share = abs(check.value) / check.limit if check.limit else math.inf
    # NaN compares with nothing.
    return not check.passed, math.inf if math.isnan(share) else share


def selected(id: str, only: Sequence[str]) -> bool:
    """Whether a check is asked for: all are where nothing is named, else whole leading parts.

    ``cells/two-term`` selects ``cells/two-term/case-3``, not ``cells/two-terms``.
    """
    return not only or any(id == each or id.startswith(each + "/") for each in only)


def may_hold(id: str, only: Sequence[str]) -> bool:
    """Whether checks below or above `id` are asked for: what no one asks for is not computed."""
    return selected(id, only) or any(each.startswith(id + "/") for each in only)
