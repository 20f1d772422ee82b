"""Forecast of a sweep's duration, from samples of its scenes and files."""

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pyharness.model.report import format_bytes, format_count, format_duration
from pyharness.sweep.batches import looped_fields, solve_chunk, solve_points
from pyharness.sweep.executors import Engine
from pyharness.sweep.reductions import empty
from pyharness.sweep.store import Store
from pyharness.sweep.store_layout import filled
from pyharness.sweep.sweep import Arrays, Indices, Sweep, spread

# Numbers of scenes in the samples, which are evenly spread over the grid; the smallest is measured
# first.
_SAMPLES = (8, 256, 2048, 8192)
_ENOUGH = 0.2  # time (s) for a sample; if it took longer, it is usually large enough
# A larger sample is nevertheless measured if it is at most the fraction `_PART` of all scenes and
# takes at most `_LONGEST`, because a small sample overestimates the cost of a scene by the constant
# cost of a batch.
_PART = 0.01
_LONGEST = 60.0  # s
# Fewest distinct values in a sample along a dimension in which all scenes of a batch are equal.
_PLACES = 5
_FILES = 20  # most chunks that are solved, or written and read, for a measurement


@dataclass(frozen=True)
class Estimate:
    """The estimated cost of a sweep's missing chunks.

    `n_bytes` is their size before compression; `memory` (bytes) is for all workers together.
    `n_scenes` and `n_chunks` count the whole sweep.
    """

    n_scenes: int
    n_chunks: int
    n_missing: int
    n_bytes: int
    memory: int
    seconds: float


def forecast(sweep: Sweep, path: str, n_missing: int, own: Engine) -> float:
    """Return the seconds to solve and write the missing chunks, and to read all chunks.

    If other processes compute, solving and writing overlap, and only the longer time counts.
    """
    write, read = seconds_of_files(sweep, path)
    solve = n_missing * seconds_per_chunk(sweep) / own.workers
    together = solve + n_missing * write if own.is_here else max(solve, n_missing * write)
    return together + sweep.n_chunks * read


def seconds_of_files(sweep: Sweep, path: str) -> tuple[float, float]:
    """Return the mean seconds to write, and to read, a chunk's files beside `path`.

    Both are 0 if files can't be written; the sweep itself then reports the error.
    """
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
    # The first chunk does not count, because Zarr imports modules meanwhile.
    write, read = np.mean(times[1:] or times, axis=0)
    return float(write), float(read)


def _pattern(sweep: Sweep, chunk: int) -> Arrays:
    """Return random arrays like a chunk's results; equal values would be written too fast."""
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
    """Return the seconds to solve a chunk in this process.

    They are measured on sample scenes or, below 0.2 s, on whole chunks.
    """
    scenes = math.prod(sweep.chunk_shape)
    seconds = scenes * seconds_per_scene(sweep)
    if seconds > _ENOUGH:
        return seconds
    # Only whole chunks show the constant cost, which matters for fast ones.
    begin = time.perf_counter()
    count = min(_FILES, sweep.n_chunks)
    for i in range(count):
        solve_chunk(sweep, i * (sweep.n_chunks - 1) // max(1, count - 1))
        if time.perf_counter() - begin > _ENOUGH:
            count = i + 1
            break
    return (time.perf_counter() - begin) / count


def seconds_per_scene(sweep: Sweep) -> float:
    """Return the mean seconds to solve a scene, from samples spread over the grid."""
    seconds = math.nan
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
    """Return the indices of sampled scenes, changed so that many share a batch.

    Dimensions along which a batch is constant keep five distinct indices, or more if the batches of
    a chunk are small. Thus the batches of the sample are about as large as real ones.
    """
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


def format_estimate(estimate: Estimate) -> str:
    """Return numbers of scenes and chunks, time, disk space and memory as a line of text."""
    missing = estimate.n_missing
    rest = "" if missing == estimate.n_chunks else f", {format_count(missing)} of them missing"
    return (
        f"{format_count(estimate.n_scenes)} scenes in {format_count(estimate.n_chunks)} chunks"
        f"{rest}: about {format_duration(estimate.seconds)}, up to "
        f"{format_bytes(estimate.n_bytes)} on disk, {format_bytes(estimate.memory)} of memory"
    )
