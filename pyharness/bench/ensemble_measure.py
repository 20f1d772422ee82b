"""Rates of ensembles: bodies a second at an error, and steps of RK4 a second.

Each contender gets the coarsest setting whose error is at most the target, on a sample, and then
as many bodies as it can do in a part of a second. All are called in turn, in rounds, and the
shortest time of a call counts, as what else the machine does can only lengthen it: on one core in
the processor's time.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter, process_time

import numpy as np

from pyharness.bench.ensemble_contenders import (
    SAMPLE,
    EnsembleContender,
    EnsembleLoad,
    EnsembleMaker,
)
from pyharness.compare.timing import Clock, batch_seconds, seconds, silenced
from pyharness.methods.plan import FINEST
from pyharness.model.errors import InputError
from pyharness.model.trajectory import Array

TARGETS = (1e-6, 1e-12)
STEPS = 300  # of RK4, where steps a second are asked for
ROUNDS = 9
# s; who takes less gets more bodies, and so does who is much faster with more, up to the second.
_CALL, _LONG_CALL = 0.03, 0.5
SLOW = 0.3  # s; calls slower than this are timed in fewer rounds
_BATCH = 0.02  # s; of calls in a round
_MOST_STEPS = 1 << 14
Say = Callable[[str], None]


@dataclass(frozen=True)
class Rate:
    """What a contender did."""

    load: str
    target: float | None  # error asked for; None where the steps were given
    method: str
    threads: int  # 0: as many as its package takes
    setting: float | None
    bodies: int  # of a call
    seconds: float  # the shortest time of a call
    error: float  # largest of the sample

    @property
    def bodies_a_second(self) -> float:
        """Bodies brought to the horizon, 1/s."""
        return self.bodies / self.seconds

    @property
    def rate(self) -> float:
        """Bodies a second, or steps of bodies where the steps were given."""
        return self.bodies_a_second * (1 if self.target is not None else STEPS)


@dataclass(frozen=True)
class Rates:
    """What a run found."""

    seed: str
    bodies: int
    rows: list[Rate] = field(default_factory=list)
    refused: list[tuple[str, str, str]] = field(default_factory=list)  # where, who, why


@dataclass(frozen=True, eq=False)
class _Sample:
    """A load with the ends of its first bodies, which are as random as any."""

    load: EnsembleLoad
    ends: dict[int, Array]

    @property
    def few(self) -> EnsembleLoad:
        """The bodies whose ends are known."""
        return self.load.part(slice(0, SAMPLE))

    def error(self, omega: Array) -> float:
        """Return the largest error, each over the body's largest omega at start and end."""
        worst = 0.0
        for i in range(min(SAMPLE, len(omega))):
            if i not in self.ends:
                self.ends[i] = self.load.part([i]).ends()[0]
            end = self.ends[i]
            size = max(np.abs(end).max(), np.abs(self.load.omega0[i]).max())
            found = float(np.abs(omega[i] - end).max() / size)
            worst = max(worst, found if np.isfinite(found) else np.inf)
        return worst


def measure_ensembles(
    loads: Sequence[EnsembleLoad],
    contenders: Sequence[EnsembleContender],
    seed: str,
    say: Say = lambda _: None,
) -> Rates:
    """Measure all on all loads, to all errors; RK4 on the last load, in `STEPS` steps too."""
    found = Rates(seed, loads[0].n)
    for load in loads:
        sample = _Sample(load, {})
        tasks: list[float | None] = [*TARGETS, *([None] if load is loads[-1] else [])]
        for target in tasks:
            place = load.name + (f", {target:g}" if target else f", {STEPS} steps of RK4")
            found.rows.extend(_rates(sample, target, contenders, found, place, say))
    return found


def _rates(
    sample: _Sample,
    target: float | None,
    contenders: Sequence[EnsembleContender],
    found: Rates,
    place: str,
    say: Say,
) -> Iterator[Rate]:
    ready: list[tuple[Rate, Callable[[], Array]]] = []
    for each in contenders:
        if (each.torque_free and sample.load.torque is not None) or (
            target is None and each.setting != "steps"
        ):
            continue
        say(f"{place}: {each.name}")
        with silenced():
            setting = _setting(each, sample, target)
            if setting is None:
                found.refused.append((place, each.name, "no setting reaches it"))
                continue
            shown = None if each.setting == "none" else setting
            for threads in each.threads:
                load, run = _enough(each.prepare, sample.load, setting, threads)
                rate = Rate(sample.load.name, target, each.name, threads, shown, load.n, 0.0,
                            sample.error(run()))  # fmt: skip
                ready.append((rate, run))
    times = seconds(
        [run for _, run in ready], _BATCH, ROUNDS, lambda text: say(f"{place}: {text}"), min,
        [clock_of(rate.threads) for rate, _ in ready], SLOW,
    )  # fmt: skip
    for (rate, _), best in zip(ready, times, strict=True):
        yield replace(rate, seconds=best)


def _setting(each: EnsembleContender, sample: _Sample, target: float | None) -> float | None:
    """Return the coarsest setting that keeps to an error on the sample; None where none does."""
    if target is None:
        return float(STEPS)
    few = sample.few
    for setting in _ladder(each, target):
        try:
            omega = each.prepare(few, setting, each.threads[0])()
        except (InputError, RuntimeError, ValueError):
            continue
        if sample.error(omega) <= target:
            return setting
    return None


def _ladder(each: EnsembleContender, target: float) -> Iterator[float]:
    if each.setting == "none":
        yield 1.0
    elif each.setting == "tolerance":
        # Nobody's estimate is a hundred times too large, nor a thousand times too small.
        for digits in range(-2, 4):
            if target * 10.0**-digits >= FINEST:
                yield float(f"{target * 10.0**-digits:.0e}")
    else:
        steps = 8.0
        while steps <= _MOST_STEPS:
            yield float(round(steps))
            steps *= 2.0**0.25


def _enough(
    prepare: EnsembleMaker, load: EnsembleLoad, setting: float, threads: int
) -> tuple[EnsembleLoad, Callable[[], Array]]:
    """Return so many bodies that a call is long enough to be timed, all where they are few."""
    n, before = min(load.n, 64), 0.0
    while True:
        part = load.part(slice(0, n))
        run = prepare(part, setting, threads)
        run()  # what is compiled
        taken = batch_seconds(run, clock=clock_of(threads))
        if n == load.n or taken > (_LONG_CALL if n / taken > 1.5 * before else _CALL):
            return part, run
        n, before = min(load.n, 8 * n), n / taken


def clock_of(threads: int) -> Clock:
    """Return what a call is timed by: the processor's time on one core, else that on the wall."""
    return process_time if threads == 1 else perf_counter
