"""Run a sweep: estimate, refuse, compute what is missing, keep it."""

import math
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pyharness.ensembles.executors import Engine, engine
from pyharness.ensembles.loads import looped_fields
from pyharness.ensembles.reductions import empty
from pyharness.ensembles.store import Store, check_store, opened
from pyharness.ensembles.sweep import Indices, Sweep, solve_points, spread
from pyharness.model.errors import InputError

# Of a sample: scenes from all over the grid, first a few.
_SAMPLES = (8, 256, 2048, 8192)
_ENOUGH = 0.2  # s
# A larger sample is taken beyond that where it is a small part of the sweep, and takes at most so
# long: what a load takes whatever its size would else count as its scenes'.
_PART = 0.01
_LONGEST = 60.0  # s
_PLACES = 5  # of the sample, along what scenes of one load share
_PACE = 3e8  # bytes that are compressed and written in a second
# Chunks that a process holds at once, with what it takes to compute them.
_COPIES = 12
_MOST_CHUNKS = 1_000_000


@dataclass(frozen=True)
class Estimate:
    """What a sweep is going to take: bytes before compression, seconds of what is missing."""

    n_scenes: int
    n_chunks: int
    n_missing: int
    n_bytes: int
    memory: int
    seconds: float


@dataclass(frozen=True)
class Outcome:
    """What a call did: chunks that were there before, chunks computed, and how long it took."""

    estimate: Estimate | None
    before: int
    computed: int
    seconds: float


def bytes_per_scene(sweep: Sweep) -> int:
    """Return what a scene takes in the store, before compression."""
    return sum(empty(asked, 1).nbytes for asked in sweep.reductions)


def check_size(sweep: Sweep, path: str, workers: int, missing: int) -> tuple[int, int]:
    """Return the bytes on disk of `missing` chunks, and in memory.

    InputError where either can't hold them. Nothing is allocated for it: a grid of any size is
    refused at once.
    """
    n_bytes = sweep.n_scenes * bytes_per_scene(sweep) * missing // sweep.n_chunks
    shown = f"{_count(sweep.n_scenes)} scenes in {_count(sweep.n_chunks)} chunks"
    free = shutil.disk_usage(Path(path).absolute().parent).free
    if n_bytes > free:
        raise InputError(
            f"{shown} take up to {_bytes(n_bytes)}, and where '{path}' goes {_bytes(free)} are "
            "free; take a smaller grid, or fewer reductions"
        )
    if sweep.n_chunks > _MOST_CHUNKS:
        raise InputError(
            f"{shown}; allowed: {_MOST_CHUNKS} chunks, a file each; give larger ones by chunk, or "
            "put axes of names first"
        )
    coordinates = 8 * sum(axis.count for axis in sweep.axes)
    needed = workers * (coordinates + math.prod(sweep.chunk_shape) * _scene_memory(sweep))
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if needed > memory // 2:
        raise InputError(
            f"{shown} take {_bytes(needed)} of memory at once, and the half of it that is theirs "
            f"is {_bytes(memory // 2)}; take smaller chunks, fewer workers or samples"
        )
    return n_bytes, needed


def _scene_memory(sweep: Sweep) -> int:
    samples = sum(int(dict(asked.parameters).get("samples", 1)) for asked in sweep.reductions)
    return _COPIES * (bytes_per_scene(sweep) + 8 * len(sweep.axes)) + 24 * 3 * samples


def seconds_per_scene(sweep: Sweep) -> float:
    """Return the time of a scene, by a sample from all over the grid; of this process alone."""
    seconds = math.nan
    for count, larger in zip(_SAMPLES, (*_SAMPLES[1:], math.inf), strict=True):
        where = _together(sweep, spread(sweep, count))
        begin = time.perf_counter()
        solve_points(sweep, where)
        took = time.perf_counter() - begin
        seconds = took / len(where[0])
        is_small = larger <= _PART * sweep.n_scenes and larger * seconds <= _LONGEST
        if len(where[0]) < count or (took > _ENOUGH and not is_small):
            break
    return seconds


def _together(sweep: Sweep, where: list[Indices]) -> list[Indices]:
    """Move a sample to a few of the places that scenes of one load share, as a chunk has many."""
    shared = {axis.dimension for axis in sweep.axes if axis.field in looped_fields(sweep)}
    found = []
    for (name, count), places in zip(sweep.dimensions.items(), where, strict=True):
        if name in shared and count > _PLACES:
            part = np.rint(places * ((_PLACES - 1) / (count - 1))) / (_PLACES - 1)
            places = np.rint(part * (count - 1)).astype(np.int64)
        found.append(places)
    return found


def run_sweep(
    sweep: Sweep,
    path: str,
    executor: str = "here",
    workers: int | None = None,
    address: str | None = None,
    before: Callable[[Estimate], None] = lambda estimate: None,
    progress: Callable[[str], None] = lambda text: None,
) -> Outcome:
    """Compute what a store lacks of a sweep.

    Parameters
    ----------
    sweep : Sweep
        What to compute.
    path : str
        Of the store, a folder, which is made if it is missing.
    executor : {"here", "processes", "dask"}
        Who computes: this process, others on this machine, or a cluster.
    workers : int, optional
        How many processes; by default as many as there are processors.
    address : str, optional
        Of a scheduler, for `dask`.
    before : callable
        Is told the estimate, before anything is computed.
    progress : callable
        Is told how far it is.

    Raises
    ------
    InputError
        For a store of another sweep, a size that disk or memory can't hold, a disk that is full, a
        cluster that does not answer. What was computed stays, and the next call goes on from it.
    """
    is_there = check_store(sweep, path)
    check_size(sweep, path, workers or 1, 0 if is_there else sweep.n_chunks)
    try:
        # Whoever does not answer is found out before anything is made.
        with engine(executor, workers, address) as own, opened(sweep, path) as store:
            return _filled(store, own, before, progress)
    except OSError as error:
        raise InputError(
            f"--out '{path}': {error.strerror or error}; what is done stays, and the same command "
            "goes on from there"
        ) from None


def _filled(
    store: Store,
    own: Engine,
    before: Callable[[Estimate], None],
    progress: Callable[[str], None],
) -> Outcome:
    sweep = store.sweep
    missing = [chunk for chunk, done in enumerate(store.done()) if not done]
    n_before = sweep.n_chunks - len(missing)
    if not missing:
        return Outcome(None, n_before, 0, 0.0)
    size = check_size(sweep, str(store.folder), own.workers, len(missing))
    share = len(missing) / sweep.n_chunks
    seconds = seconds_per_scene(sweep) * sweep.n_scenes * share / own.workers + size[0] / _PACE
    estimate = Estimate(sweep.n_scenes, sweep.n_chunks, len(missing), *size, seconds)
    before(estimate)
    begin = time.monotonic()
    results = own.computed(sweep, missing)
    try:
        for n, (chunk, found) in enumerate(results, 1):
            store.write(chunk, found)
            spent = time.monotonic() - begin
            rest = spent / n * (len(missing) - n)
            progress(f"chunk {n_before + n} of {sweep.n_chunks}, {duration(rest)} left")
    finally:
        # Processes and connections end here, not when the garbage is collected.
        close = getattr(results, "close", None)
        if close is not None:
            close()
    return Outcome(estimate, n_before, len(missing), time.monotonic() - begin)


def said(estimate: Estimate) -> str:
    """Say an estimate in a line."""
    missing = estimate.n_missing
    rest = "" if missing == estimate.n_chunks else f", {_count(missing)} of them missing"
    return (
        f"{_count(estimate.n_scenes)} scenes in {_count(estimate.n_chunks)} chunks{rest}: about "
        f"{duration(estimate.seconds)}, up to {_bytes(estimate.n_bytes)} on disk, "
        f"{_bytes(estimate.memory)} of memory"
    )


def duration(seconds: float) -> str:
    """Say a time as people do."""
    for limit, unit, name in ((120.0, 1.0, "s"), (7200.0, 60.0, "min"), (172800.0, 3600.0, "h")):
        if seconds < limit:
            return (
                f"{seconds / unit:.2g} {name}"
                if seconds < 100.0
                else f"{seconds / unit:.0f} {name}"
            )
    return f"{seconds / 86400.0:.0f} days"


def _count(number: int) -> str:
    return str(number) if number < 10**7 else f"{float(number):.4g}"


def _bytes(number: float) -> str:
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if number < 1000.0:
            return f"{number:.3g} {unit}"
        number /= 1000.0
    return f"{float(number):.3g} PB"
