"""A copy of the checkout that may be changed: its files, its build, and the runs in it."""

import contextlib
import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from threading import Lock

from tests.mutations.table import ROOT, Row

LEFT_OUT = shutil.ignore_patterns(
    ".git", ".venv", "build", "dist", "__pycache__", ".*_cache", ".hypothesis", "*.so"
)
MEMORY = 12 << 30  # bytes; a loop that gathers for ever must not take the machine along


class Stopped(Exception):
    """The whole run was ended."""


class Processes:
    """What runs at the moment, so that it can be ended."""

    def __init__(self) -> None:
        self._running: set[subprocess.Popen[str]] = set()
        self._lock = Lock()
        self._ended = False

    def run(
        self, command: list[str], folder: Path, environment: dict[str, str], limit: float
    ) -> tuple[int | None, str]:
        """Return the exit code, None where the time was up, and all that was said."""
        with self._lock:
            if self._ended:
                raise Stopped
            process = subprocess.Popen(
                command, cwd=folder, env=environment, text=True, errors="replace",
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                start_new_session=True,
            )  # fmt: skip
            self._running.add(process)
        try:
            said, _ = process.communicate(timeout=limit)
            code: int | None = process.returncode
        except subprocess.TimeoutExpired:
            _kill(process)
            said, _ = process.communicate()
            code = None
        finally:
            with self._lock:
                self._running.discard(process)
        if self._ended:
            raise Stopped
        return code, said

    def end(self) -> None:
        """End them all, and let none begin."""
        with self._lock:
            self._ended = True
            for process in self._running:
                _kill(process)


def _kill(process: subprocess.Popen[str]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


class Tree:
    """A copy of the checkout.

    Python finds the package in it, not the editable one; the compiled extension lies in it.
    """

    def __init__(self, folder: Path, processes: Processes) -> None:
        self.folder = folder
        self._processes = processes
        self._build = folder / "build" / "mutated"
        self._stale = False
        shutil.copytree(ROOT, folder, ignore=LEFT_OUT, symlinks=True)
        from pyharness import _build, _kernels, _many, _solver

        for module in (_build, _kernels, _many, _solver):
            shutil.copy(str(module.__file__), folder / "pyharness")
        # A limit on memory for whatever is run, and the threads of two jobs don't pay.
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
        editable = [f._build_path for f in sys.meta_path if hasattr(f, "_build_path")]
        self._environment = {
            **os.environ,
            "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
            "PYTHONPATH": str(folder),
            "MESONPY_EDITABLE_SKIP": os.pathsep.join(editable),
            "COLUMNS": "300",
            # What was said before a crash is not lost.
            "PYTHONUNBUFFERED": "1",
        }

    def run(self, command: list[str], limit: float) -> tuple[int | None, str]:
        """Run a command in the copy."""
        return self._processes.run(command, self.folder, self._environment, limit)

    def change(self, row: Row) -> str | None:
        """Make the change; return what the compiler said where it does not take it."""
        path = self.folder / row.file
        path.write_text(row.applied(path.read_text()))
        if row.compiled:
            self._stale = True
            return self._compile()
        self._forget(row)
        self.ready()
        return None

    def restore(self, row: Row) -> None:
        """Take the change back; what is compiled is built when it is next asked for."""
        shutil.copyfile(ROOT / row.file, self.folder / row.file)
        if row.compiled:
            self._stale = True
        else:
            self._forget(row)

    def ready(self) -> None:
        """Build what was taken back."""
        if self._stale and (said := self._compile()):
            raise RuntimeError(said)
        self._stale = False

    def _forget(self, row: Row) -> None:
        # Two texts of one length within a second look the same to Python.
        path = self.folder / row.file
        for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
            compiled.unlink()

    def _compile(self) -> str | None:
        if not (self._build / "build.ninja").exists():
            setup = ["meson", "setup", str(self._build), "-Doptimization=2"]
            code, said = self.run(setup, 600)
            if code != 0:
                raise RuntimeError(said)
        code, said = self.run(["ninja", "-C", str(self._build)], 600)
        if code != 0:
            return said
        for path in self._build.glob("_*.so"):
            # Not over a file that may be mapped.
            place = self.folder / "pyharness" / path.name
            place.unlink(missing_ok=True)
            shutil.copy(path, place)
        return None
