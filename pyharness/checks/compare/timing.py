"""Timing of calls in interleaved batches."""

import contextlib
import gc
import signal
import statistics
import warnings
from collections.abc import Callable, Iterator, Sequence
from itertools import repeat
from time import perf_counter

import numpy as np

SLOW = 20e-3  # s; slower calls are timed in fewer rounds
Run = Callable[[], object]
Clock = Callable[[], float]


def seconds(
    runs: Sequence[Run],
    length: float,  # duration of one function's calls in a round (s)
    rounds: int,
    say: Callable[[str], None] = lambda _: None,
    statistic: Callable[[Sequence[float]], float] = statistics.median,
    clocks: Sequence[Clock] | None = None,
    slow: float = SLOW,  # first calls of at least this duration (s) reduce the rounds
) -> list[float]:
    """Return the time (s) of one call of each function, as a `statistic` over `rounds`."""
    clocks = [perf_counter] * len(runs) if clocks is None else clocks
    timed = list(zip(runs, clocks, strict=True))
    enabled = gc.isenabled()
    gc.disable()
    try:
        with silenced():
            seen = [[batch_seconds(run, 1, clock)] for run, clock in timed]
            due = [rounds if first < slow else 3 if first < 5 * slow else 1 for (first,) in seen]
            for number in range(1, rounds + 1):
                say(f"round {number} of {rounds}")
                for (run, clock), times, most in zip(timed, seen, due, strict=True):
                    if number <= most:
                        # Use the last time, as the first call may have been slow.
                        calls = max(1, round(length / max(times[-1], 1e-9)))
                        times.append(batch_seconds(run, calls, clock))
    finally:
        if enabled:
            gc.enable()
    return [statistic(times[1:]) for times in seen]


def batch_seconds(run: Run, calls: int = 1, clock: Clock = perf_counter) -> float:
    """Return the mean time of `calls` calls (s), after a warm-up if there are several."""
    if calls > 1:
        run()
    begin = clock()
    for _ in repeat(None, calls):
        run()
    return (clock() - begin) / calls


@contextlib.contextmanager
def ended_after(limit: float) -> Iterator[None]:
    """Raise RuntimeError if a ``with`` block takes longer than `limit` (s).

    Only Python code in the main thread is interrupted.
    """

    def end(*_: object) -> None:
        raise RuntimeError(f"ended after {limit:g} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@contextlib.contextmanager
def silenced() -> Iterator[None]:
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
