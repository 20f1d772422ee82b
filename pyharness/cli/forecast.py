"""Limits of the number of random draws that a user may request, and forecasts of their run time.

The number is checked, and a forecast is printed, before the first draw.
"""

from typing import NamedTuple

from pyharness.cli import say
from pyharness.model.errors import InputError

_WORTH_SAYING = 60.0  # run time (s) above which a forecast is printed


class Cost(NamedTuple):
    """The time and memory for one random draw, and the largest allowed number of draws.

    A draw is, for example, a random scene. Time and memory were measured on one core of a processor
    of 2026.
    """

    what: str  # plural noun for the draws, as in "random scenes"
    seconds: float  # per draw
    n_bytes: float  # per draw
    most: int  # largest allowed number of draws


# Each draw of `verify` leads to nearly three checks, which stay in memory until the report.
CHECKS = Cost("random draws", 0.035, 2e3, 1_000_000)
# On each random scene of `bench`, every solver runs with each of its settings, and the reference
# solution is computed.
SCENES = Cost("random scenes", 8.0, 1e5, 10_000)


def check_count(option: str, count: int, least: int, cost: Cost) -> None:
    """Raise InputError if a number of random draws is not allowed.

    `option` is the name of the option that gave the number `count`. `least` is the smallest allowed
    number, and `cost` has the largest. If the draws will take more than a minute, print a forecast
    of their time and memory.
    """
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
