"""True and reported errors: `python -m tests.campaigns.estimates --scenes 20000 --seed 1`.

Every scene is drawn from the seed and its number. It is solved to its tolerance by every entry
point, and compared with a solution of 30 digits. `--seed 1 --only 123` repeats one scene. The exit
status is 1 in four cases: an error exceeds the tolerance; the status is wrong on whether any digit
is left; a reported error is below a hundredth of the true error; or more than one in a thousand
reported errors are below a tenth of it.
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from tests.campaigns import driver
from tests.campaigns.entries import results
from tests.campaigns.estimates.scenes import Draw, drawn

COMMAND = "python -m tests.campaigns.estimates --seed {seed} --only {number}"
SENSITIVE = "sensitive"
_ROUNDING = 2.0**-53
_ULP = 2.0**-52  # errors up to it are rounding errors of the result
_LOW = 1e-3  # fraction of the estimates that may be below a tenth of the error
_GIVEN = 4e-15  # times K: error allowed for rounding, in addition to the tolerance
_CALM = 1e6  # K above which no error is judged
_KNOWN = 1e13  # K above which a ratio to it is meaningless
_SURELY, _HARDLY = 3.0, 1.0 / 30.0  # limits of rounding times K over the tolerance


@dataclass(frozen=True)
class Answer:
    """The result of an entry point for a scene, and the error it reported; None for no report."""

    draw: Draw
    entry: str
    ended: str
    error: float  # true error of omega over the largest, or angle (rad); infinite without an answer
    estimate: float | None = None
    growth: float | None = None

    @property
    def limit(self) -> float:
        """The largest error allowed."""
        return self.draw.tolerance + _GIVEN * self.draw.truth.growth

    @property
    def is_judged(self) -> bool:
        """Whether the error amplification is small enough to judge the error."""
        return self.draw.truth.growth < _CALM

    @property
    def lost(self) -> float:
        """The rounding error times K, relative to the tolerance."""
        return _ROUNDING * self.draw.truth.growth / self.draw.tolerance

    @property
    def seen(self) -> float | None:
        """The estimate over the true error; None if one of them is meaningless."""
        if self.estimate is None or not self.error < 1.0 or self.error <= _ULP:
            return None
        return self.estimate / self.error

    @property
    def is_low(self) -> bool:
        """Whether the estimate is below a tenth of the error."""
        return self.seen is not None and self.seen < 0.1

    def faults(self) -> list[str]:
        """Return the names of the faults; a few estimates may be low."""
        complete = self.ended == "complete"
        # A closed form loses no digit to rounding: the error decides.
        is_closed = self.draw.scene.torque.is_zero and "taylor" not in self.entry
        is_lost = self.error > self.draw.tolerance if is_closed else self.lost > _SURELY
        # Torques that cancel make a scene sensitive by themselves, which K does not measure. With
        # the attitude the amplification is known up to the angle by which an error of omega may
        # rotate the body.
        angle = 1.0 + math.pi * self.draw.truth.turns * self.draw.attitude
        calm = self.lost * angle < _HARDLY and "cancelling" not in self.draw.kinds
        flags = {
            "exceeds": self.is_judged and complete and not self.error <= self.limit,
            "silent": is_lost and complete and self.lost > _SURELY,
            "false alarm": calm and self.ended == SENSITIVE,
            "blind": self.seen is not None and self.seen < 0.01,
            "unfinished": self.is_judged and self.ended not in ("complete", SENSITIVE),
        }
        return [name for name, flag in flags.items() if flag]


def answers(of: Draw) -> Iterator[Answer]:
    """Yield the answer of every entry point; a refusal is an answer too."""
    for each in results(of.scene, list(of.times), of.tolerance):
        error = math.inf
        if len(each.omega) == (1 if each.last_only else len(of.times)):
            error = of.truth.exact.error(each.omega, each.attitude, each.last_only)
        growth = None if each.estimate is None else each.growth
        yield Answer(of, each.entry, each.ended, error, each.estimate, growth)


def try_scene(tally: driver.Tally, tolerances: tuple[float, ...] = ()) -> None:
    """Judge the answers for one scene."""
    of = drawn(tally.seed, tally.number, tolerances)
    for each in answers(of):
        tally.counts[f"{each.entry}: {each.ended.partition(':')[0]}"] += 1
        tally.counts["estimates"] += each.seen is not None
        tally.counts["estimates below a tenth of the error"] += each.is_low
        for name in each.faults():
            tally.fault(f"{name}, {each}")
        if each.is_judged and each.ended == "complete":
            tally.record(f"{each.entry}: error over its limit", each.error / each.limit)
        if each.entry != "solve taylor":
            continue
        for kind in of.kinds:
            if each.estimate is not None and each.lost < 1.0 and each.error < 1.0:
                ratio = each.estimate / max(each.error, _ROUNDING)
                tally.record(f"estimate over error, {kind}", ratio)
            if each.growth is not None and of.truth.growth < _KNOWN:
                tally.record(f"growth over K, {kind}", each.growth / of.truth.growth)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign, or show one scene."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--scenes", type=int, default=20_000)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--first", type=int, default=0, help="number to begin with")
    parser.add_argument("--only", type=int, help="show this number alone")
    parser.add_argument("--tolerances", type=_tolerances, default=(), metavar="1e-3,...")
    options = parser.parse_args(arguments)
    count, first = options.scenes, options.first
    if options.only is not None:
        count, first = 1, options.only
        print(*answers(drawn(options.seed, first, options.tolerances)), sep="\n")
    judge = partial(try_scene, tolerances=options.tolerances)
    tally = driver.campaign(COMMAND, judge, count, options.seed, first)
    print(tally)
    low = tally.counts["estimates below a tenth of the error"]
    return int(bool(tally.faults) or low > max(1.0, _LOW * tally.counts["estimates"]))


def _tolerances(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split(",")))


if __name__ == "__main__":
    sys.exit(main())
