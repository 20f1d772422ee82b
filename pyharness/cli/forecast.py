"""Limits of the number of random draws, and forecasts of their run time.

Both are applied before the first draw.
"""

from typing import NamedTuple

from pyharness.cli import say
from pyharness.model.errors import InputError

_WORTH_SAYING = 60.0  # s


class Cost(NamedTuple):
    """The cost of one random draw in time and memory, and the largest allowed number of draws.

    The cost was measured on one core of 2026.
    """

    what: str  # plural noun for the draws, as in "random scenes"
    seconds: float  # per draw
    n_bytes: float  # per draw
    most: int  # largest allowed number of draws


# A draw leads to nearly three checks; each check stays in memory until the report.
CHECKS = Cost("random draws", 0.035, 2e3, 1_000_000)
# Every contender runs with every setting on a scene, and so does the reference.
SCENES = Cost("random scenes", 8.0, 1e5, 10_000)


def check_count(option: str, count: int, least: int, cost: Cost) -> None:
    """Raise InputError if a number of random draws is not allowed.

    `option` is the option with the number `count`, and `least` the smallest allowed number. If the
    draws will take more than a minute, print a forecast of time and memory.
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
