"""Runs of a sweep: check of its size, forecast of its time, computation of missing chunks."""

import contextlib
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, progress_of
from pyharness.model.report import format_bytes, format_count, format_duration
from pyharness.sweep.batches import looped_fields, solve_chunk, solve_points
from pyharness.sweep.executors import Engine, engine
from pyharness.sweep.reductions import empty, needs_attitudes
from pyharness.sweep.store import Store, check_store, opened
from pyharness.sweep.store_layout import filled
from pyharness.sweep.sweep import Arrays, Indices, Sweep, points, spread

# Scenes in the samples, evenly spread over the grid; the smallest sample is measured first.
_SAMPLES = (8, 256, 2048, 8192)
_ENOUGH = 0.2  # s; a sample that took longer is usually large enough
# In a small sample, the constant cost of a batch weighs too much. The next larger one is therefore
# measured too if it has at most the fraction `_PART` of all scenes and takes at most `_LONGEST`.
_PART = 0.01
_LONGEST = 60.0  # longest expected time (s) of such a sample
# Fewest values sampled along a dimension whose value all scenes of a batch share.
_PLACES = 5
# Chunks measured whole if they are a small part of the sweep and not slow; factor by which the
# measured parts of a chunk grow.
_CHUNKS = 3
_GROWTH = 16
_FILES = 20  # most chunks solved, or written and read, for a measurement


class Estimate(NamedTuple):
    """The cost of a sweep's missing chunks, as text; `memory` (bytes) is for all workers."""

    text: str
    memory: int


def forecast(sweep: Sweep, path: str, n_missing: int, own: Engine) -> float:
    """Return the time (s) to solve and write missing chunks, and to read all chunks."""
    write, read = seconds_of_files(sweep, path)
    solve = n_missing * seconds_per_chunk(sweep) / own.workers
    # With other executors, other processes solve while this one writes.
    together = solve + n_missing * write if own.is_here else max(solve, n_missing * write)
    return together + sweep.n_chunks * read


def seconds_of_files(sweep: Sweep, path: str) -> tuple[float, float]:
    """Return the mean times (s) to write and to read a chunk's files beside `path`."""
    times = []
    try:
        with filled(sweep, Path(path)) as folder:
            store = Store(sweep, folder)
            for chunk in range(min(_FILES, sweep.n_chunks)):
                part = _pattern(sweep, chunk)
                begin = time.perf_counter()
                store.write(chunk, part)
                middle = time.perf_counter()
                for asked in sweep.reductions:
                    store.read(asked.name, chunk)
                times.append((middle - begin, time.perf_counter() - middle))
                if sum(map(sum, times[1:])) > _ENOUGH:
                    break
    except OSError:
        return 0.0, 0.0
    # Without the first chunk, during which Zarr imports modules.
    write, read = np.mean(times[1:] or times, axis=0)
    return float(write), float(read)


def _pattern(sweep: Sweep, chunk: int) -> Arrays:
    """Return random results of a chunk; equal results would be written too fast."""
    draw = np.random.default_rng(chunk)
    shape = tuple(part.stop - part.start for part in sweep.box(chunk))
    found = {}
    for asked in sweep.reductions:
        values = empty(asked, math.prod(shape))
        values[...] = draw.integers(0, 100, values.shape)
        if values.dtype.kind == "f":
            values *= 0.1
        found[asked.name] = values.reshape(*shape, *values.shape[1:])
    return found


def seconds_per_chunk(sweep: Sweep) -> float:
    """Return the time (s) to solve a chunk in this process; a long time is extrapolated."""
    scenes = math.prod(sweep.chunk_shape)
    seconds = scenes * seconds_per_scene(sweep)
    most, enough = _FILES, _ENOUGH
    if seconds > _ENOUGH:
        chosen = {sweep.n_chunks * k // (2 * _CHUNKS) for k in range(1, 2 * _CHUNKS, 2)}
        by_parts = [_seconds_by_parts(sweep, chunk) for chunk in chosen]
        seconds = min(seconds, sum(by_parts) / len(by_parts))
        most, enough = _CHUNKS, math.inf
        if _PART * sweep.n_chunks < _CHUNKS or _CHUNKS * seconds > _LONGEST:
            return seconds
    # Only whole chunks show the constant cost of a chunk.
    begin = time.perf_counter()
    count = min(most, sweep.n_chunks)
    for i in range(count):
        solve_chunk(sweep, i * (sweep.n_chunks - 1) // max(1, count - 1))
        if time.perf_counter() - begin > enough:
            count = i + 1
            break
    return (time.perf_counter() - begin) / count


def _seconds_by_parts(sweep: Sweep, chunk: int) -> float:
    """Return the time (s) of a chunk, extrapolated from parts of increasing size."""
    where = points(sweep.box(chunk))
    total = len(where[0])

    def took(count: int) -> float:
        places = np.arange(count) * (total - 1) // max(1, count - 1)
        begin = time.perf_counter()
        solve_points(sweep, [each[places] for each in where])
        return time.perf_counter() - begin

    one, each, count = took(1), math.inf, _GROWTH
    while count < total and (each == math.inf or one + count * each < _LONGEST):
        each = max(0.0, took(count) - one) / (count - 1)
        count *= _GROWTH
    return one + total * each


def seconds_per_scene(sweep: Sweep) -> float:
    # Not timed, because this call imports the solver's modules.
    solve_points(sweep, spread(sweep, 1))
    for count, larger in zip(_SAMPLES, (*_SAMPLES[1:], math.inf), strict=True):
        where = places_of_a_chunk(sweep, spread(sweep, count))
        begin = time.perf_counter()
        solve_points(sweep, where)
        took = time.perf_counter() - begin
        seconds = took / len(where[0])
        is_small = larger <= _PART * sweep.n_scenes and larger * seconds <= _LONGEST
        if len(where[0]) < count or (took > _ENOUGH and not is_small):
            break
    return seconds


def places_of_a_chunk(sweep: Sweep, where: list[Indices]) -> list[Indices]:
    """Return sample indices, changed so that batches (calls) are about as large as in a chunk."""
    shared = {axis.dimension for axis in sweep.axes if axis.field in looped_fields(sweep)}
    found, scenes = [], math.prod(sweep.chunk_shape)
    dimensions = sweep.dimensions.items()
    for (name, count), length, places in zip(dimensions, sweep.chunk_shape, where, strict=True):
        # In a chunk, `scenes // length` scenes share an index along this dimension.
        distinct = max(_PLACES, len(places) * length // scenes)
        if name in shared and count > distinct:
            part = np.rint(places * ((distinct - 1) / (count - 1))) / (distinct - 1)
            places = np.rint(part * (count - 1)).astype(np.int64)
        found.append(places)
    return found


# Memory of a process over the size of a chunk: it holds several chunks, and needs more to solve.
_COPIES = 12
_MOST_CHUNKS = 1_000_000


@dataclass(frozen=True)
class Outcome:
    estimate: Estimate | None  # None if no chunk was missing
    before: int  # number of chunks from earlier runs
    computed: int  # number of chunks from this run
    seconds: float  # time of the computation
    repaired: int = 0  # number of chunks that had been damaged


def check_size(sweep: Sweep, path: str, workers: int, missing: int) -> tuple[int, int]:
    """Return the bytes of disk for missing chunks, and of memory for all workers.

    Raise InputError if too little is available.
    """
    disk = os.statvfs(Path(path).absolute().parent)
    scenes = math.prod(sweep.chunk_shape)
    sizes = [scenes * empty(asked, 1).nbytes for asked in sweep.reductions]
    # A chunk has a file for each reduction and one of checksums, in whole blocks of the disk.
    n_bytes = missing * sum(-(-size // disk.f_frsize) for size in (*sizes, 1)) * disk.f_frsize
    shown = _size(sweep)
    free = disk.f_bavail * disk.f_frsize
    if n_bytes > free:
        raise InputError(
            f"{shown} take up to {format_bytes(n_bytes)}, and {format_bytes(free)} are free where "
            f"'{path}' is; use a smaller grid, or fewer reductions"
        )
    n_files = missing * (len(sweep.reductions) + 1)
    # Some file systems have no limit, and report 0.
    if disk.f_files and n_files > disk.f_favail:
        raise InputError(
            f"{shown} take {n_files} files, and {disk.f_favail} more can be made where '{path}' "
            "is; give a larger chunk, or fewer reductions"
        )
    if sweep.n_chunks > _MOST_CHUNKS:
        raise InputError(
            f"{shown}; allowed: {_MOST_CHUNKS} chunks, because each is a file; give a larger "
            "chunk, or put axes of names first"
        )
    coordinates = 8 * sum(axis.count for axis in sweep.axes)
    samples = sum(int(dict(asked.parameters).get("samples", 1)) for asked in sweep.reductions)
    state = 8 * (7 if needs_attitudes(sweep.reductions) else 3)
    results = sum(empty(asked, 1).nbytes for asked in sweep.reductions)
    # The results of each sample have their final times, too.
    each = _COPIES * (results + 8 * len(sweep.axes)) + (3 * state + 8) * samples
    needed = workers * (coordinates + scenes * each)
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if needed > memory // 2:
        raise InputError(
            f"{shown} take {format_bytes(needed)} of memory at once, and at most half of this "
            f"machine's memory, {format_bytes(memory // 2)}, is used; use smaller chunks, "
            "fewer workers or samples"
        )
    return n_bytes, needed


def _size(sweep: Sweep) -> str:
    return f"{format_count(sweep.n_scenes)} scenes in {format_count(sweep.n_chunks)} chunks"


@contextlib.contextmanager
def swept(
    sweep: Sweep,
    path: str,
    executor: str = "here",
    workers: int | None = None,
    address: str | None = None,
    before: Callable[[Estimate], None] = lambda estimate: None,  # receives the forecast
    progress: bool | Progress = False,  # True for a bar, or a function called after each chunk
    repair: bool = False,  # whether to make damaged chunks and metadata again
) -> Iterator[tuple[Store, Outcome]]:
    """Compute the chunks that a sweep's store lacks; yield the open store and the outcome.

    The folder `path` is locked until the context ends.
    """
    is_there = check_store(sweep, path)
    check_size(sweep, path, workers or 1, 0 if is_there else sweep.n_chunks)
    with contextlib.ExitStack() as stack:
        try:
            # Started first: if a scheduler does not answer, no file is written.
            with engine(executor, workers, address) as own:
                store = stack.enter_context(opened(sweep, path, repair))
                with progress_of(progress, "chunks") as report:
                    outcome = _completed(store, own, before, report)
        except OSError as error:
            raise InputError(
                f"--out '{path}': {error.strerror or error}; finished chunks are kept, and "
                "the same command computes the others"
            ) from None
        yield store, outcome


def _completed(
    store: Store, own: Engine, before: Callable[[Estimate], None], progress: Progress
) -> Outcome:
    sweep = store.sweep
    missing = [chunk for chunk, done in enumerate(store.done()) if not done]
    n_before = sweep.n_chunks - len(missing)
    if not missing:
        return Outcome(None, n_before, 0, 0.0)
    n_bytes, memory = check_size(sweep, str(store.folder), own.workers, len(missing))
    seconds = forecast(sweep, str(store.folder), len(missing), own)
    rest = f", {format_count(len(missing))} of them missing" if n_before else ""
    text = (
        f"{_size(sweep)}{rest}: about {format_duration(seconds)}, up to {format_bytes(n_bytes)} on "
        f"disk, {format_bytes(memory)} of memory"
    )
    before(estimate := Estimate(text, memory))
    begin = time.monotonic()
    # Closing the generator ends processes and connections now, and not at garbage collection.
    with contextlib.closing(own.computed(sweep, missing)) as results:
        for n, (chunk, found) in enumerate(results, 1):
            store.write(chunk, found)
            progress(n, len(missing), "chunks")
    return Outcome(estimate, n_before, len(missing), time.monotonic() - begin, store.repaired)
