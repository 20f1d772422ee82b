"""The Action that checks a port: its script, its inputs, and the workflow of the template."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from tests.ports import TEMPLATE, answering, compiled_port

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "verify-port"
SCRIPT = FOLDER / "verify-port.sh"
ACTION = yaml.safe_load((FOLDER / "action.yml").read_text())
WORKFLOW = TEMPLATE / ".github/workflows/verify.yml"
CELL = "two-term/case-2/original"


def _run(folder: Path, **given: str) -> subprocess.CompletedProcess[str]:
    """Run the script in a folder, with the variables `given` added to the environment."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PORT_", "GITHUB_"))}
    return subprocess.run(
        [SCRIPT], cwd=folder, env={**environment, "PYTHON": sys.executable, **given},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.campaign
@pytest.mark.external
def test_the_script_checks_the_port_in_c(tmp_path: Path) -> None:
    """The summary is added to that of the job, and all reports are of the same run."""
    port = compiled_port(tmp_path)
    summary = tmp_path / "step"
    summary.write_text("before\n")
    done = _run(
        tmp_path, PORT_COMMAND=port, PORT_CELLS="runge-kutta/case-3,random", PORT_DRAWS="7",
        PORT_SEED="a b", GITHUB_STEP_SUMMARY=str(summary),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    reports = tmp_path / "port-reports"
    page = (reports / "summary.md").read_text()
    assert page.startswith("## verify --port: 263 checks, all well\n")
    assert summary.read_text() == f"before\n{page}"
    record = json.loads((reports / "report.json").read_text())
    assert (record["seed"], len(record["checks"]), record["passed"]) == ("a b", 263, True)
    assert ElementTree.parse(reports / "junit.xml").getroot().get("tests") == "263"


@pytest.mark.campaign
def test_a_wrong_port_ends_with_1_and_has_its_reports(tmp_path: Path) -> None:
    command = answering(tmp_path / "port.py", "rows[2][1] = 1")
    done = _run(tmp_path, PORT_COMMAND=command, PORT_CELLS=CELL, PORT_REPORTS="a folder/reports")
    assert done.returncode == 1
    reports = tmp_path / "a folder/reports"
    assert "first at step 3, U1" in (reports / "summary.md").read_text()
    assert ElementTree.parse(reports / "junit.xml").getroot().get("failures") == "1"


@pytest.mark.campaign
@pytest.mark.parametrize(("given", "message"), [
    ({"PORT_COMMAND": ""}, "--port: no command is given"),
    ({}, "--port: no command is given"),
    ({"PORT_COMMAND": "cat", "PORT_CELLS": "--help"}, "--cell --help: there is no such cell"),
    ({"PORT_COMMAND": "cat", "PORT_DRAWS": "$(touch made)"}, "--draws: '$(touch made)' where"),
    ({"PORT_COMMAND": "cat", "PORT_CELLS": "x; touch made"}, "--cell x; touch made: there is"),
])  # fmt: skip
def test_values_are_never_read_by_a_shell(
    given: dict[str, str], message: str, tmp_path: Path
) -> None:
    """The exit status is 2, and no report of an earlier run is left."""
    (tmp_path / "port-reports").mkdir()
    (tmp_path / "port-reports/summary.md").write_text("old")
    done = _run(tmp_path, GITHUB_STEP_SUMMARY=str(tmp_path / "step"), **given)
    assert done.returncode == 2
    assert done.stderr.startswith(f"pyharness: {message}")
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.rglob("*")] == ["port-reports"]


@pytest.mark.campaign
def test_a_command_is_not_read_by_a_shell(tmp_path: Path) -> None:
    assert _run(tmp_path, PORT_COMMAND="true; touch made", PORT_CELLS=CELL).returncode == 1
    assert not (tmp_path / "made").exists()


def _steps(node: Any) -> list[dict[str, Any]]:
    return [*node["runs"]["steps"]]


def test_inputs_reach_the_script_by_variables_alone() -> None:
    script = SCRIPT.read_text()
    assert set(ACTION["inputs"]) >= {"command", "cells", "draws", "seed"}
    (step,) = [each for each in _steps(ACTION) if "verify-port.sh" in each.get("run", "")]
    wanted = {f"PORT_{name.upper()}": f"${{{{ inputs.{name} }}}}" for name in ACTION["inputs"]}
    assert step["env"] == wanted
    for variable in wanted:
        assert f"${{{variable}:-" in script
        assert f"#   {variable} " in script
    assert all("${{" not in each.get("run", "") for each in _steps(ACTION))
    assert os.access(SCRIPT, os.X_OK)


def test_actions_have_the_hashes_of_the_workflows() -> None:
    text = "".join(path.read_text() for path in (ROOT / ".github/workflows").glob("*.yml"))
    known = set(re.findall(r"uses: (actions/\S+@[0-9a-f]{40} # v[\d.]+)", text))
    for path in (FOLDER / "action.yml", WORKFLOW):
        used = re.findall(r"uses: (actions/.+)", path.read_text())
        assert used
        assert set(used) <= known, path


def test_the_workflow_of_the_template_uses_the_action() -> None:
    (job,) = yaml.safe_load(WORKFLOW.read_text())["jobs"].values()
    (step,) = [each for each in job["steps"] if "verify-port" in each.get("uses", "")]
    assert step["uses"].partition("@")[0].endswith(f"/{FOLDER.name}")
    assert set(step["with"]) <= set(ACTION["inputs"])
    (kept,) = [each for each in job["steps"] if "upload-artifact" in each.get("uses", "")]
    assert kept["with"]["path"] == ACTION["inputs"]["reports"]["default"]
    assert step["with"]["command"] == "./port"
