"""Stores: bit-for-bit identical after any interruption, and never the store of another sweep."""

import contextlib
import errno
import os
import shutil
import subprocess
import sys
import time
import tracemalloc
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pyharness.model.errors import InputError
from pyharness.sweep import run, store, store_layout
from pyharness.sweep.axes import MOST_VALUES
from pyharness.sweep.batches import solve_chunk
from pyharness.sweep.executors import engine
from pyharness.sweep.run import check_size, forecast
from pyharness.sweep.store import opened
from pyharness.sweep.sweep import Sweep, points
from pyharness.sweep.sweep_file import read_sweep
from tests.refused import refused
from tests.sweep.killed import ATTITUDE, OMEGA, kill_and_resume
from tests.sweep.sweeps import PROGRAM, SQUARE, TILT, files, run_sweep, text, written

Patch = pytest.MonkeyPatch


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("executor", "reductions"), [("here", OMEGA), ("processes", OMEGA), ("processes", ATTITUDE)]
)
def test_killed_at_half_way_it_resumes_and_does_nothing_twice(
    executor: str, reductions: str, tmp_path: Path
) -> None:
    found = kill_and_resume(tmp_path, 8_000, 200, 3.0, executor, reductions)
    assert found.n_chunks == 40
    assert found.n_chunks // 2 <= found.n_done < found.n_chunks
    assert found.written_again == []
    assert found.different == []


@pytest.mark.campaign
def test_xarray_opens_it_without_a_warning(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    run_sweep(read_sweep(written(tmp_path, PROGRAM)), str(tmp_path / "store"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = xarray.open_zarr(tmp_path / "store")
    assert found["end"].dims == ("listing", "sample", "step_size", "component")
    assert found["listing"].values.tolist() == ["original", "corrected"]
    assert found["omega.1"].dims == ("sample",)
    assert "omega.1" in found.coords
    assert found["omega.1"].attrs["units"] == "rad/s"
    assert found["status"].attrs["flag_meanings"].split()[0] == "complete"
    assert found.attrs["schema"] == 2
    assert found.attrs["sweep"] == PROGRAM
    one = found["stop-step"].sel(listing="original", step_size=0.01).values
    assert one.shape == (12,)
    assert (one >= 0).all()


@pytest.mark.campaign
def test_draws_and_results_do_not_depend_on_the_chunks(tmp_path: Path) -> None:
    found = []
    for chunk in (20, 7, 1000):
        sweep = read_sweep(written(tmp_path, PROGRAM.replace("chunk = 20", f"chunk = {chunk}")))
        run_sweep(sweep, str(tmp_path / str(chunk)))
        with opened(sweep, str(tmp_path / str(chunk))) as there:
            found.append({name: there.array(name)[...] for name in ("end", "stop-step", "error")})
    for other in found[1:]:
        for name, values in found[0].items():
            assert values.tobytes() == other[name].tobytes()


@pytest.mark.campaign
def test_disk_that_fills_ends_in_a_line_and_a_store_that_resumes(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    from zarr.storage import _local  # noqa: PLC2701

    sweep = read_sweep(written(tmp_path, PROGRAM.replace("chunk = 20", "chunk = 4")))
    run_sweep(sweep, str(tmp_path / "whole"))
    put, room = _local._put, [90]

    def full(path: Path, value: Any, *more: Any, **options: Any) -> Any:
        room[0] -= 1
        if room[0] < 0:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.with_suffix(".0.partial").write_bytes(b"half")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return put(path, value, *more, **options)

    with monkeypatch.context() as patched:
        patched.setattr(_local, "_put", full)
        patched.setattr(run, "forecast", lambda *given: 0.0)
        refused("No space left on device", run_sweep, sweep, str(tmp_path / "full"))
    with opened(sweep, str(tmp_path / "full")) as found_store:
        done = found_store.done()
    assert any(done)
    assert not all(done)
    assert run_sweep(sweep, str(tmp_path / "full")).before == sum(done)
    assert files(tmp_path / "full") == files(tmp_path / "whole")


@pytest.mark.campaign
def test_files_that_may_not_grow_end_in_a_line(tmp_path: Path) -> None:
    path = written(tmp_path, text(SQUARE, TILT.replace("count = 6", "count = 2000")))
    command = [sys.executable, "-m", "pyharness", "sweep", path, "--out", str(tmp_path / "store")]
    limited = (
        "import os, resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000)); "
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    found = subprocess.run(
        [sys.executable, "-c", limited, *command], capture_output=True, text=True, check=False
    )
    assert found.returncode == 2
    assert "File too large" in found.stderr.splitlines()[-1]
    assert "Traceback" not in found.stderr
    subprocess.run(command, capture_output=True, check=True)


def test_store_of_another_sweep_stays_as_it_was(tmp_path: Path) -> None:
    sweep = read_sweep(written(tmp_path, text(TILT)))
    run_sweep(sweep, str(tmp_path / "store"))
    before = files(tmp_path / "store")
    other = read_sweep(written(tmp_path, text(TILT) + "\n# other\n"))
    refused("--out", run_sweep, other, str(tmp_path / "store"))
    assert files(tmp_path / "store") == before
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "letter").write_text("dear")
    refused("--out", run_sweep, sweep, str(tmp_path / "folder"))
    assert files(tmp_path / "folder") == {"letter": b"dear"}
    refused("--out", run_sweep, sweep, str(tmp_path / "sweep.toml"))


def test_two_sweeps_do_not_write_to_one_store(tmp_path: Path) -> None:
    sweep = read_sweep(written(tmp_path, text(TILT)))
    path = str(tmp_path / "store")
    with opened(sweep, path), pytest.raises(InputError, match="--out"):
        run_sweep(sweep, path)
    assert [run_sweep(sweep, path).computed for _ in range(2)] == [1, 0]


def test_store_that_another_process_makes_meanwhile_is_taken(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    sweep = read_sweep(written(tmp_path, text(TILT)))
    make, folder = store_layout.filled, tmp_path / "store"

    @contextlib.contextmanager
    def late(sweep: Any, path: Path) -> Iterator[Path]:
        with make(sweep, path) as new:
            shutil.copytree(new, path)
            yield new

    with monkeypatch.context() as patched:
        patched.setattr(store, "filled", late)
        with opened(sweep, str(folder)) as found:
            assert found.done() == [False]
    assert sorted(each.name for each in tmp_path.iterdir()) == ["store", "sweep.toml"]


@pytest.mark.campaign
def test_sweeps_that_start_at_once_leave_one_at_work(tmp_path: Path) -> None:
    path = written(tmp_path, text(TILT))
    command = [sys.executable, "-m", "pyharness", "sweep", path, "--out", str(tmp_path / "store")]
    running = [
        subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    ended = [(each.communicate()[1], each.returncode) for each in running]
    assert 0 in [code for _, code in ended]
    for errors, code in ended:
        if code:
            assert code == 2
            assert errors.count("\n") == 1
            assert "--out" in errors
    assert run_sweep(read_sweep(path), str(tmp_path / "store")).computed == 0


@pytest.mark.campaign
def test_forecast_has_the_time_of_files(tmp_path: Path, monkeypatch: Patch) -> None:
    axis = TILT.replace("count = 6", "count = 100000")
    sweep = read_sweep(written(tmp_path, text(axis, top='chunk = 1\nreductions = ["end"]')))
    write, read = store.Store.write, store.Store.read

    def slow_write(self: store.Store, chunk: int, found: Any) -> None:
        time.sleep(0.03)
        write(self, chunk, found)

    def slow_read(self: store.Store, name: str, chunk: int) -> Any:
        time.sleep(0.02)
        return read(self, name, chunk)

    monkeypatch.setattr(store.Store, "write", slow_write)
    monkeypatch.setattr(store.Store, "read", slow_read)
    with engine("here") as own:
        assert 5_000.0 < forecast(sweep, str(tmp_path / "store"), 100_000, own) < 50_000.0
        # Existing chunks are read again, which takes time too.
        assert 2_000.0 < forecast(sweep, str(tmp_path / "store"), 1, own) < 20_000.0
    assert [each.name for each in tmp_path.iterdir()] == ["sweep.toml"]


def test_forecast_knows_the_constant_cost_of_a_batch(tmp_path: Path, monkeypatch: Patch) -> None:
    now = [0.0]

    def solved(sweep: Sweep, where: list[Any]) -> None:
        now[0] += 3.0 + 0.004 * len(where[0])

    monkeypatch.setattr(run, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    monkeypatch.setattr(run, "solve_points", solved)
    monkeypatch.setattr(run, "solve_chunk", lambda sweep, i: solved(sweep, points(sweep.box(i))))
    for chunks in (50, 400):
        axis = TILT.replace("count = 6", f"count = {chunks * 2000}")
        given = text(axis, top='chunk = 2000\nreductions = ["end"]')
        seconds = run.seconds_per_chunk(read_sweep(written(tmp_path, given)))
        assert seconds == pytest.approx(11.0, rel=1e-2)


def test_folder_in_which_a_thread_still_writes_is_removed(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    ways = iter([lambda *given, **more: None])
    monkeypatch.setattr(
        store_layout,
        "shutil",
        SimpleNamespace(rmtree=lambda *a, **b: next(ways, shutil.rmtree)(*a, **b)),
    )
    sweep = read_sweep(written(tmp_path, text(TILT)))
    with contextlib.suppress(KeyboardInterrupt), store_layout.filled(sweep, tmp_path / "store"):
        raise KeyboardInterrupt
    assert [each.name for each in tmp_path.iterdir()] == ["sweep.toml"]


def test_file_of_the_longest_axis_is_within_its_limit(tmp_path: Path, monkeypatch: Patch) -> None:
    """Zstandard adds at most 1/256 to what it can't compress; a larger file is an error in a line.

    The limit of the file is compared as the metadata are written, and as they are read.
    """
    assert 8 * MOST_VALUES * 257 // 256 + 1024 < store_layout.LARGEST_METADATA
    monkeypatch.setattr(store_layout, "LARGEST_METADATA", 100)
    refused("100", run_sweep, read_sweep(written(tmp_path, text(TILT))), str(tmp_path / "store"))
    assert [each.name for each in tmp_path.iterdir()] == ["sweep.toml"]


def test_what_neither_disk_nor_memory_holds_is_refused_at_once(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    long = "\n".join(
        f'[[axis]]\nfield = "omega.{axis}"\nfrom = 1.0\nto = 2.0\ncount = 100000'
        for axis in (1, 2, 3)
    )
    sweep = read_sweep(written(tmp_path, text(long)))
    assert sweep.n_scenes == 10**15
    refused(r"25\.1 PB", run_sweep, sweep, str(tmp_path / "store"))
    # Each chunk has four files, and each of them takes a block of the disk.
    top = 'chunk = 1\nreductions = ["end", "status", "growth"]'
    small = read_sweep(written(tmp_path, text(TILT.replace("count = 6", "count = 1000"), top=top)))
    disk = {"f_frsize": 4096, "f_bavail": 4000, "f_files": 10, "f_favail": 4000}
    assert check_size(small, str(tmp_path), 1, 1000)[0] == 4000 * 4096
    for spare, words in (("f_bavail", "16.4 MB, and 16.4 MB are free"), ("f_favail", "4000 files")):
        full = SimpleNamespace(**{**disk, spare: 3999})
        monkeypatch.setattr(os, "statvfs", lambda path, full=full: full)
        refused(words, run_sweep, small, str(tmp_path / "store"))
    monkeypatch.undo()
    monkeypatch.setattr(os, "sysconf", lambda name: 10)
    refused("memory", run_sweep, small, str(tmp_path / "store"))
    assert [each.name for each in tmp_path.iterdir()] == ["sweep.toml"]


@pytest.mark.campaign
def test_memory_is_refused_where_the_half_of_it_ends(tmp_path: Path, monkeypatch: Patch) -> None:
    sweep = read_sweep(written(tmp_path, text(TILT)))
    estimate: Any = run_sweep(sweep, str(tmp_path / "store")).estimate
    monkeypatch.setattr("pyharness.model.scene._BYTES_PER_STEP", 1)  # only the sweep is too large
    # Pages of one byte: exactly half of the memory, and two bytes less.
    for number, is_refused in ((2 * estimate.memory, False), (2 * estimate.memory - 2, True)):
        monkeypatch.setattr(os, "sysconf", {"SC_PHYS_PAGES": number, "SC_PAGE_SIZE": 1}.__getitem__)
        if is_refused:
            refused("memory", run_sweep, sweep, str(tmp_path / "refused"))
        else:
            run_sweep(sweep, str(tmp_path / "kept"))


@pytest.mark.campaign
@pytest.mark.parametrize("samples", [1, 40])
def test_memory_of_the_estimate_is_what_a_chunk_takes(samples: int, tmp_path: Path) -> None:
    top = f'chunk = 20000\nreductions = ["end", "status", {{name = "flips", samples = {samples}}}]'
    axis = '[[axis]]\nfield = "tilt"\nfrom = 0.1\nto = 1.0\ncount = 20000'
    sweep = read_sweep(written(tmp_path, text(axis, top=top)))
    estimate: Any = run_sweep(sweep, str(tmp_path / "store")).estimate
    tracemalloc.start()
    try:
        solve_chunk(sweep, 0)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak <= estimate.memory <= 8 * peak


def test_what_is_not_computed_yet_is_no_number(tmp_path: Path) -> None:
    with opened(read_sweep(written(tmp_path, PROGRAM)), str(tmp_path / "store")) as found_store:
        assert np.isnan(found_store.array("end")[...]).all()
        assert (found_store.array("status")[...] == -1).all()
        assert not any(found_store.done())


@pytest.mark.campaign
def test_chunk_without_a_number_in_it_is_done_all_the_same(tmp_path: Path) -> None:
    sweep = read_sweep(written(tmp_path, PROGRAM))
    run_sweep(sweep, str(tmp_path / "store"))
    with opened(sweep, str(tmp_path / "store")) as found_store:
        assert np.isnan(found_store.array("overflow-time")[...]).all()
        assert all(found_store.done())
