"""Commands interrupted or killed at random: ``python -m tests.cli.interrupts 300 [--kill]``."""

import contextlib
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.sweep.sweeps import text

_PATIENCE = 20.0  # s, within which an interrupted command must end
_MOURNING = 10.0  # s, within which the workers of a killed command must end
# Long enough for every trial, with chunks short enough that each is soon written.
SWEEP = text(
    '[[axis]]\nfield = "tilt"\nfrom = 0.1\nto = 1.0\ncount = 100',
    '[[axis]]\nfield = "omega.magnitude"\nfrom = 1.0\nto = 2.0\ncount = 10000',
    top='chunk = 1000\nreductions = ["end", { name = "flips", samples = 50 }]',
)
EXECUTORS = ("here", "processes", "dask")


class Trial(NamedTuple):
    """The outcome of a trial: the command, the time of the signal (s), and any fault."""

    verb: str
    moment: float
    to_group: bool
    outcome: str
    errors: str


def commands(folder: Path) -> dict[str, list[str]]:
    """Return the commands by name."""
    (folder / "sweep.toml").write_text(SWEEP)
    found = {"compare": ["compare", "--case", "3"], "verify": ["verify"]}
    for executor in EXECUTORS:
        found[executor] = ["sweep", str(folder / "sweep.toml"), "--executor", executor]
        if executor != "here":
            found[executor] += ["--workers", "2"]
    return found


@contextlib.contextmanager
def hearing() -> Iterator[None]:
    """Let commands started meanwhile receive Ctrl-C, even if this process ignores it.

    A shell starts background jobs with Ctrl-C ignored.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def interrupted(
    verb: str, arguments: list[str], moment: float, to_group: bool, sent: signal.Signals
) -> Trial:
    """Start a command, send it a signal after `moment` seconds, and return the outcome."""
    with tempfile.TemporaryDirectory() as folder:
        if verb in EXECUTORS:
            arguments = [*arguments, "--out", str(Path(folder) / "store")]
        with hearing():
            process = subprocess.Popen(
                [sys.executable, "-m", "pyharness", *arguments],
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
            )  # fmt: skip
        time.sleep(moment)
        was_running = process.poll() is None
        if was_running:
            (os.killpg if to_group else os.kill)(process.pid, sent)
        try:
            _, errors = process.communicate(timeout=_PATIENCE)
            outcome = _judged(process.returncode, errors, was_running, sent)
        except subprocess.TimeoutExpired:
            outcome, errors = "LOST", ""
        if outcome != "LOST" and (left := left_behind(process.pid)):
            outcome = f"LEFT {' '.join(map(str, left))}"
        _end(process.pid)
        process.communicate()
        return Trial(verb, moment, to_group, outcome, errors)


def _judged(code: int, errors: str, was_running: bool, sent: signal.Signals) -> str:
    if not was_running:
        return "had ended" if code == 0 else f"CODE {code} by itself"
    if sent == signal.SIGKILL:
        return "killed" if code == -signal.SIGKILL else f"CODE {code}"
    # Until the interpreter has read the first file of this project, the project can't handle the
    # signal. The process then dies by the signal, or with an error that names no file of the
    # project.
    if code == -signal.SIGINT and not errors:
        return "interpreter's"
    if "Traceback" in errors or "KeyboardInterrupt" in errors:
        ours = re.search(r'File ".*/pyharness/[\w/]+\.py"', errors)
        return "TRACEBACK" if ours else "interpreter's"
    # The forecast of a sweep is a line by itself.
    lines = [line for line in errors.splitlines() if " scenes in " not in line]
    if code == 130 and lines == ["pyharness: interrupted"]:
        return "interrupted"
    return f"CODE {code}, {len(lines)} lines"


def left_behind(session: int) -> list[int]:
    """Return the processes of a session that are still alive after a grace period."""
    end = time.monotonic() + _MOURNING
    while (left := _members(session)) and time.monotonic() < end:
        time.sleep(0.05)
    return left


def _members(session: int) -> list[int]:
    found = subprocess.check_output(["ps", "-eo", "pid=,sess=,stat="], text=True)
    rows = (line.split() for line in found.splitlines())
    return [int(pid) for pid, sess, state in rows if int(sess) == session and state[0] != "Z"]


def _end(session: int) -> None:
    for pid in _members(session):
        if os.getpgid(pid) == session:
            os.kill(pid, signal.SIGKILL)


def trials(
    count: int, longest: float, seed: int, sent: signal.Signals, verbs: list[str]
) -> Iterator[Trial]:
    """Yield trials with the signal sent at random times from 0 to `longest` seconds."""
    draw = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        every = commands(Path(folder))
        for i in range(count):
            verb = verbs[i % len(verbs)]
            # A terminal sends Ctrl-C to all processes of the group; `kill` sends a signal to one.
            to_group = sent == signal.SIGINT and draw.random() < 0.5
            yield interrupted(verb, every[verb], draw.uniform(0.0, longest), to_group, sent)


def main() -> int:
    """Run trials, print each that went wrong, and count the outcomes."""
    numbers = [int(each) for each in sys.argv[1:] if each != "--kill"]
    count, seed = (*numbers, *(300, 1)[len(numbers) :])
    sent = signal.SIGKILL if "--kill" in sys.argv else signal.SIGINT
    found: Counter[tuple[str, str]] = Counter()
    for each in trials(count, 4.0, seed, sent, ["compare", "verify", *EXECUTORS]):
        found[each.verb, each.outcome.split()[0]] += 1
        if each.outcome[:2].isupper():
            print(f"{each.verb} at {each.moment:.3f} s, group {each.to_group}: {each.outcome}")
            print(each.errors[-3000:], flush=True)
    print(*sorted(found.items()), sep="\n")
    return int(any(outcome[:2].isupper() for _, outcome in found))


if __name__ == "__main__":
    sys.exit(main())
