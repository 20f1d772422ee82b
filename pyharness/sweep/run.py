"""Runs of a sweep: check of its size, forecast, computation of missing chunks."""

import contextlib
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, progress_of
from pyharness.model.report import format_bytes, format_count
from pyharness.sweep.executors import Engine, engine
from pyharness.sweep.forecast import Estimate, forecast
from pyharness.sweep.reductions import empty, needs_attitudes
from pyharness.sweep.store import Store, check_store, opened
from pyharness.sweep.sweep import Sweep

# Ratio of the memory of a process to the size of a chunk: it has several chunks at once, and needs
# more memory to compute them.
_COPIES = 12
_MOST_CHUNKS = 1_000_000


@dataclass(frozen=True)
class Outcome:
    """The chunks that one run of a sweep computed, in `seconds`.

    `estimate` is None if no chunk was missing. `before` counts the chunks of earlier runs,
    `repaired` the computed chunks that had been damaged.
    """

    estimate: Estimate | None
    before: int
    computed: int
    seconds: float
    repaired: int = 0


def check_size(sweep: Sweep, path: str, workers: int, missing: int) -> tuple[int, int]:
    """Return the bytes of the missing chunks on disk, and of all workers in memory.

    Raise InputError if the disk or half of the memory is too small, or for too many chunks.
    """
    disk = os.statvfs(Path(path).absolute().parent)
    scenes = math.prod(sweep.chunk_shape)
    sizes = [scenes * empty(asked, 1).nbytes for asked in sweep.reductions]
    # A chunk has a file for each reduction and one of checksums, in whole blocks of the disk.
    n_bytes = missing * sum(-(-size // disk.f_frsize) for size in (*sizes, 1)) * disk.f_frsize
    shown = f"{format_count(sweep.n_scenes)} scenes in {format_count(sweep.n_chunks)} chunks"
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
    needed = workers * (coordinates + scenes * _scene_memory(sweep))
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if needed > memory // 2:
        raise InputError(
            f"{shown} take {format_bytes(needed)} of memory at once, and at most half of this "
            f"machine's memory, {format_bytes(memory // 2)}, is used; use smaller chunks, "
            "fewer workers or samples"
        )
    return n_bytes, needed


def _scene_memory(sweep: Sweep) -> int:
    samples = sum(int(dict(asked.parameters).get("samples", 1)) for asked in sweep.reductions)
    state = 8 * (7 if needs_attitudes(sweep.reductions) else 3)
    results = sum(empty(asked, 1).nbytes for asked in sweep.reductions)
    return _COPIES * (results + 8 * len(sweep.axes)) + 3 * state * samples


@contextlib.contextmanager
def swept(
    sweep: Sweep,
    path: str,
    executor: str = "here",
    workers: int | None = None,
    address: str | None = None,
    before: Callable[[Estimate], None] = lambda estimate: None,
    progress: bool | Progress = False,
    repair: bool = False,
) -> Iterator[tuple[Store, Outcome]]:
    """Compute the chunks of a sweep that its store lacks; yield the open store and the outcome.

    `path` is the store's folder, made if missing, and locked until the context ends. `executor` is
    "here", "processes" or "dask"; "dask" starts a cluster here unless `address` names a scheduler,
    as in ``tcp://host:8786``. `before` gets the forecast before the computation. `progress` is True
    for a bar, or a function that is called after each chunk with the number of computed chunks, of
    all to compute, and "chunks". With `repair`, damaged chunks and metadata are made again.

    Raise InputError if the store is another sweep's or damaged, no cluster answers, or disk or
    memory is too small; computed chunks remain.
    """
    is_there = check_store(sweep, path)
    check_size(sweep, path, workers or 1, 0 if is_there else sweep.n_chunks)
    with contextlib.ExitStack() as stack:
        try:
            # Started first, so that a scheduler that does not answer is reported before any file is
            # written.
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
    size = check_size(sweep, str(store.folder), own.workers, len(missing))
    seconds = forecast(sweep, str(store.folder), len(missing), own)
    estimate = Estimate(sweep.n_scenes, sweep.n_chunks, len(missing), *size, seconds)
    before(estimate)
    begin = time.monotonic()
    # Closing the generator ends processes and connections now, and not at garbage collection.
    with contextlib.closing(own.computed(sweep, missing)) as results:
        for n, (chunk, found) in enumerate(results, 1):
            store.write(chunk, found)
            progress(n, len(missing), "chunks")
    return Outcome(estimate, n_before, len(missing), time.monotonic() - begin, store.repaired)
