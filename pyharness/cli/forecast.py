"""Limits and forecasts of the run time of random draws, checked before the first draw."""

from typing import NamedTuple

from pyharness.cli import say
from pyharness.model.errors import InputError

_WORTH_SAYING = 60.0  # s


class Cost(NamedTuple):
    """The cost of one draw, measured on one core of 2026, and the largest number of draws."""

    what: str  # name of the drawn things, in the plural
    seconds: float
    n_bytes: float
    most: int


# A draw makes nearly three checks; each stays in memory until the report.
CHECKS = Cost("random draws", 0.035, 2e3, 1_000_000)
# A scene runs every contender with every setting, and the reference.
SCENES = Cost("random scenes", 8.0, 1e5, 10_000)


def check_count(option: str, count: int, least: int, cost: Cost) -> None:
    """Raise InputError if a number of draws is not allowed; print a forecast of a long run."""
    from pyharness.ensembles.forecast import duration

    if not least <= count <= cost.most:
        shown = str(count) if abs(count) < 10**18 else "a number of more than 18 digits"
        longest = duration(cost.most * cost.seconds)
        raise InputError(
            f"{option}: {shown}; allowed: a whole number from {least} to {cost.most}, which takes "
            f"about {longest}"
        )
    seconds = count * cost.seconds
    if seconds > _WORTH_SAYING:
        memory = max(1.0, count * cost.n_bytes / 1e6)
        say(
            f"pyharness: {count} {cost.what} take about {duration(seconds)} and {memory:.0f} MB of "
            "memory\n"
        )
