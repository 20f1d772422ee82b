"""The port in C, a template: its bits in cells and random scenes, and faults of one line in it."""

import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from pyharness.checks.port import port, random_cells
from tests.ports import C_FLAGS, TEMPLATE, compiled_port, sample

TABLES = tomllib.loads(Path(__file__).with_name("port_in_c.toml").read_text())
FAULTS = [
    {"what": what, "cell": cell, "seen": seen, "from": texts[0], "to": texts[1]}
    for cell, results in TABLES.items()
    for seen, faults in results.items()
    for what, texts in faults.items()
]
SOURCE = (TEMPLATE / "port.c").read_text()
SEED = "port"
pytestmark = pytest.mark.external


@pytest.mark.campaign
def test_the_port_in_c_has_the_twins_bits(tmp_path: Path) -> None:
    """The C library of the port has the same sines and cosines as Python."""
    command = compiled_port(tmp_path)
    cells = [*sample(), *sample(["two-term/case-7", "four-term"]), *random_cells(SEED, 150)]
    checks = list(port(command, cells))
    assert len(checks) == len(cells) > 250
    assert [(check.id, check.note) for check in checks if not check.passed] == []


def test_the_makefile_compiles_the_port_without_a_warning(tmp_path: Path) -> None:
    if shutil.which("make") is None:
        pytest.skip("no make on the PATH")
    folder = shutil.copytree(TEMPLATE, tmp_path / "port", ignore=shutil.ignore_patterns("port"))
    done = subprocess.run(["make"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert all(flag in done.stdout for flag in C_FLAGS)
    checks = list(port(shlex.quote(str(folder / "port")), sample()[:2]))
    assert all(check.passed for check in checks)


def test_the_port_is_short() -> None:
    lines = SOURCE.splitlines()
    assert len(lines) <= 350
    assert max(map(len, lines)) <= 100


def test_the_port_refuses_another_schema(tmp_path: Path) -> None:
    done = subprocess.run(
        [compiled_port(tmp_path)], input='{"schema": 2}\n', capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "port: error: this port reads only 'schema 1'\n"


def test_there_are_many_faults_of_all_programs() -> None:
    assert len(FAULTS) >= 40
    assert len({fault["what"] for fault in FAULTS}) == len(FAULTS)
    assert {fault["seen"] for fault in FAULTS} >= {"TIME", "U1", "U2", "V1", "V2", "V3", "IER"}
    # No cell shows that the velocity is tested first.
    assert any(fault["cell"].startswith("random/") for fault in FAULTS)


@pytest.mark.sampled
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault["what"])
def test_a_fault_of_one_line_is_found_where_it_is(fault: dict[str, str], tmp_path: Path) -> None:
    assert SOURCE.count(fault["from"]) == 1
    command = compiled_port(tmp_path, SOURCE.replace(fault["from"], fault["to"]))
    name = fault["cell"]
    cells = random_cells(SEED, 0, [name]) if name.startswith("random/") else sample([name])
    (check,) = port(command, [cell for cell in cells if cell.name == name])
    assert not check.passed
    assert check.id == f"port/{name}"
    found = re.match(r"(?:first at step \d+, )?(\w+)", check.note)
    assert found is not None
    assert found[1] == fault["seen"]
