"""All executors return the same bytes, even if their workers die."""

import multiprocessing
import os
import signal
import socket
import time
from collections.abc import Iterator
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import pytest

from pyharness.model.errors import InputError
from pyharness.sweep import executors
from pyharness.sweep.batches import solve_chunk
from pyharness.sweep.executors import engine
from pyharness.sweep.sweep import Sweep
from pyharness.sweep.sweep_file import read_sweep
from tests.refused import refused
from tests.sweep.sweeps import PROGRAM, files, quick_and_slow, run_sweep, written

Patch = pytest.MonkeyPatch
distributed = pytest.importorskip("distributed")


@pytest.fixture
def sweep(tmp_path: Path) -> Sweep:
    """Return a sweep of 48 scenes in 12 chunks."""
    return read_sweep(written(tmp_path, PROGRAM.replace("chunk = 20", "chunk = 4")))


@pytest.fixture
def cluster() -> Iterator[Any]:
    """Yield a cluster of two workers."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    ) as found:
        yield found


@pytest.mark.campaign
@pytest.mark.parametrize("executor", ["processes", "dask"])
def test_every_executor_writes_the_same_bytes(executor: str, sweep: Sweep, tmp_path: Path) -> None:
    run_sweep(sweep, str(tmp_path / "here"))
    run_sweep(sweep, str(tmp_path / "other"), executor, workers=2)
    assert files(tmp_path / "here") == files(tmp_path / "other")


@pytest.mark.campaign
def test_killed_worker_of_dask_costs_its_chunks_and_nothing_else(
    cluster: Any, sweep: Sweep, tmp_path: Path
) -> None:
    run_sweep(sweep, str(tmp_path / "here"))
    with distributed.Client(cluster) as client:
        victim = next(iter(client.run(os.getpid).values()))
    told: list[str] = []

    def progress(done: int, total: int, what: str) -> None:
        told.append(what)
        if len(told) == sweep.n_chunks // 3:
            os.kill(victim, signal.SIGKILL)

    outcome = run_sweep(
        sweep, str(tmp_path / "dask"), "dask", address=cluster.scheduler_address, progress=progress
    )
    assert outcome.computed == sweep.n_chunks == len(told)
    with pytest.raises(ProcessLookupError):
        os.kill(victim, 0)
    assert files(tmp_path / "here") == files(tmp_path / "dask")


@pytest.mark.campaign
def test_processes_are_started_once(sweep: Sweep, monkeypatch: Patch) -> None:
    by_pool, started = executors._by_pool, []

    def counted(sweep: Sweep, chunks: list[int], workers: int) -> Any:
        started.append(chunks)
        return by_pool(sweep, chunks, workers)

    monkeypatch.setattr(executors, "_by_pool", counted)
    with engine("processes", 2) as own:
        found = [chunk for chunk, _ in own.computed(sweep, list(range(sweep.n_chunks)))]
    assert sorted(found) == started[0] == list(range(sweep.n_chunks))
    assert len(started) == 1


@pytest.mark.campaign
def test_killed_process_costs_its_chunks_and_nothing_else(sweep: Sweep) -> None:
    found = {}
    with engine("processes", 2) as own:
        for chunk, arrays in own.computed(sweep, list(range(sweep.n_chunks))):
            assert chunk not in found
            found[chunk] = arrays
            if len(found) == 3:
                victim = multiprocessing.active_children()[0]
                victim.kill()
                victim.join()
    assert sorted(found) == list(range(sweep.n_chunks))
    for chunk, arrays in found.items():
        for name, values in solve_chunk(sweep, chunk).items():
            assert values.tobytes() == arrays[name].tobytes()


def test_chunks_whose_processes_die_are_tried_three_times(sweep: Sweep, monkeypatch: Patch) -> None:
    """Three deaths in a row end the sweep; a chunk in between shows that there is memory enough."""
    started: list[int] = []
    done = iter([1, 0, 2, 0, 0])

    def dying(sweep: Sweep, chunks: list[int], workers: int) -> Any:
        started.append(len(chunks))
        # After the planned deaths all chunks are done, so that a fault can't loop for ever.
        yield from ((chunk, {}) for chunk in chunks[: next(done, len(chunks))])
        if chunks:
            raise BrokenProcessPool

    monkeypatch.setattr(executors, "_by_pool", dying)
    with engine("processes", 2) as own:
        results = own.computed(sweep, [0, 1, 2, 3])
        assert [next(results)[0] for _ in range(3)] == [0, 1, 2]
        refused("3 times", next, results)
    # One chunk and a death, then a second death. Two chunks and again a first death, then two more.
    assert started == [4, 3, 3, 1, 1]


@pytest.mark.campaign
def test_a_chunk_at_work_does_not_outlive_its_sweep(sweep: Sweep, monkeypatch: Patch) -> None:
    monkeypatch.setattr(executors, "solve_chunk", quick_and_slow)
    before = set(multiprocessing.active_children())
    with engine("processes", 2) as own:
        results: Any = own.computed(sweep, [0, 1, 2])
        assert next(results)[0] == 0
        workers = set(multiprocessing.active_children()) - before
        results.close()
    assert len(workers) == 2
    # A thread of the pool waits for its processes too, and only one thread receives an exit code.
    # A sentinel is ready for everyone as soon as its process has ended.
    running = {worker.sentinel for worker in workers}
    deadline = time.monotonic() + 10.0
    while running and time.monotonic() < deadline:
        running -= set(wait(list(running), deadline - time.monotonic()))
    for worker in workers:
        worker.kill()
    assert not running


@pytest.mark.campaign
def test_address_where_nobody_answers_is_refused_soon(sweep: Sweep, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        for address in (f"127.0.0.1:{port}", "tcp://127.0.0.1:1", "somewhere", "127.0.0.1:99999"):
            begin = time.monotonic()
            refused(address, run_sweep, sweep, str(tmp_path / "store"), "dask", address=address)
            assert time.monotonic() - begin < 10.0
    assert not (tmp_path / "store").exists()


@pytest.mark.campaign
def test_scheduler_without_workers_is_refused(sweep: Sweep, tmp_path: Path) -> None:
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=":0", silence_logs=50) as empty,
        pytest.raises(InputError, match="worker"),
    ):
        run_sweep(sweep, str(tmp_path / "store"), "dask", address=empty.scheduler_address)
