"""The plugin of pytest: one test for each cell of a port, readable failures, no cost otherwise."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.ports import answering, documented, documented_command

CELL = "two-term/case-2/original"
BIT = "import math; rows[6][2] = math.nextafter(float.fromhex(rows[6][2]), math.inf).hex()"


def _pytest(folder: Path, *words: str, plugin: str = "") -> tuple[int, str]:
    """Run pytest in a folder of its own; return its exit status and its output."""
    loaded = ["-p", plugin] if plugin else []
    python = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "no:zarr"]
    done = subprocess.run(
        [*python, *loaded, *words],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


_WATCH = """
import sys
def pytest_sessionfinish():
    found = [name for name in sys.modules if name.split('.')[0] in ('numpy', 'pyharness')]
    print('imported:', sorted(found))
"""


@pytest.fixture(autouse=True)
def _installed() -> None:
    from importlib.metadata import entry_points

    if "pyharness" not in {each.name for each in entry_points(group="pytest11")}:
        pytest.skip("the package is not installed with the entry point of its plugin")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a test of its own."""
    found = tmp_path / "tests"
    found.mkdir()
    (found / "test_own.py").write_text("def test_own():\n    pass\n")
    return found


def test_each_cell_is_a_test_beside_those_of_the_folder(folder: Path) -> None:
    port = f"--pyharness-port={documented_command()}"
    status, printed = _pytest(folder, "-v", port, "--pyharness-cells", "two-term/case-2")
    assert status == 0
    assert f"pyharness-port::{CELL} PASSED" in printed
    assert "test_own.py::test_own PASSED" in printed
    assert "33 passed" in printed
    status, printed = _pytest(folder, port, "-k", "pyharness-port and corrected and case-3")
    assert status == 0
    assert re.search(r"3 passed, 23\d\d deselected", printed)


def test_a_failure_has_the_difference_the_values_and_the_command(folder: Path) -> None:
    command = answering(folder / "port.py", BIT)
    report = folder / "junit.xml"
    status, printed = _pytest(
        folder, f"--pyharness-port={command}", "--pyharness-cells", CELL, f"--junit-xml={report}"
    )
    assert status == 1
    assert "1 failed, 1 passed" in printed
    assert f"port/{CELL}: first at step 7, U2: 1 ulp (0x" in printed
    assert re.search(r"^U2 +rad/s +\S+ +\S+ +1$", printed, re.MULTILINE)
    assert re.search(r"^V3 +m/s +\S+ +\S+ +0$", printed, re.MULTILINE)
    replay = f"python -m pyharness verify --port {shlex.quote(command)} --cell {CELL}"
    assert replay in printed
    assert "Traceback" not in printed
    (failure,) = ElementTree.parse(report).iter("failure")
    assert replay in str(failure.text)


def test_the_tests_after_an_invalid_answer_are_skipped(folder: Path) -> None:
    """A port that does not answer would take a minute in each test."""
    command = answering(folder / "port.py", "del rows[50:]")
    status, printed = _pytest(
        folder, "-rs", f"--pyharness-port={command}", "--pyharness-cells", "two-term/case-2"
    )
    assert status == 1
    assert "1 failed, 1 passed, 31 skipped" in printed
    assert "50 rows of a run of 100 steps that ended 'complete'" in printed
    assert "the port gave no valid answer in two-term/case-2/" in printed


def test_random_scenes_are_tests_too(folder: Path) -> None:
    words = ["--pyharness-cells=random", "--pyharness-draws=4", "--pyharness-seed=here"]
    port = f"--pyharness-port={documented_command()}"
    status, printed = _pytest(folder, "--collect-only", "-q", port, *words)
    assert status == 0
    assert "5 tests collected" in printed
    assert len(re.findall(r"^pyharness-port::random/[0-3]/", printed, re.MULTILINE)) == 4


def test_each_worker_starts_the_port_once(folder: Path) -> None:
    """The port writes a line to a file when it starts."""
    pytest.importorskip("xdist")
    path = folder / "port.py"
    started = folder / "started"
    path.write_text(
        f"import os\nopen({str(started)!r}, 'a').write(f'{{os.getpid()}}\\n')\n{documented()}"
    )
    command = shlex.join([sys.executable, str(path)])
    cells = "--pyharness-cells=two-term/case-2,four-term/case-2"
    status, printed = _pytest(
        folder, "-n", "2", "--dist", "load", f"--pyharness-port={command}", cells
    )
    assert status == 0, printed
    assert "41 passed" in printed
    assert len(started.read_text().split()) == 2
    started.unlink()
    status, printed = _pytest(folder, f"--pyharness-port={command}", cells)
    assert status == 0
    assert len(started.read_text().split()) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--pyharness-port="], "--pyharness-port: no command is given"),
        (["--pyharness-port=x", "--pyharness-cells=nope"], "--pyharness-cells nope: there is no"),
        (["--pyharness-port=x", "--pyharness-draws=y"], "--pyharness-draws: 'y' where a whole"),
        (["--pyharness-draws=3"], "--pyharness-draws has no meaning without --pyharness-port"),
    ],
)
def test_mistakes_are_a_line(words: list[str], message: str, folder: Path) -> None:
    status, printed = _pytest(folder, *words)
    assert status == 4
    assert f"ERROR: {message}" in printed
    assert "Traceback" not in printed


def test_the_plugin_costs_nothing_without_its_option(folder: Path) -> None:
    """Neither NumPy nor another module of the package is imported."""
    (folder / "watch.py").write_text(_WATCH)
    status, printed = _pytest(folder, "-s", plugin="watch")
    assert status == 0
    assert "imported: ['pyharness', 'pyharness.pytest_plugin']" in printed
    port = f"--pyharness-port={documented_command()}"
    _, printed = _pytest(folder, "-s", port, "--pyharness-cells", CELL, plugin="watch")
    assert "'numpy'" in printed
