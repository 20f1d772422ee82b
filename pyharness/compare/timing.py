"""Timing: calls in interleaved batches, so that what else the machine does hits all alike."""

import gc
import statistics
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import repeat
from time import perf_counter

import numpy as np

from pyharness.compare.candidates import End, Ready

ROUNDS = 9
_BATCH = 1e-3  # s; calls faster than this are batched
_SLOW = 20e-3  # s; calls slower than this are timed in fewer rounds


@dataclass
class Entry:
    """A call that will be timed."""

    ready: Ready
    first: float
    end: End
    error: float | None
    setting: float
    seconds: float | None = None


def time_calls(entries: Sequence[Entry], say: Callable[[str], None]) -> None:
    """Time the calls that succeed, in rounds."""
    running = [entry for entry in entries if entry.error is not None]
    times: list[list[float]] = [[] for _ in running]
    calls = [max(1, round(_BATCH / max(entry.first, 1e-8))) for entry in running]
    enabled = gc.isenabled()
    gc.disable()
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for number in range(ROUNDS):
                say(f"round {number + 1} of {ROUNDS}")
                for index, entry in enumerate(running):
                    if number < _rounds(entry.first):
                        seconds = batch(entry.ready.run, calls[index])
                        times[index].append(seconds)
                        # A first call may have been a slow one.
                        calls[index] = max(1, round(_BATCH / max(seconds, 1e-9)))
    finally:
        if enabled:
            gc.enable()
    for entry, seen in zip(running, times, strict=True):
        entry.seconds = statistics.median(seen)


def _rounds(first: float) -> int:
    return ROUNDS if first < _SLOW else 3 if first < 5 * _SLOW else 1


def batch(run: Callable[[], object], calls: int) -> float:
    """Return the seconds of a call, averaged over some in a row."""
    if calls > 1:
        run()
    begin = perf_counter()
    for _ in repeat(None, calls):
        run()
    return (perf_counter() - begin) / calls


def seconds(runs: Sequence[Callable[[], object]], length: float, rounds: int) -> list[float]:
    """Return the median seconds of a call of each, in rounds of batches of `length` seconds."""
    calls = [max(1, round(length / max(batch(run, 1), 1e-8))) for run in runs]
    seen = [[batch(run, n) for run, n in zip(runs, calls, strict=True)] for _ in range(rounds)]
    return [statistics.median(each) for each in zip(*seen, strict=True)]
