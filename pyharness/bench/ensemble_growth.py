"""Time per body against the number of bodies in a call, and memory of a call."""

import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pyharness.bench.ensemble_contenders import (
    HORIZON,
    EnsembleContender,
    EnsembleLoad,
    draw,
    own_ensembles,
)
from pyharness.bench.ensemble_measure import SLOW, STEPS, clock_of
from pyharness.checks.compare.timing import seconds
from pyharness.engine.prepared import prepare
from pyharness.model.progress import Progress, no_progress

# Setting of each of our methods: a tolerance, or the number of steps of RK4.
SETTINGS = {"closed-form": 1e-12, "taylor": 1e-12, "rk4": float(STEPS)}
_BATCH, _ROUNDS = 0.02, 5


@dataclass(frozen=True)
class Size:
    """The run times per body of our methods, on one core, in a call for `bodies` bodies."""

    bodies: int
    seconds: dict[str, float]  # s per body, by method


@dataclass(frozen=True)
class Memory:
    """The memory that one call of a method adds to a process."""

    method: str
    bodies: int
    arrays: int  # bytes of the initial omegas, torques and results
    peak: int | None  # bytes, including the arrays; None where the system does not report it

    @property
    def ratio(self) -> float | None:
        """Return the peak divided by the size of the arrays, or None."""
        return None if self.peak is None else self.peak / self.arrays


def sizes(seed: str, most: int, progress: Progress = no_progress) -> list[Size]:
    """Measure the run time per body for 1, 10, 100, ... up to `most` bodies.

    All methods are measured with torque except the closed form, which is measured both by
    `solve_many` and by a prepared solver.
    """
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
        times = seconds([*runs.values()], _BATCH, _ROUNDS, statistic=min, clocks=clocks, slow=SLOW)
        found.append(Size(n, {name: time / n for name, time in zip(runs, times, strict=True)}))
        n *= 10
    return found


def _prepared(load: EnsembleLoad) -> Callable[[], object]:
    solver, out = prepare(load.scene, "closed-form"), np.empty_like(load.omega0)
    return lambda: solver.many(load.omega0, HORIZON, out=out)


def memory(bodies: int, methods: Sequence[EnsembleContender] | None = None) -> list[Memory]:
    """Measure the memory of a call for each of `methods`, by default all our methods.

    Each method runs in a new process, because peak memory never decreases.
    """
    found = []
    for method in own_ensembles() if methods is None else methods:
        command = f"from pyharness.bench.ensemble_growth import needed; needed({method.name!r}, "
        told = subprocess.run(
            [sys.executable, "-c", f"{command}{bodies})"],
            check=True,
            capture_output=True,
            text=True,
        )
        arrays, peak = map(int, told.stdout.split())
        found.append(Memory(method.name, bodies, arrays, peak if peak > 0 else None))
    return found


def needed(method: str, bodies: int) -> None:
    """Print the bytes of a call's arrays, and the bytes by which the call increases peak memory."""
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
    """Return Linux's ``VmRSS`` (present) or ``VmHWM`` (peak) in bytes; 0 elsewhere."""
    try:
        with open("/proc/self/status", encoding="ascii") as file:
            for line in file:
                if line.startswith(name + ":"):
                    return 1024 * int(line.split()[1])
    except OSError:
        pass
    return 0
