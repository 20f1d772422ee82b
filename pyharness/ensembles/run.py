"""Run a sweep: estimate, refuse, compute what is missing, keep it."""

import contextlib
import math
import os
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pyharness.ensembles.executors import Engine, engine
from pyharness.ensembles.forecast import Estimate, byte_count, duration, forecast, short_count
from pyharness.ensembles.reductions import empty
from pyharness.ensembles.store import Store, check_store, opened
from pyharness.ensembles.sweep import Sweep
from pyharness.model.errors import InputError

# Chunks that a process holds at once, with what it takes to compute them.
_COPIES = 12
_MOST_CHUNKS = 1_000_000


@dataclass(frozen=True)
class Outcome:
    """What a call did.

    `before` counts the chunks that were there, `computed` those that were computed in `seconds`,
    and `repaired` those among them that were damaged.
    """

    estimate: Estimate | None
    before: int
    computed: int
    seconds: float
    repaired: int = 0


def bytes_per_scene(sweep: Sweep) -> int:
    """Return what a scene takes in the store, before compression."""
    return sum(empty(asked, 1).nbytes for asked in sweep.reductions)


def check_size(sweep: Sweep, path: str, workers: int, missing: int) -> tuple[int, int]:
    """Return the bytes on disk of `missing` chunks, and in memory.

    InputError where either can't hold them. Nothing is allocated for it: a grid of any size is
    refused at once.
    """
    n_bytes = sweep.n_scenes * bytes_per_scene(sweep) * missing // sweep.n_chunks
    shown = f"{short_count(sweep.n_scenes)} scenes in {short_count(sweep.n_chunks)} chunks"
    free = shutil.disk_usage(Path(path).absolute().parent).free
    if n_bytes > free:
        raise InputError(
            f"{shown} take up to {byte_count(n_bytes)}, and where '{path}' goes {byte_count(free)} "
            "are free; take a smaller grid, or fewer reductions"
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
            f"{shown} take {byte_count(needed)} of memory at once, and the half of it that is "
            f"theirs is {byte_count(memory // 2)}; take smaller chunks, fewer workers or samples"
        )
    return n_bytes, needed


def _scene_memory(sweep: Sweep) -> int:
    samples = sum(int(dict(asked.parameters).get("samples", 1)) for asked in sweep.reductions)
    return _COPIES * (bytes_per_scene(sweep) + 8 * len(sweep.axes)) + 24 * 3 * samples


@contextlib.contextmanager
def swept(
    sweep: Sweep,
    path: str,
    executor: str = "here",
    workers: int | None = None,
    address: str | None = None,
    before: Callable[[Estimate], None] = lambda estimate: None,
    progress: Callable[[str], None] = lambda text: None,
    repair: bool = False,
) -> Iterator[tuple[Store, Outcome]]:
    """Compute what a store lacks of a sweep, and yield the store, open, and what was done.

    The parameters and errors are those of `run_sweep`.
    """
    is_there = check_store(sweep, path)
    check_size(sweep, path, workers or 1, 0 if is_there else sweep.n_chunks)
    with contextlib.ExitStack() as stack:
        try:
            # Whoever does not answer is found out before anything is made.
            with engine(executor, workers, address) as own:
                store = stack.enter_context(opened(sweep, path, repair))
                outcome = _completed(store, own, before, progress)
        except OSError as error:
            raise InputError(
                f"--out '{path}': {error.strerror or error}; what is done stays, and the same "
                "command goes on from there"
            ) from None
        yield store, outcome


def run_sweep(
    sweep: Sweep,
    path: str,
    executor: str = "here",
    workers: int | None = None,
    address: str | None = None,
    before: Callable[[Estimate], None] = lambda estimate: None,
    progress: Callable[[str], None] = lambda text: None,
    repair: bool = False,
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
    repair : bool
        Compute damaged chunks again, and write damaged metadata again, instead of an error.

    Raises
    ------
    InputError
        For a store of another sweep, a damaged store, a size that disk or memory can't hold, a disk
        that is full, a cluster that does not answer. What was computed stays, and the next call
        goes on from it.
    """
    with swept(sweep, path, executor, workers, address, before, progress, repair) as (_, outcome):
        return outcome


def _completed(
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
    seconds = forecast(sweep, str(store.folder), len(missing), own)
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
    return Outcome(estimate, n_before, len(missing), time.monotonic() - begin, store.repaired)
