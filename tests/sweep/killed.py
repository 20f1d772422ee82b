"""A sweep killed half way and resumed: ``python -m tests.sweep.killed 10000000``.

With the word ``attitude`` as second argument, the sweep stores attitudes too, and two worker
processes solve it.
"""

import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from tests.sweep.sweeps import files

_PATIENCE = 600.0  # s
_ATTEMPTS = 5
SWEEP = """
chunk = {chunk}
reductions = [{reductions}]
[scene]
case = 3
[solve]
t_end = {t_end}
[[axis]]
field = "omega.1"
draw = "normal"
mean = 0.0
deviation = 1.0
seed = 1
count = {count}
[[axis]]
field = "omega.3"
from = -10.0
to = 10.0
count = 100
"""


OMEGA = '"end", "status", "growth"'
ATTITUDE = '"end", "status", "attitude", "pointing-error"'


@dataclass(frozen=True)
class Killed:
    """The outcome: all chunks, those done when the sweep was killed, and faults after resuming."""

    n_chunks: int
    n_done: int
    written_again: list[str]
    different: list[str]


def kill_and_resume(
    folder: Path, scenes: int, chunk: int, t_end: float = 1.0, executor: str = "here",
    reductions: str = OMEGA,
) -> Killed:  # fmt: skip
    """Run a sweep undisturbed; kill it half way and resume it; compare the bytes."""
    path = folder / "sweep.toml"
    count = scenes // 100
    path.write_text(SWEEP.format(chunk=chunk, count=count, t_end=t_end, reductions=reductions))
    whole, killed = folder / "whole.zarr", folder / "killed.zarr"
    _finish(path, whole, executor)
    n_chunks = len(_done(whole))
    # On a busy machine the sweep may have ended before the signal, or may be about to end.
    for _ in range(_ATTEMPTS):
        shutil.rmtree(killed, ignore_errors=True)
        was_running = _killed(_start(path, killed, executor), killed, n_chunks // 2)
        if was_running and len(_done(killed)) < n_chunks:
            break
    before = {path: path.stat().st_mtime_ns for path in killed.rglob("*") if path.is_file()}
    done = {*_done(killed)}
    _finish(path, killed, executor)
    again = [
        str(path)
        for path, when in before.items()
        if "c" in path.parts[len(killed.parts) :] and _place(path, killed) in done
        if path.stat().st_mtime_ns != when
    ]
    one, other = files(whole), files(killed)
    different = [name for name in one.keys() | other.keys() if one.get(name) != other.get(name)]
    return Killed(n_chunks, len(done), again, different)


def _killed(process: "subprocess.Popen[bytes]", store: Path, count: int) -> bool:
    """Kill a sweep when `count` chunks are done; return whether it was still running."""
    end = time.monotonic() + _PATIENCE
    while len(_done(store)) < count and process.poll() is None and time.monotonic() < end:
        time.sleep(0.001)
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    return process.wait() == -signal.SIGKILL


def _start(path: Path, store: Path, executor: str = "here") -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-m", "pyharness", "sweep", str(path), "--out", str(store)]
    # A process group of its own, so that its workers are killed with it.
    return subprocess.Popen(
        [*command, "--executor", executor], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip


def _finish(path: Path, store: Path, executor: str) -> None:
    if _start(path, store, executor).wait(_PATIENCE) != 0:
        raise AssertionError(f"the sweep of {path} did not end well")


def _done(store: Path) -> list[tuple[str, ...]]:
    """Return the places of the chunks that are done, whose checksums are written last."""
    found = (store / "checksums" / "c").rglob("*")
    chunks = (each for each in found if each.is_file() and each.suffix != ".partial")
    return [_place(each, store) for each in chunks]


def _place(path: Path, store: Path) -> tuple[str, ...]:
    # After the array's name and "c" come two dimensions of the grid, and perhaps the component's.
    return path.relative_to(store).parts[2:4]


def main() -> int:
    """Kill and resume a sweep of so many scenes, and print the outcome and the memory."""
    scenes = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10_000_000
    with_attitude = sys.argv[2:] == ["attitude"]
    own = ("processes", ATTITUDE) if with_attitude else ("here", OMEGA)
    with tempfile.TemporaryDirectory() as folder:
        begin = time.monotonic()
        chunk = min(100_000, max(100, scenes // 100))
        found = kill_and_resume(Path(folder), scenes, chunk, 1.0, *own)
        size = sum(map(len, files(Path(folder) / "killed.zarr").values()))
        print(f"{scenes} scenes, {found.n_chunks} chunks, {size / 1e6:.0f} MB")
        print(f"killed when {found.n_done} were done")
        print(f"chunks written again: {len(found.written_again)}")
        print(f"files that differ from those of a sweep undisturbed: {len(found.different)}")
        most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        print(f"{time.monotonic() - begin:.0f} s; largest process {most / 1024:.0f} MiB")
    return 1 if found.written_again or found.different else 0


if __name__ == "__main__":
    sys.exit(main())
