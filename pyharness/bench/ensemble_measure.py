"""Measurement of ensembles: bodies per second at a target error, and RK4 steps per second.

Each contender uses the coarsest setting whose error on a sample is at most the target. Calls are
interleaved in several rounds. The shortest time counts, because other load can only lengthen it.
Calls on one core are timed in processor time.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from time import perf_counter, process_time

import numpy as np

from pyharness.bench.ensemble_contenders import (
    SAMPLE,
    EnsembleContender,
    EnsembleLoad,
    EnsembleMaker,
)
from pyharness.bench.loop import Call, Say, timed
from pyharness.checks.compare.timing import Clock, batch_seconds, silenced
from pyharness.engine.plan import FINEST
from pyharness.model.attitude import angle_between
from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, no_progress
from pyharness.model.trajectory import Array

TARGETS = (1e-6, 1e-12)
STEPS = 300  # number of steps of RK4, where the rate is in steps per second
ROUNDS = 9
# Durations of a call (s). The number of bodies is increased if a call is shorter than the first. It
# is also increased if a call is shorter than the second and the last increase has raised the bodies
# per second by more than half.
_CALL, _LONG_CALL = 0.03, 0.5
SLOW = 0.3  # s; calls slower than this are timed in fewer rounds
_BATCH = 0.02  # s; duration of the calls in a round
_MOST_STEPS = 1 << 14


@dataclass(frozen=True)
class Rate:
    """The speed of one contender, with a number of threads, on one task."""

    load: str
    target: float | None  # requested error; None where the steps were prescribed
    method: str
    threads: int
    setting: float | None  # tolerance or number of steps; None for a closed form
    bodies: int  # number of bodies in a call
    seconds: float  # the shortest time of a call
    error: float  # largest relative error of omega in the sample
    note: str = ""  # the fastest variant of a solver that has several

    @property
    def bodies_a_second(self) -> float:
        """Return the number of bodies integrated per second."""
        return self.bodies / self.seconds

    @property
    def rate(self) -> float:
        """Return bodies per second or, for prescribed steps, steps of all bodies per second."""
        return self.bodies_a_second * (1 if self.target is not None else STEPS)


@dataclass(frozen=True)
class Rates:
    """All measured speeds, and the reasons for missing measurements."""

    seed: str
    bodies: int
    rows: list[Rate] = field(default_factory=list)
    # Tuples (task, contender, reason) for contenders that could not be measured.
    refused: list[tuple[str, str, str]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Task:
    """A load with a target error or, without one, with `STEPS` steps of RK4."""

    load: EnsembleLoad
    target: float | None
    sample: EnsembleLoad
    ends: Array  # omega of the sample at the horizon, (n, 3), or the attitude, (n, 4)

    @property
    def place(self) -> str:
        """Return the name of the task for messages, such as ``no torque, 1e-06``."""
        return f"{self.load.name}, {f'{self.target:g}' if self.target else f'{STEPS} steps of RK4'}"

    def takes(self, each: EnsembleContender) -> bool:
        """Return whether a contender accepts the task's torques, attitudes and prescribed steps."""
        torque = self.load.torque is not None and each.torque_free
        if torque or (self.load.attitude0 is not None and not each.attitude):
            return False
        return self.target is not None or each.setting == "steps"

    def error(self, omega: Array) -> float:
        """Return the largest error of omega, relative to each body's largest omega at start or end.

        For attitudes it is an angle (rad). It is infinite if a component is not finite.
        """
        n = min(len(omega), len(self.ends))
        ends, starts = self.ends[:n], self.sample.omega0[:n]
        if self.load.attitude0 is not None:
            angles = angle_between(omega[:n], ends)
            return float(np.where(np.isfinite(angles), angles, np.inf).max())
        sizes = np.maximum(np.abs(ends).max(axis=1), np.abs(starts).max(axis=1))
        errors = np.abs(omega[:n] - ends).max(axis=1) / sizes
        return float(np.where(np.isfinite(errors), errors, np.inf).max())

    def setting(self, each: EnsembleContender) -> float | None:
        """Return the coarsest setting that reaches the target or None; `STEPS` without target."""
        if self.target is None:
            return float(STEPS)
        for setting in _ladder(each, self.target):
            try:
                omega = each.prepare(self.sample, setting, each.threads[0])()
            except (InputError, RuntimeError, ValueError):
                continue
            if self.error(omega) <= self.target:
                return setting
        return None


def measure_ensembles(
    loads: Sequence[EnsembleLoad],
    contenders: Sequence[EnsembleContender],
    seed: str,
    progress: Progress = no_progress,
    least: int = 64,
) -> Rates:
    """Measure the speed of all contenders on all loads, at all target errors.

    On the last load, RK4 contenders also run `STEPS` steps. `seed` is only recorded. A call solves
    at least `least` bodies, or all if the load has fewer.
    """
    found = Rates(seed, loads[0].n)
    tasks: list[_Task] = []
    for load in loads:
        sample = load.part(slice(0, SAMPLE))
        ends = sample.ends()
        targets = (*TARGETS, None) if load is loads[-1] else TARGETS
        tasks += [_Task(load, target, sample, ends) for target in targets]

    def calls(task: _Task, say: Say) -> Iterator[Call[Rate]]:
        for each in filter(task.takes, contenders):
            say(each.name)
            with silenced():
                setting = task.setting(each)
                if setting is None:
                    found.refused.append((task.place, each.name, "no setting reaches it"))
                    continue
                shown = None if each.setting == "none" else setting
                for threads, (note, prepare) in product(each.threads, each.ways.items()):
                    load, run = _enough(prepare, task.load, setting, threads, least)
                    row = partial(
                        Rate, load.name, task.target, each.name, threads, shown, load.n,
                        error=task.error(run()), note=note,
                    )  # fmt: skip
                    yield Call(run, clock_of(threads), row)

    found.rows.extend(_fastest(timed(tasks, calls, progress, _BATCH, ROUNDS, min, SLOW)))
    return found


def _fastest(rows: Iterable[Rate]) -> Iterable[Rate]:
    found: dict[tuple[object, ...], Rate] = {}
    for row in rows:
        place = (row.load, row.target, row.method, row.threads)
        if place not in found or row.rate > found[place].rate:
            found[place] = row
    return found.values()


def _ladder(each: EnsembleContender, target: float) -> Iterator[float]:
    if each.setting == "none":
        yield 1.0
    elif each.setting == "tolerance":
        # No contender has an error below a hundredth of its tolerance, or above a thousand times
        # its tolerance.
        for digits in range(-2, 4):
            if target * 10.0**-digits >= FINEST:
                yield float(f"{target * 10.0**-digits:.0e}")
    else:
        steps = 8.0
        while steps <= _MOST_STEPS:
            yield float(round(steps))
            steps *= 2.0**0.25


def _enough(
    prepare: EnsembleMaker, load: EnsembleLoad, setting: float, threads: int, least: int
) -> tuple[EnsembleLoad, Callable[[], Array]]:
    """Return a load of at least `least` or all bodies, long enough to time, and its solver."""
    n, before = min(load.n, least), 0.0
    while True:
        part = load.part(slice(0, n))
        run = prepare(part, setting, threads)
        run()  # the first call may compile
        taken = batch_seconds(run, clock=clock_of(threads))
        if n == load.n or taken > (_LONG_CALL if n / taken > 1.5 * before else _CALL):
            return part, run
        n, before = min(load.n, 8 * n), n / taken


def clock_of(threads: int) -> Clock:
    """Return the clock: processor time for one thread, else wall time."""
    return process_time if threads == 1 else perf_counter
