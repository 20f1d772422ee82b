"""Executors, which compute a sweep's chunks in this or other processes, with equal results.

Child processes ignore Ctrl-C, and end when this process ends.
"""

import asyncio
import contextlib
import logging
import multiprocessing
import os
import re
import signal
import socket
import sys
import threading
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from importlib import import_module
from multiprocessing import connection, resource_tracker
from typing import Any, NamedTuple

from pyharness.model.distribution import install_command
from pyharness.model.errors import InputError
from pyharness.sweep.batches import solve_chunk
from pyharness.sweep.sweep import Arrays, Sweep

EXECUTORS = ("here", "processes", "dask")
Results = Generator[tuple[int, Arrays], None, None]

# The sweep ends after so many deaths of processes without a completed chunk between them.
_ATTEMPTS = 3
_AHEAD = 2  # chunks submitted for each process, so that no process waits for the disk
_ANSWER = 4.0  # time (s) in which a scheduler must answer and have a worker
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?P<host>[\w.-]+|\[[\da-fA-F:.]+\]):(?P<port>\d{1,5})")


class Engine(NamedTuple):
    """A started executor; `computed` yields the number and the arrays of each chunk."""

    workers: int
    computed: Callable[[Sweep, list[int]], Results]
    is_here: bool = False  # whether the process that computes the results also writes them


@contextlib.contextmanager
def engine(
    executor: str, workers: int | None = None, address: str | None = None
) -> Iterator[Engine]:
    """Start the executor ``here``, ``processes`` or ``dask``, and yield it as an Engine.

    ``dask`` uses the scheduler at `address`, or a local cluster.
    """
    if executor == "here":
        yield Engine(1, _solve_here, is_here=True)
        return
    # A process may be restricted to some processors; not every system reports this.
    is_known = hasattr(os, "sched_getaffinity")
    count = workers or (len(os.sched_getaffinity(0)) if is_known else os.cpu_count() or 1)
    if executor == "processes":
        yield Engine(count, partial(_by_processes, count))
        return
    dask: Any = import_module("distributed")
    # The log is meant for the administrators of a cluster.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with _local_cluster(dask, count) if address is None else _connected(dask, address) as client:
        yield Engine(max(1, sum(client.nthreads().values())), partial(_by_client, client))


def _solve_here(sweep: Sweep, chunks: list[int]) -> Results:
    return ((chunk, solve_chunk(sweep, chunk)) for chunk in chunks)


def _by_processes(workers: int, sweep: Sweep, chunks: list[int]) -> Results:
    left = list(chunks)
    deaths = 0
    while left:
        before = len(left)
        try:
            for chunk, found in _by_pool(sweep, list(left), workers):
                left.remove(chunk)
                yield chunk, found
        except BrokenProcessPool:
            # A killed process breaks the pool; uncompleted chunks are lost.
            deaths = 1 if len(left) < before else deaths + 1
            if deaths == _ATTEMPTS:
                raise InputError(
                    f"--executor processes: a process died {_ATTEMPTS} times, perhaps for "
                    "lack of memory; the same command computes the missing chunks"
                ) from None


def _by_pool(sweep: Sweep, chunks: list[int], workers: int) -> Results:
    # A fork of a process with threads, such as those of NumPy and Zarr, may hang.
    context = multiprocessing.get_context("spawn")
    # The pool creates semaphores; Python would then start its resource tracker.
    with deaf_children():
        pool = ProcessPoolExecutor(workers, context, end_with_parent)
    waiting: dict[Future[Arrays], int] = {}
    rest = iter(chunks)
    try:
        while True:
            while len(waiting) < _AHEAD * workers and (chunk := next(rest, None)) is not None:
                # `submit` starts a process if the pool has fewer than `workers`.
                with deaf_children():
                    waiting[pool.submit(solve_chunk, sweep, chunk)] = chunk
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(future), future.result()
    finally:
        # Waiting for unfinished chunks might never end.
        processes = list((pool._processes or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.kill()


@contextlib.contextmanager
def deaf_children() -> Iterator[None]:
    """Block Ctrl-C in this thread, and in processes and threads started within this context."""
    # Children inherit a blocked signal. Python starts its resource tracker with the first child and
    # then unblocks the signal; the tracker is therefore started before.
    warning = "ignore:resource_tracker"
    # The tracker would warn of leftover semaphores.
    sys.warnoptions.append(warning)
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.remove(warning)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        # The sentinel is a pipe, whose other end the system closes at the parent's end.
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def check_dask() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(f"--executor dask needs dask: {install_command('sweep')}") from None


@contextlib.contextmanager
def _local_cluster(dask: Any, workers: int) -> Iterator[Any]:
    started: list[Any] = []
    errors: list[Exception] = []
    wanted = threading.Event()
    wanted.set()

    def start() -> None:
        try:
            with contextlib.ExitStack() as stack, deaf_children():
                cluster = dask.LocalCluster(
                    n_workers=workers, threads_per_worker=1, dashboard_address=":0", silence_logs=50
                )
                stack.callback(cluster.close, timeout=_ANSWER)
                client = dask.Client(cluster, set_as_default=False)
                stack.callback(client.close, timeout=_ANSWER)
                if wanted.is_set():
                    started.append((client, stack.pop_all()))
        except Exception as error:
            errors.append(error)

    # The start takes seconds. This thread stays free to receive Ctrl-C, which is blocked in the
    # threads and processes of the cluster.
    thread = threading.Thread(target=start, daemon=True)
    thread.start()
    try:
        while thread.is_alive():
            thread.join(0.1)
        if errors:
            raise errors[0]
        ((client, stack),) = started
        yield client
    finally:
        wanted.clear()
        for _, stack in started:
            stack.close()


def _connected(dask: Any, address: str) -> Any:
    found = _ADDRESS.fullmatch(address)
    allowed = "allowed: the address of a Dask scheduler with workers, as in tcp://host:8786"
    where = f"--scheduler '{address}'"
    if found is None or int(found["port"]) > 65535:
        raise InputError(f"{where}: is not an address; {allowed}")
    place = found["host"].strip("[]"), int(found["port"])
    answered: list[bool] = []
    try:
        # Without a server, a plain connection fails at once; Dask would try again and again.
        socket.create_connection(place, timeout=_ANSWER).close()
        asyncio.run(asyncio.wait_for(_has_workers(dask, address, answered), _ANSWER))
        return dask.Client(address, timeout=_ANSWER, set_as_default=False)
    except Exception as error:  # a server that is no scheduler may send any answer
        reason = "no Dask scheduler answers there"
        if answered:
            reason = "it has no worker"
        elif isinstance(error, ConnectionError | socket.gaierror):
            reason = f"nobody answers: {error.strerror or error}"
        raise InputError(f"{where}: {reason}; {allowed}") from None


async def _has_workers(dask: Any, address: str, answered: list[bool]) -> None:
    """Wait until the scheduler has workers; append True to `answered` for answers without one."""
    # A Dask client would wait half a minute for a server that accepts the connection but does not
    # answer; the scheduler is therefore called directly.
    async with dask.rpc(address) as scheduler:
        while not (await scheduler.identity())["workers"]:
            answered.append(True)
            await asyncio.sleep(0.1)


def _by_client(client: Any, sweep: Sweep, chunks: list[int]) -> Results:
    """Yield results of chunks; Dask recomputes the chunks of dead workers."""
    dask: Any = import_module("distributed")
    n_threads = sum(client.nthreads().values())
    rest = iter(chunks)
    running = dask.as_completed(loop=client.loop)
    chunk_of = {}

    def submit() -> None:
        if (chunk := next(rest, None)) is not None:
            # The sweep is sent with each task: sent once, it could be lost with the workers that
            # received it.
            future = client.submit(solve_chunk, sweep, chunk, pure=False)
            chunk_of[future.key] = chunk
            running.add(future)

    for _ in range(_AHEAD * max(1, n_threads)):
        submit()
    for future in running:
        try:
            found = future.result()
        except dask.KilledWorker:
            raise InputError(
                "--executor dask: every worker that computed a chunk died, perhaps for lack "
                "of memory; the same command computes the missing chunks"
            ) from None
        except InputError:
            raise
        except Exception as error:  # a worker lacks something, or the scheduler is gone
            raise InputError(
                f"--executor dask: chunk {chunk_of[future.key]}: {type(error).__name__}: {error}; "
                "the same command continues with what is missing"
            ) from None
        yield chunk_of.pop(future.key), found
        future.release()
        submit()
