"""Ctrl-C and SIGKILL at any time: one line, exit code 130, nothing left behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.cli.interrupts import SWEEP, hearing, left_behind, trials
from tests.tables import tables

# A command that interrupts itself; `body` is one of the ways in which an interrupt can get lost.
SCRIPT = """
import os, signal, sys, time
from pyharness.cli import interruption, main

def interrupt():
    os.kill(os.getpid(), signal.SIGINT)

def waited():
    time.sleep(5.0)
    print("went on")
    return 0

class Finalized:
    def __del__(self):
        interrupt()

def command(arguments=None):
    {body}

interruption.leave_when_interrupted()
main._run = command
code = interruption.run_interruptible(main.main)
print("code", code)
interruption.leave(code)
"""
LOST = tables(__file__)["lost"]


def python(*arguments: str, **more: Any) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, **more)


def run_script(body: str) -> "subprocess.CompletedProcess[str]":
    with hearing():
        return python("-c", SCRIPT.format(body=body), timeout=60.0)


@pytest.mark.parametrize("name", LOST)
def test_interrupt_is_not_lost(name: str) -> None:
    found = run_script(LOST[name])
    assert (found.returncode, found.stderr) == (130, "pyharness: interrupted\n")
    assert "went on" not in found.stdout


def test_what_tidies_up_is_not_interrupted_again() -> None:
    body = "try: interrupt()\n    finally:\n        time.sleep(1.0)\n        print('tidy')"
    found = run_script(body)
    assert found.stdout.split() == ["tidy", "code", "130"]
    assert found.stderr == "pyharness: interrupted\n"


def test_third_interrupt_waits_for_nothing() -> None:
    body = (
        "for _ in range(2):\n        try: interrupt()\n        except BaseException: pass\n"
        "    try: raise KeyboardInterrupt\n    except BaseException:\n"
        "        interrupt(); waited()"
    )
    found = run_script(body)
    assert (found.returncode, found.stdout) == (130, "")
    assert found.stderr == "pyharness: interrupted\n"


def test_interrupt_that_the_caller_ignores_stays_ignored() -> None:
    deaf = "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); "
    deaf += "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
    found = python("-c", deaf, "-c", SCRIPT.format(body="interrupt(); return 0"))
    assert (found.stdout, found.stderr) == ("code 0\n", "")


def test_what_is_left_to_the_resource_tracker_is_removed_without_a_word() -> None:
    script = (
        "import os\n"
        "from multiprocessing import get_context, resource_tracker\n"
        "from pyharness.sweep import executors\n"
        "def interrupted(*_):\n"
        "    print(get_context('spawn').Lock()._semlock.name)\n"
        "    resource_tracker.register('/mp-none-of-this-name', 'semaphore')\n"
        "    os._exit(130)\n"
        "executors.ProcessPoolExecutor = interrupted\n"
        "next(executors._by_pool(None, [], 1))"
    )
    # The resource tracker keeps the streams open, so that its last message is captured too.
    found = python("-u", "-c", script)
    assert (found.returncode, found.stderr) == (130, "")
    assert not Path(f"/dev/shm/sem.{found.stdout.strip().removeprefix('/')}").exists()


# A command that interrupts itself when it begins to import a module.
IMPORTS = """
import os, runpy, sys
_, module, *sys.argv[1:] = sys.argv

def interrupt(event, given):
    if event == "import" and given[0] == module:
        os.kill(os.getpid(), 2)

sys.addaudithook(interrupt)
runpy.run_module("pyharness", run_name="__main__", alter_sys=True)
"""


@pytest.mark.parametrize(
    "module", ["typing", "enum", "pyharness.cli", "argparse", "numpy", "numpy.random"]
)
def test_interrupt_during_an_import_ends_in_a_line(module: str) -> None:
    """Without -S, the interpreter itself imports the first two modules for an editable install."""
    bare = ["-S"] if module in {"typing", "enum"} else []
    with hearing():
        found = python(
            *bare, "-c", IMPORTS, module, "compare", "--case", "3", "--numerics",
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]) if bare else ""},
        )  # fmt: skip
    assert (found.returncode, found.stdout) == (130, "")
    assert found.stderr == "pyharness: interrupted\n"


@pytest.mark.campaign
def test_commands_interrupted_at_random_moments_end_in_a_line() -> None:
    verbs = ["compare", "verify", "here", "processes", "dask"]
    for each in trials(5, 4.0, 2, signal.SIGINT, verbs):
        assert each.outcome in ("interrupted", "interpreter's", "had ended"), each


@pytest.mark.campaign
@pytest.mark.parametrize("executor", ["processes", "dask"])
def test_workers_end_with_the_process_that_started_them(executor: str, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    (tmp_path / "sweep.toml").write_text(SWEEP)
    command = ["sweep", str(tmp_path / "sweep.toml"), "--out", str(tmp_path / "store")]
    process = subprocess.Popen(
        [sys.executable, "-m", "pyharness", *command, "--executor", executor, "--workers", "2"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    try:
        end = time.monotonic() + 120.0
        while not (tmp_path / "store" / "checksums" / "c").exists():
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.05)
    finally:
        process.kill()
        process.wait()
    left = left_behind(process.pid)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    assert left == []
