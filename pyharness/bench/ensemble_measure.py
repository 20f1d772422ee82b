"""Measurements of many bodies: speed at a target error, time by number of bodies, memory.

Each contender uses the coarsest setting that reaches the target error on a sample of bodies. Calls
are interleaved in rounds; the shortest time counts. Calls on one core are timed in processor time.
"""

import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
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
    draw,
    own_ensembles,
)
from pyharness.bench.loop import Call, Say, timed
from pyharness.checks.compare.timing import Clock, batch_seconds, seconds, silenced
from pyharness.engine.plan.plan import FINEST
from pyharness.engine.prepared.solver import prepare
from pyharness.model.attitude import angle_between
from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, no_progress
from pyharness.model.trajectory import Array

TARGETS = (1e-6, 1e-12)
STEPS = 300  # number of RK4 steps, where the rate is in steps per second
ROUNDS = 9
# Durations (s). The number of bodies is increased after a call shorter than `_CALL`, or shorter
# than `_LONG_CALL` if the last increase raised the bodies per second by more than half.
_CALL, _LONG_CALL = 0.03, 0.5
SLOW = 0.3  # s; slower calls are timed in fewer rounds
_BATCH = 0.02  # s; duration of the calls in a round
_MOST_STEPS = 1 << 14
# Tolerance of each method, or number of steps of RK4.
SETTINGS = {"closed-form": 1e-12, "taylor": 1e-12, "rk4": float(STEPS)}
_GROWTH_ROUNDS = 5


@dataclass(frozen=True)
class Rate:
    """The speed of a contender on a load."""

    load: str
    target: float | None  # target error; None if the number of steps was prescribed
    method: str
    threads: int
    setting: float | None  # tolerance or number of steps; None for a closed form
    bodies: int  # number of bodies in a call
    seconds: float  # the shortest time of a call
    error: float  # largest error in the sample: of omega (relative) or of the attitude (rad)
    note: str = ""  # the fastest of several variants

    @property
    def bodies_a_second(self) -> float:
        return self.bodies / self.seconds

    @property
    def rate(self) -> float:
        """The bodies per second or, without a target error, steps of all bodies per second."""
        return self.bodies_a_second * (1 if self.target is not None else STEPS)


@dataclass(frozen=True)
class Rates:
    seed: str
    bodies: int
    rows: list[Rate] = field(default_factory=list)
    # Task, contender and reason, for contenders that were not measured.
    refused: list[tuple[str, str, str]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Task:
    """A load with a target error or, without one, with `STEPS` steps of RK4."""

    load: EnsembleLoad
    target: float | None
    sample: EnsembleLoad
    ends: Array  # true omega, (n, 3), or attitude, (n, 4), of the sample at the end time

    @property
    def place(self) -> str:
        return f"{self.load.name}, {f'{self.target:g}' if self.target else f'{STEPS} steps of RK4'}"

    def takes(self, each: EnsembleContender) -> bool:
        torque = self.load.torque is not None and each.torque_free
        if torque or (self.load.attitude0 is not None and not each.attitude):
            return False
        return self.target is not None or each.setting == "steps"

    def error(self, omega: Array) -> float:
        """Return the largest error of omega (relative) or of the attitude (rad) in the sample."""
        n = min(len(omega), len(self.ends))
        ends, starts = self.ends[:n], self.sample.omega0[:n]
        if self.load.attitude0 is not None:
            angles = angle_between(omega[:n], ends)
            return float(np.where(np.isfinite(angles), angles, np.inf).max())
        sizes = np.maximum(np.abs(ends).max(axis=1), np.abs(starts).max(axis=1))
        errors = np.abs(omega[:n] - ends).max(axis=1) / sizes
        return float(np.where(np.isfinite(errors), errors, np.inf).max())

    def setting(self, each: EnsembleContender) -> float | None:
        """Return the coarsest setting that reaches the target error or, without target, `STEPS`."""
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
    """Return each contender's speed on each load at each target error.

    `seed` is only recorded. A call solves at least `least` bodies, or all if there are fewer.
    """
    found = Rates(seed, loads[0].n)
    tasks: list[_Task] = []
    for load in loads:
        sample = load.part(slice(0, SAMPLE))
        ends = sample.ends()
        # On the last load, RK4 contenders also run `STEPS` steps.
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
        found[place] = max(found.get(place, row), row, key=lambda each: each.rate)
    return found.values()


def _ladder(each: EnsembleContender, target: float) -> Iterator[float]:
    if each.setting == "none":
        yield 1.0
    elif each.setting == "tolerance":
        # Because errors were between 1e-4 and 1e3 times the tolerance.
        for digits in range(-5, 4):
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
    return process_time if threads == 1 else perf_counter


@dataclass(frozen=True)
class Size:
    """The run times per body (s) by method, on one core."""

    bodies: int
    seconds: dict[str, float]


@dataclass(frozen=True)
class Memory:
    method: str
    bodies: int
    arrays: int  # bytes of initial omegas, torques and results
    peak: int | None  # increase of peak memory in bytes, including `arrays`; None if unknown

    @property
    def ratio(self) -> float | None:
        return None if self.peak is None else self.peak / self.arrays


def sizes(seed: str, most: int, progress: Progress = no_progress) -> list[Size]:
    """Return run times for 1, 10, ... up to `most` bodies."""
    free, pushed = draw(seed, most)
    found: list[Size] = []
    n = 1
    while n <= most:
        runs: dict[str, Callable[[], object]] = {"prepared": _prepared(free.part(slice(0, n)))}
        for method in own_ensembles():
            load = (free if method.torque_free else pushed).part(slice(0, n))
            runs[method.name] = method.prepare(load, SETTINGS[method.name], 1)
        progress(len(found), len(str(most)), f"{n} bodies")
        clocks = [clock_of(1)] * len(runs)
        times = seconds(
            [*runs.values()], _BATCH, _GROWTH_ROUNDS, statistic=min, clocks=clocks, slow=SLOW
        )
        found.append(Size(n, {name: time / n for name, time in zip(runs, times, strict=True)}))
        n *= 10
    return found


def _prepared(load: EnsembleLoad) -> Callable[[], object]:
    solver, out = prepare(load.scene, "closed-form"), np.empty_like(load.omega0)
    return lambda: solver.many(load.omega0, load.horizon, out=out)


def memory(bodies: int) -> list[Memory]:
    """Return the memory (bytes) that a call of each of our methods needs."""
    found = []
    # Each method needs a new process, because a process's peak memory never decreases.
    for method in own_ensembles():
        command = f"from pyharness.bench.ensemble_measure import needed; needed({method.name!r}, "
        call = [sys.executable, "-c", f"{command}{bodies})"]
        told = subprocess.run(call, check=True, capture_output=True, text=True)
        arrays, peak = map(int, told.stdout.split())
        found.append(Memory(method.name, bodies, arrays, peak if peak > 0 else None))
    return found


def needed(method: str, bodies: int) -> None:
    """Print the size of a call's arrays and the increase of peak memory, in bytes."""
    own = next(each for each in own_ensembles() if each.name == method)
    load = draw("memory", 512)[0 if own.torque_free else 1]
    own.prepare(load, SETTINGS[method], 1)()
    before = _resident("VmRSS")
    source = np.random.default_rng(1)
    given = [np.empty((bodies, 3)) for _ in range(1 if own.torque_free else 2)]
    for array in given:
        source.random(out=array)
    many = EnsembleLoad("memory", given[0], None if own.torque_free else given[1])
    omega = own.prepare(many, SETTINGS[method], 1)()
    statuses = bodies  # one byte each
    arrays = sum(each.nbytes for each in given) + omega.nbytes + statuses
    print(arrays, _resident("VmHWM") - before)


def _resident(name: str) -> int:
    """Return this process's ``VmRSS`` (memory now) or ``VmHWM`` (peak), in bytes; 0 if unknown."""
    with suppress(OSError), open("/proc/self/status", encoding="ascii") as file:
        for line in file:
            if line.startswith(name + ":"):
                return 1024 * int(line.split()[1])
    return 0
