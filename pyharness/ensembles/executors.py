"""Executors: who computes the chunks; all of them compute the same."""

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from typing import Any

from pyharness.ensembles.sweep import Arrays, Sweep, solve_chunk
from pyharness.model.errors import InputError

EXECUTORS = ("here", "processes", "dask")
Results = Iterator[tuple[int, Arrays]]

_ATTEMPTS = 3  # of a chunk whose process dies
_AHEAD = 2  # chunks for each process, so that none waits for the disk
_ANSWER = 5.0  # s, until a scheduler must have answered, and until it must have a worker


def computed(
    executor: str, sweep: Sweep, chunks: list[int], workers: int, address: str | None = None
) -> Results:
    """Yield chunks as they are computed; InputError where nobody is left to compute them."""
    if executor == "processes":
        return _by_processes(sweep, chunks, workers)
    if executor == "dask":
        return _by_dask(sweep, chunks, workers, address)
    return ((chunk, solve_chunk(sweep, chunk)) for chunk in chunks)


def default_workers(executor: str) -> int:
    """Return how many processes an executor has where nothing is said."""
    return 1 if executor == "here" else len(os.sched_getaffinity(0))


def _by_processes(sweep: Sweep, chunks: list[int], workers: int) -> Results:
    left = list(chunks)
    deaths = 0
    while left:
        before = len(left)
        try:
            for chunk, found in _by_pool(sweep, left, workers):
                left.remove(chunk)
                yield chunk, found
        except BrokenProcessPool:
            # Someone killed a process: its chunks are lost, and those that waited beside it.
            deaths = 1 if len(left) < before else deaths + 1
            if deaths == _ATTEMPTS:
                raise InputError(
                    f"--executor processes: a process died {_ATTEMPTS} times; is there enough "
                    "memory? The same command goes on with what is missing"
                ) from None


def _by_pool(sweep: Sweep, chunks: list[int], workers: int) -> Results:
    # A fork of a process with threads, as those of NumPy and Zarr, may never wake up.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        waiting: dict[Future[Arrays], int] = {}
        rest = iter(chunks)
        try:
            while True:
                while len(waiting) < _AHEAD * workers and (chunk := next(rest, None)) is not None:
                    waiting[pool.submit(solve_chunk, sweep, chunk)] = chunk
                if not waiting:
                    return
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    yield waiting.pop(future), future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def check_dask() -> None:
    """Refuse where Dask is missing."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError("--executor dask needs dask: pip install 'pyharness[sweep]'") from None


def _by_dask(sweep: Sweep, chunks: list[int], workers: int, address: str | None) -> Results:
    dask: Any = import_module("distributed")

    if address is None:
        with (
            dask.LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs=50
            ) as cluster,
            dask.Client(cluster) as client,
        ):
            yield from _by_client(client, sweep, chunks)
    else:
        with connected(address) as client:
            yield from _by_client(client, sweep, chunks)


def connected(address: str) -> Any:
    """Return a client of the scheduler at an address; InputError where nobody answers."""
    import logging

    dask: Any = import_module("distributed")

    client: Any = None
    try:
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        client = dask.Client(address, timeout=_ANSWER, set_as_default=False)
        client.wait_for_workers(1, timeout=_ANSWER / 2.0)
        return client
    except Exception as error:  # whatever answers there may make anything of the question
        if client is not None:
            client.close(timeout=1.0)
        reason = "it has no worker" if client is not None else _reason(error)
        raise InputError(
            f"--scheduler '{address}': {reason}; allowed: the address of a Dask scheduler with "
            "workers, as in tcp://host:8786"
        ) from None


def _reason(error: Exception) -> str:
    if isinstance(error, ValueError) and not isinstance(error, OSError):
        return str(error)
    return f"no scheduler answered within {_ANSWER:g} s"


def _by_client(client: Any, sweep: Sweep, chunks: list[int]) -> Results:
    """Keep every worker busy; what dies with one is computed again by another, as Dask does."""
    dask: Any = import_module("distributed")

    n_threads = sum(client.nthreads().values())
    (sent,) = client.scatter([sweep], broadcast=True)
    rest = iter(chunks)
    running = dask.as_completed()
    chunk_of = {}

    def submit() -> None:
        if (chunk := next(rest, None)) is not None:
            # Not pure: Dask is not to think of names for what is new each time.
            future = client.submit(solve_chunk, sent, chunk, pure=False)
            chunk_of[future.key] = chunk
            running.add(future)

    for _ in range(_AHEAD * max(1, n_threads)):
        submit()
    for future in running:
        try:
            found = future.result()
        except dask.KilledWorker:
            raise InputError(
                "--executor dask: the workers that took a chunk died, one after the other; is "
                "there enough memory? The same command goes on with what is missing"
            ) from None
        yield chunk_of.pop(future.key), found
        future.release()
        submit()
