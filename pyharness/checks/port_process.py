"""A port as a process: a line in, a line out, each within a time limit, and always ended."""

import contextlib
import os
import select
import shlex
import signal
import subprocess
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from pyharness.model.errors import InputError, printable

PATIENCE = 60.0  # s for a run, the start of an interpreter that compiles included
_LARGEST = 1 << 26  # bytes of an answer
_PIECE = 1 << 16
_TO_END = 1.0  # s to end, once the output is closed
# Of looking for what a port started, and of reading what it has left: each has an end.
_ROUNDS = 100
_MARK = "PYHARNESS_PORT"  # of every process that a port starts, in its environment


class PortError(Exception):
    """What a port did that is no answer, in a line."""


def split_command(command: str) -> list[str]:
    """Return the words of a command, as a shell has them; InputError where there is none."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(f"--port {command}: {error}") from None
    if not words or not words[0] or "\0" in command:
        raise InputError("--port: no command; give one, as in --port 'node web/port.js'")
    return words


def _processes_with(mark: str) -> list[int]:
    """Return the processes alive with `mark` in their environment; none where there is no /proc."""
    found = []
    for folder in Path("/proc").glob("[1-9]*"):
        # One may have ended meanwhile, or be another user's. One that has ended, and waits for its
        # parent, has no environment any more.
        with contextlib.suppress(OSError):
            if mark.encode() in (folder / "environ").read_bytes().split(b"\0"):
                found.append(int(folder.name))
    return found


class PortProcess:
    """A port from its start to its end, as a context; PortError where it can't be started."""

    def __init__(self, command: str, patience: float = PATIENCE) -> None:
        """Say what to start, and how long to wait for an answer (s)."""
        self._words = split_command(command)
        self._patience = patience

    def __enter__(self) -> Self:
        """Start it, in a group of its own: a shell's children end with it."""
        self._mark = f"{_MARK}={os.urandom(16).hex()}"
        self._told = b""  # the last of what it wrote to stderr
        try:
            self._process = subprocess.Popen(
                self._words,
                bufsize=0,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
                env={**os.environ, _MARK: self._mark.removeprefix(f"{_MARK}=")},
            )
        except OSError as error:
            raise PortError(f"'{self._words[0]}' can't be started: {error.strerror}") from None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        self._in, self._out = self._process.stdin, self._process.stdout
        self._errors = self._process.stderr
        self._heard = [self._errors]  # empty once it is closed
        os.set_blocking(self._in.fileno(), False)
        os.set_blocking(self._errors.fileno(), False)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End it and all that it started, whatever they are doing."""
        # Where all of the group have ended there is none; macOS says so by the second.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        # One that has left the group, for a session of its own; it may be starting another.
        for _ in range(_ROUNDS):
            marked = _processes_with(self._mark)
            if not marked:
                break
            for each in marked:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(each, signal.SIGKILL)
            time.sleep(0.01)
        self._process.wait()
        for file in (self._in, self._out, self._errors):
            file.close()

    def ask(self, line: bytes) -> bytes:
        """Return the line that answers a line; PortError where none comes, or more than one."""
        end = time.monotonic() + self._patience
        rest = line + b"\n"
        found = bytearray()
        answered = False
        while rest or not answered:
            writers = [self._in] if rest else []
            left = max(end - time.monotonic(), 0.0)
            readers = [self._out, *self._heard]
            readable, writable, _ = select.select(readers, writers, [], left)
            if not left or not (readable or writable):
                raise PortError(f"no answer within {self._patience:g} s")
            if self._errors in readable:
                self._hear()
            if writable:
                try:
                    rest = rest[os.write(self._in.fileno(), rest[:_PIECE]) :]
                except BrokenPipeError:
                    raise PortError(self._ending()) from None
            if self._out in readable:
                piece = os.read(self._out.fileno(), _PIECE)
                if not piece:
                    raise PortError(self._ending())
                found += piece
                answered = answered or b"\n" in piece
                if len(found) > _LARGEST:
                    raise PortError(f"more than {_LARGEST >> 20} MB for one run")
        answer, _, more = bytes(found).partition(b"\n")
        if more:
            raise PortError("more than one line for one run")
        return answer

    def _hear(self) -> bool:
        """Read what comes from stderr, and keep the last of it; whether there was anything."""
        try:
            piece = os.read(self._errors.fileno(), _PIECE)
        except BlockingIOError:
            return False
        if not piece:
            self._heard = []
        self._told = (self._told + piece)[-_PIECE:]
        return bool(piece)

    def _ending(self) -> str:
        try:
            code = self._process.wait(_TO_END)
        except subprocess.TimeoutExpired:
            return "it closed its input or output before it had answered"
        how = f"by signal {-code}" if code < 0 else f"with exit code {code}"
        # What is still in the pipe, once its writer has ended; a child of it may go on writing.
        for _ in range(_ROUNDS):
            if not self._hear():
                break
        said = self._told.decode(errors="replace").split("\n")
        told = [printable(each.strip()) for each in said if each.strip()]
        # The last that names an error: some interpreters say their version after it.
        told = [each for each in told if "rror" in each] or told
        return f"it ended {how} before it had answered{f': {told[-1][:200]}' if told else ''}"
