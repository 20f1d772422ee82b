"""The process of a port or integrator, which answers each line in limited time."""

import contextlib
import os
import select
import shlex
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Self

from pyharness.model.errors import InputError, printable

PATIENCE = 60.0  # s, enough for an interpreter that compiles first
_LARGEST = 1 << 26  # most bytes of an answer
_PIECE = 1 << 16
_TO_END = 1.0  # time (s) in which a process must end after it closed its input or output
# Number of searches for child processes, and of reads of the last output.
_ROUNDS = 100
_PROBE = 10.0  # time limit (s) for one request of the other protocol
_EXAMPLES = {"--port": "node web/port.js", "--integrator": "python3 mine.py", "--new": "./mine"}
_MARK = "PYHARNESS_PORT"  # environment variable that marks each process of a port


class PortError(Exception):
    """A port or integrator gave no valid answer; the message is one line."""


def split_command(command: str, option: str = "--port") -> list[str]:
    """Return program and arguments, split as by a shell, or raise an InputError naming `option`."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(
            f"{option} {command}: {error}; allowed: a command, as for a shell"
        ) from None
    if not words or not words[0] or "\0" in command:
        example = _EXAMPLES[option]
        raise InputError(f"{option}: no command is given; give one, as in {option} '{example}'")
    return words


def refuse_other(
    command: str, option: str, instead: str, line: bytes, read: Callable[[bytes], object]
) -> None:
    """Raise an InputError that advises option `instead` if `command` answers its request `line`."""
    with contextlib.suppress(PortError), PortProcess(command, _PROBE, option) as process:
        read(process.ask(line))
        raise InputError(
            f"{option} {command}: the command answers requests of {instead}; use {instead}"
        )


def _processes_with(mark: str) -> list[int]:
    """Return the ids of processes with `mark` in their environment; none without /proc."""
    found = []
    for folder in Path("/proc").glob("[1-9]*"):
        # The process may have ended, or belong to another user.
        with contextlib.suppress(OSError):
            if mark.encode() in (folder / "environ").read_bytes().split(b"\0"):
                found.append(int(folder.name))
    return found


class PortProcess:
    """A port's process as a context manager; entering raises PortError if it cannot start."""

    def __init__(
        self,
        command: str | Sequence[str],
        patience: float = PATIENCE,
        option: str = "--port",
        folder: Path | None = None,
    ) -> None:
        self._words = split_command(command, option) if isinstance(command, str) else [*command]
        self._patience = patience
        self._folder = folder

    def __enter__(self) -> Self:
        """Start the port in its own process group, so that child processes can be ended too."""
        self._mark = f"{_MARK}={os.urandom(16).hex()}"
        self._told = b""  # end of the output to stderr
        try:
            self._process = subprocess.Popen(
                self._words,
                bufsize=0,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
                cwd=self._folder,
                env={**os.environ, _MARK: self._mark.removeprefix(f"{_MARK}=")},
            )
        except OSError as error:
            raise PortError(f"'{self._words[0]}' can't be started: {error.strerror}") from None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        self._in, self._out = self._process.stdin, self._process.stdout
        self._errors = self._process.stderr
        self._heard = [self._errors]  # empty once stderr is closed
        os.set_blocking(self._in.fileno(), False)
        os.set_blocking(self._errors.fileno(), False)
        return self

    def __exit__(self, *error: object) -> None:
        # All processes may have ended; macOS then raises PermissionError.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        # A process that left the group may be starting another.
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
        """Send a request and return the answer, both without line feed.

        Raise PortError unless one line of limited length comes in time.
        """
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

    def read_all(self, content: bytes) -> bytes:
        """Send `content`, close the input, and return all output of a program that ends in time."""
        end = time.monotonic() + self._patience
        found, is_open = bytearray(), True
        while True:
            if is_open and not content:
                self._in.close()
                is_open = False
            writers = [self._in] if is_open else []
            left = max(end - time.monotonic(), 0.0)
            ready, writable, _ = select.select([self._out, *self._heard], writers, [], left)
            if not left or not (ready or writable):
                raise PortError(f"it did not end within {self._patience:g} s")
            if self._errors in ready:
                self._hear()
            if writable:
                try:
                    content = content[os.write(self._in.fileno(), content[:_PIECE]) :]
                except BrokenPipeError:  # it need not read its input
                    content = b""
            if self._out in ready:
                piece = os.read(self._out.fileno(), _PIECE)
                if not piece:
                    break
                found += piece
                if len(found) > _LARGEST:
                    raise PortError(f"more than {_LARGEST >> 20} MB for one run")
        try:
            code = self._process.wait(max(end - time.monotonic(), _TO_END))
        except subprocess.TimeoutExpired:
            raise PortError(f"it did not end within {self._patience:g} s") from None
        if code:
            raise PortError(self._ending())
        return bytes(found)

    def _hear(self) -> bool:
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
        # The ended process may have left output; a child process may continue to write.
        for _ in range(_ROUNDS):
            if not self._hear():
                break
        said = self._told.decode(errors="replace").split("\n")
        told = [printable(each.strip()) for each in said if each.strip()]
        # Some interpreters print their version after the error.
        told = [each for each in told if "rror" in each] or told
        return f"it ended {how} before it had answered{f': {told[-1][:200]}' if told else ''}"
