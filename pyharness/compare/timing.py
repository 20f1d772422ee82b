"""Timing: calls in interleaved batches, so that what else the machine does hits all alike."""

import gc
import statistics
import warnings
from collections.abc import Callable, Sequence
from itertools import repeat
from time import perf_counter

import numpy as np

_SLOW = 20e-3  # s; calls slower than this are timed in fewer rounds


def seconds(
    runs: Sequence[Callable[[], object]],
    length: float,
    rounds: int,
    say: Callable[[str], None] = lambda _: None,
) -> list[float]:
    """Return the median seconds of a call of each, in rounds of batches of `length` seconds."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            seen = [[_batch(run, 1)] for run in runs]
            due = [rounds if first < _SLOW else 3 if first < 5 * _SLOW else 1 for (first,) in seen]
            for number in range(1, rounds + 1):
                say(f"round {number} of {rounds}")
                for run, times, most in zip(runs, seen, due, strict=True):
                    if number <= most:
                        # The last time, for a first call may have been a slow one.
                        times.append(_batch(run, max(1, round(length / max(times[-1], 1e-9)))))
    finally:
        if enabled:
            gc.enable()
    return [statistics.median(times[1:]) for times in seen]


def _batch(run: Callable[[], object], calls: int) -> float:
    """Return the seconds of a call, averaged over some in a row."""
    if calls > 1:
        run()
    begin = perf_counter()
    for _ in repeat(None, calls):
        run()
    return (perf_counter() - begin) / calls
