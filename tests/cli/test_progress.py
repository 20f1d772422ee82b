"""The progress bar: on a terminal alone, within its width, with the time to go, and removed."""

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from threading import Thread

import pytest

pytestmark = pytest.mark.campaign
_COLUMNS = 60


def _on_a_terminal(*arguments: str) -> tuple[str, str]:
    """Return what a command writes to standard output, and to a terminal as standard error."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, _COLUMNS, 0, 0))
    command = [sys.executable, "-m", "pyharness", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs)
    os.close(theirs)
    parts: list[bytes] = []

    def read() -> None:
        try:
            while part := os.read(ours, 4096):
                parts.append(part)
        except OSError:  # the other end is closed
            pass

    reader = Thread(target=read)
    reader.start()
    out, _ = process.communicate(timeout=120.0)
    reader.join()
    os.close(ours)
    assert process.returncode == 0
    return out.decode(), b"".join(parts).decode()


@pytest.mark.parametrize("command", ["verify --only orders,schemes", "stress --only regions"])
def test_bar_is_within_the_terminal_and_removed(command: str) -> None:
    out, seen = _on_a_terminal(*command.split())
    assert out
    assert "\n" not in seen
    states = [each for each in re.split(r"\r|\x1b\[A", seen) if each.strip()]
    assert any("%|" in each for each in states)
    assert any(re.search(r"\d\d:\d\d<", each) for each in states)
    assert max(map(len, states)) <= _COLUMNS
    # The last that is written are blanks over the bar.
    assert re.search(r"\r *\r$", seen)


def test_nothing_is_shown_without_a_terminal() -> None:
    command = [sys.executable, "-m", "pyharness", "verify", "--only", "orders"]
    assert subprocess.run(command, capture_output=True, check=True).stderr == b""
