"""The guide to ports: its commands run, and its outputs and numbers are current."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pyharness.checks.plants.port_plants import PLANTS
from pyharness.thesis.cells import all_cells
from tests.checks.test_port_in_c import FAULTS, SOURCE
from tests.conftest import ResultOf
from tests.ports import ROOT, TEMPLATE, compiled_port, engine

GUIDE = (ROOT / "docs/how-to/ports.md").read_text()
# The first command checks all cells, as the tests of the ports do in parts.
COMMANDS = re.findall(r"```sh\n(.*?)```", GUIDE, re.DOTALL)[1:]


@pytest.mark.campaign
@pytest.mark.external
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_the_guide_runs(command: str, tmp_path: Path) -> None:
    """The commands run in a folder that has the parts of the checkout which they name."""
    engine()
    for name in ("docs", "verify-port", "web"):
        (tmp_path / name).symlink_to(ROOT / name)
    # Without the variables by which pytest-xdist and GitHub tell a process of themselves.
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTEST_", "GITHUB_"))}
    tools = tmp_path / "tools"
    tools.mkdir()
    for name in ("python", "python3"):
        (tools / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
        (tools / name).chmod(0o755)
    done = subprocess.run(
        ["sh", "-e", "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**kept, "PATH": f"{tools}:{os.environ['PATH']}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"all well|each noticed", done.stdout)
    for name in re.findall(r"[\w.]+\.(?:md|xml|json)\b", command.partition("--also")[2]):
        assert (tmp_path / name).stat().st_size > 100


def test_the_guide_has_commands_of_each_part() -> None:
    for part in ("--draws", "--self-test", "--also", "verify-port.sh", "make -C"):
        assert any(part in command for command in COMMANDS), part


@pytest.mark.external
def test_the_failure_in_the_guide_is_that_of_today(tmp_path: Path, result_of: ResultOf) -> None:
    """The port in C computes 2 k2 + 2 k3, as the guide describes it."""
    (fault,) = [each for each in FAULTS if "both middle rates separately" in each["what"]]
    command = compiled_port(tmp_path, SOURCE.replace(fault["from"], fault["to"]))
    cell = "runge-kutta/case-2/original"
    printed = result_of(["verify", "--port", command, "--cell", cell], 1).out
    (table,) = re.findall(rf"```\n(port/{cell}, step .*?)```", GUIDE, re.DOTALL)
    assert table in printed
    (failure,) = re.findall(rf"```\nFAILED port/{cell} (.*?)\n  python", GUIDE, re.DOTALL)
    found = " ".join(printed.split())
    assert " ".join(failure.split()).partition("(derived; first")[2] in found


def test_the_numbers_in_the_guide_are_those_of_today() -> None:
    assert f"There are {len(list(all_cells()))} cells" in GUIDE
    assert f"It plants {len(PLANTS)} faults" in GUIDE
    assert f"plant {len(FAULTS)} faults of one line" in GUIDE


def test_the_guide_names_every_input_and_option() -> None:
    action = (ROOT / "verify-port/action.yml").read_text()
    inputs = re.findall(r"^  (\w+):\n    description", action, re.MULTILINE)
    assert len(inputs) == 5
    assert all(f"| `{name}` | " in GUIDE for name in inputs)
    for name in ("port.c", "Makefile", ".github/workflows/verify.yml"):
        assert (TEMPLATE / name).is_file()
        assert f"| `{name}` | " in GUIDE
