"""A copy of the checkout that may be changed: its files, its build, and the processes in it."""

import contextlib
import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from threading import Lock, Timer

ROOT = Path(__file__).parents[3]
PLACE = ROOT / "build" / "mutations"
MEMORY = 12 << 30  # bytes; a loop that allocates for ever must not affect the machine


class Stopped(Exception):
    """Raised when the whole run was ended."""


class Processes:
    """The running processes, so that they can be ended."""

    def __init__(self) -> None:
        self._groups: set[int] = set()
        self._lock = Lock()
        self._ended = False

    def run(
        self, command: list[str], folder: Path, environment: dict[str, str], limit: float
    ) -> tuple[int | None, str]:
        """Return the exit code of a command, or None after the time limit, and its output."""
        with self._lock:
            self.check()
            process = subprocess.Popen(
                command, cwd=folder, env=environment, text=True, errors="replace",
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                start_new_session=True,
            )  # fmt: skip
            self._groups.add(process.pid)
        try:
            said, _ = process.communicate(timeout=limit)
            code: int | None = process.returncode
        except subprocess.TimeoutExpired:
            kill(process.pid)
            said, _ = process.communicate()
            code = None
        finally:
            self.leave(process.pid)
        self.check()
        return code, said

    def check(self) -> None:
        """Raise Stopped if the whole run was ended."""
        if self._ended:
            raise Stopped

    def enter(self, group: int) -> None:
        """Add a process group."""
        with self._lock:
            self._groups.add(group)

    def leave(self, group: int) -> None:
        """End what is left of a process group, and forget it."""
        with self._lock:
            self._groups.discard(group)
        kill(group)

    def end(self) -> None:
        """End all processes, and let none begin."""
        with self._lock:
            self._ended = True
            for group in self._groups:
                kill(group)


def kill(group: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


class Server:
    """A process that has imported the libraries, and runs pytest in copies of itself."""

    def __init__(self, folder: Path, environment: dict[str, str], processes: Processes) -> None:
        self._processes = processes
        self._place = folder / "build" / "said"
        self._one_at_a_time = Lock()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.campaigns.mutations.server"], cwd=folder, env=environment,
            text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip
        processes.enter(self._process.pid)

    def run(self, arguments: list[str], limit: float) -> tuple[int, str]:
        """Return the exit status of pytest, which is negative after the time limit, and its output.

        Raise Stopped if the whole run was ended.
        """
        assert self._process.stdin is not None
        with self._one_at_a_time:
            self._processes.check()
            print(json.dumps([arguments, str(self._place)]), file=self._process.stdin, flush=True)
            copy = self._answer()
            self._processes.enter(copy)
            timer = Timer(limit, kill, [copy])
            timer.start()
            try:
                return self._answer(), self._place.read_text(errors="replace")
            finally:
                timer.cancel()
                self._processes.leave(copy)

    def _answer(self) -> int:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        self._processes.check()
        return int(line)


class Tree:
    """A copy of the checkout in `build/`, brought up to date whenever it is opened.

    Python finds the package in the copy, not the editable one; the compiled extension is in the
    copy.
    """

    def __init__(self, name: str, processes: Processes, *options: str) -> None:
        self.folder = PLACE / name
        self._processes = processes
        self._build = self.folder / "build" / "mutated"
        self._options = options
        self._server: Server | None = None
        self.is_stale = True  # the extension was not built from these sources
        # A limit on memory for every process: a loop that allocates for ever must end.
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
        editable = [f._build_path for f in sys.meta_path if hasattr(f, "_build_path")]
        self._environment = {
            **os.environ,
            "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
            "PYTHONPATH": str(self.folder),
            "MESONPY_EDITABLE_SKIP": os.pathsep.join(editable),
            "COLUMNS": "300",
            # Most of the time of a short test is the compilation of unchanged sources otherwise.
            "PYTHONDONTWRITEBYTECODE": "",
            # The output before a crash is not lost.
            "PYTHONUNBUFFERED": "1",
        }
        self._synchronise()
        if said := self.compile():
            raise RuntimeError(said)

    def run(
        self, command: list[str], limit: float, more: dict[str, str] | None = None
    ) -> tuple[int | None, str]:
        """Run a command in the copy, with `more` in its environment."""
        return self._processes.run(
            command, self.folder, {**self._environment, **(more or {})}, limit
        )

    def test(self, arguments: list[str], limit: float) -> tuple[int, str]:
        """Run pytest in the copy."""
        if self._server is None:
            self._server = Server(self.folder, self._environment, self._processes)
        return self._server.run(arguments, limit)

    def write(self, file: str, text: str) -> None:
        """Replace the text of a file."""
        path = self.folder / file
        path.write_text(text)
        self.is_stale |= file.startswith("fortran/")
        # Python can't distinguish two texts of one length that were written within a second.
        for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
            compiled.unlink()

    def compile(self) -> str | None:
        """Build what changed; return the compiler's message if it refuses."""
        if not (self._build / "build.ninja").exists():
            # Little optimisation: no result depends on it, and a build takes half the time.
            setup = ["meson", "setup", str(self._build), "-Doptimization=1", *self._options]
            code, said = self.run(setup, 600)
            if code != 0:
                raise RuntimeError(said)
        code, said = self.run(["ninja", "-C", str(self._build)], 900)
        if code != 0:
            return said
        for path in [*self._build.glob("_*.so"), self._build / "_build.py"]:
            place = self.folder / "pyharness" / path.name
            if not place.exists() or path.read_bytes() != place.read_bytes():
                # A file that may be mapped must not be overwritten.
                place.unlink(missing_ok=True)
                shutil.copy(path, place)
        self.is_stale = False
        return None

    def binary(self) -> str:
        """Return a digest of the compiled extensions."""
        paths = sorted((self.folder / "pyharness").glob("_*.so"))
        return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()

    def _synchronise(self) -> None:
        listed = subprocess.run(
            ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT, capture_output=True, text=True, check=True,
        ).stdout.splitlines()  # fmt: skip
        wanted = {Path(name) for name in listed if (ROOT / name).is_file()}
        for name in wanted:
            here, place = ROOT / name, self.folder / name
            if not place.exists() or here.read_bytes() != place.read_bytes():
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(here, place)
        kept = {"build", ".hypothesis", "__pycache__"}
        for place in list(self.folder.rglob("*")):
            name = place.relative_to(self.folder)
            made = name.suffix == ".so" or name.name == "_build.py" or kept & {*name.parts}
            if place.is_file() and name not in wanted and not made:
                place.unlink()
