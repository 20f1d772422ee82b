"""Limits on the number of random draws, and forecasts of their run time."""

from typing import NamedTuple

from pyharness.cli import say
from pyharness.model.errors import InputError
from pyharness.model.report import format_duration

_WORTH_SAYING = 60.0  # run time (s) above which a forecast is printed


class Cost(NamedTuple):
    """The time and memory of a draw, on one core of 2026, and the limit on draws."""

    what: str  # plural noun for the draws, as in "random scenes"
    seconds: float  # per draw
    n_bytes: float  # per draw
    most: int  # largest allowed number of draws


# A draw of `verify` makes nearly three checks, which stay in memory until the report.
CHECKS = Cost("random draws", 0.035, 2e3, 1_000_000)
# On each random scene of `bench`, the reference is computed, and every solver runs with all its
# settings.
SCENES = Cost("random scenes", 8.0, 1e5, 10_000)


def check_count(option: str, count: int, least: int, cost: Cost) -> None:
    """Raise InputError for a number of draws that is not allowed.

    Print a forecast if they take more than a minute.
    """
    if not least <= count <= cost.most:
        shown = str(count) if abs(count) < 10**18 else "a number of more than 18 digits"
        longest = format_duration(cost.most * cost.seconds)
        raise InputError(
            f"{option}: {shown}; allowed: a whole number from {least} to {cost.most}, which takes "
            f"about {longest}"
        )
    seconds = count * cost.seconds
    if seconds > _WORTH_SAYING:
        memory = max(1.0, count * cost.n_bytes / 1e6)
        say(
            f"pyharness: {count} {cost.what} take about {format_duration(seconds)} and "
            f"{memory:.0f} MB of memory\n"
        )
