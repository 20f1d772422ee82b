"""`verify --port`: random scenes, times, the first step that differs, and planted faults."""

import json
import math
import re
import shlex
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from jsonschema import Draft202012Validator

from pyharness import run_program
from pyharness.checks.plants.outcome import CONTROL
from pyharness.checks.plants.port_plants import PLANTS, self_test
from pyharness.checks.port import Cell, compared, port_cells, random_cells
from pyharness.checks.port_protocol import VARIABLES
from pyharness.cli.main import main
from pyharness.model.listing import PROGRAMS
from pyharness.model.scene_file import case_numbers
from tests.conftest import Capture, Patch, ResultOf
from tests.json_reference import schema_of
from tests.ports import answering, documented_command, scene_port

CELL = "two-term/case-2/original"
BIT = "import math; rows[6][2] = math.nextafter(float.fromhex(rows[6][2]), math.inf).hex()"


def _json(capsys: Capture, *words: str, status: int = 0) -> Any:
    assert main(["verify", "--port", *words, "--format", "json"]) == status
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(schema_of("verify")).validate(record)
    return record


def test_every_variable_of_the_first_different_step_is_reported(
    tmp_path: Path, capsys: Capture, result_of: ResultOf
) -> None:
    command = answering(tmp_path / "port.py", BIT)
    (check,) = _json(capsys, command, "--cell", CELL, status=1)["checks"]
    assert check["note"].startswith("first at step 7, U2: 1 ulp (0x")
    assert (check["value"], check["limit"]) == (1.0, 0.0)
    words = shlex.split(check["replay"])
    assert words[:3] == ["python", "-m", "pyharness"]
    assert words[3:] == ["verify", "--port", command, "--cell", CELL]
    assert check["difference"]["step"] == 7
    values = {each["variable"]: each for each in check["difference"]["values"]}
    assert tuple(values) == VARIABLES
    assert {name: each["ulps"] for name, each in values.items() if each["ulps"]} == {"U2": 1.0}
    theirs, ours = (float.fromhex(values["U2"][whose]) for whose in ("theirs", "ours"))
    assert theirs == math.nextafter(ours, math.inf)
    printed = result_of(words[3:], 1).out
    assert "step 7, U2" in " ".join(printed.split())
    assert f"port/{CELL}, step 7:\nvariable  unit   ours" in printed
    (line,) = [each.split() for each in printed.splitlines() if each.startswith("U2 ")]
    assert line == ["U2", "rad/s", repr(ours), repr(theirs), "1"]


def test_a_nan_is_reported_in_strict_json(tmp_path: Path, capsys: Capture) -> None:
    command = answering(tmp_path / "port.py", "rows[3][5] = 'nan'")
    (check,) = _json(capsys, command, "--cell", CELL, status=1)["checks"]
    (wrong,) = [each for each in check["difference"]["values"] if each["ulps"] != 0.0]
    assert (wrong["variable"], wrong["theirs"], wrong["ulps"]) == ("V2", "nan", None)


def test_times_are_those_of_the_answers(tmp_path: Path, capsys: Capture) -> None:
    command = answering(tmp_path / "port.py", "import time; time.sleep(0.05)")
    record = _json(capsys, command, "--cell", f"{CELL},two-term/case-3/original")
    times = [check["seconds"] for check in record["checks"]]
    assert len(times) == 2
    assert all(0.05 <= each < 30.0 for each in times)
    assert record["seconds"] == sum(times)
    assert main(["verify", "--port", command, "--cell", CELL]) == 0
    assert "longest (ms)\nport/two-term        1" in capsys.readouterr().out


@pytest.mark.campaign
def test_random_scenes_are_repeated_by_their_command(tmp_path: Path, capsys: Capture) -> None:
    """A port with a wrong torque passes no random scene, and the command shows the same again."""
    right = scene_port(tmp_path / "right.py")
    record = _json(capsys, right, "--cell", "random", "--draws", "25", "--seed", "here")
    assert len(record["checks"]) == 25
    assert record["seed"] == "here"
    assert {check["id"].split("/")[3] for check in record["checks"]} == set(PROGRAMS)
    wrong = scene_port(tmp_path / "wrong.py", "omega = [omega[1], omega[0], omega[2]]")
    record = _json(capsys, wrong, "--cell", "random", "--draws", "9", "--seed", "a b", status=1)
    failed = [check for check in record["checks"] if not check["passed"]]
    assert len(failed) >= 7
    words = shlex.split(failed[-1]["replay"])[3:]
    assert words[-2:] == ["--seed", "a b"]
    again = _json(capsys, *words[2:], status=1)["checks"]
    (found,) = ((each["id"], each["note"]) for each in again)
    assert found == (failed[-1]["id"], failed[-1]["note"])


def test_draws_come_after_the_cells_of_the_same_programs() -> None:
    cells = random_cells("s", 60, (), ["four-term"])
    assert 0 < len(cells) < 60
    assert {cell.listing.program for cell in cells} == {"four-term"}
    assert [cell.name for cell in random_cells("s", 0, ["random/7"])] == [
        cell.name for cell in random_cells("s", 8) if cell.name.startswith("random/7/")
    ]
    assert random_cells("s", 5, ["two-term"]) == []


@pytest.mark.campaign
def test_every_planted_fault_is_noticed(tmp_path: Path) -> None:
    assert len(PLANTS) >= 40
    assert len({plant.name for plant in PLANTS}) == len(PLANTS)
    cells = port_cells(PROGRAMS, case_numbers(), ())
    found = list(self_test(scene_port(tmp_path / "port.py"), cells))
    assert [each.name for each in found] == [CONTROL, *(plant.name for plant in PLANTS)]
    assert [each.note for each in found if not each.passed] == []
    assert [each.name for each in found if not each.has_effect] == []
    assert all(each.failed >= 4 for each in found[1:])


@pytest.mark.campaign
def test_a_wrong_port_fails_the_control(tmp_path: Path, capsys: Capture) -> None:
    command = answering(tmp_path / "port.py", BIT)
    record = _json(capsys, command, "--self-test", "--cell", CELL, status=1)
    (failed,) = (each["id"] for each in record["checks"] if not each["passed"])
    assert failed == "self-test/none"
    assert main(["verify", "--port", documented_command(), "--self-test", "--cell", CELL]) == 0
    assert capsys.readouterr().out.endswith("without effect\n")
    assert main(["verify", "--port", "false", "--self-test", "--cell", CELL]) == 1
    assert "FAILED none: no fault: nothing may fail" in capsys.readouterr().out


@pytest.mark.campaign
def test_a_check_that_sees_nothing_would_fail_the_self_test(monkeypatch: Patch) -> None:
    """Without the comparison of rows the planted bits pass unseen, and the self-test says so."""

    def blind(cell: Cell, twin: Any, line: bytes, *rest: Any) -> Any:
        run = run_program(cell.scene, cell.listing)
        columns = run.recorded_time, *run.omega.T, *run.velocity.T
        rows = [[float(x).hex() for x in row] for row in zip(*columns, strict=True)]
        return compared(cell, twin, json.dumps({**json.loads(line), "rows": rows}).encode(), *rest)

    monkeypatch.setattr("pyharness.checks.plants.port_plants.compared", blind)
    cells = port_cells(["two-term"], [2], [CELL])
    missed = {each.name for each in self_test(documented_command(), cells) if not each.passed}
    assert {"bit-U1", "bit-V3", "dropped-row", "nan"} <= missed
    assert "ier-null" not in missed


def test_a_port_is_asked_for_random_scenes_with_their_stop_tests() -> None:
    cells = random_cells("stop tests", 40)
    assert {cell.may_stop for cell in cells} == {True, False}
    assert len({cell.lipschitz for cell in cells}) == 4
    for cell in cells[:5]:
        asked = json.loads(cell.request)
        assert (asked["lipschitz"], asked["may_stop"]) == (cell.lipschitz, cell.may_stop)


def _tables(text: str) -> list[list[str]]:
    """Return the tables of a page in Markdown as a renderer finds them, each with its first cells.

    A line that follows a table without a blank line would be a row of the table.
    """
    from markdown_it import MarkdownIt

    found: list[list[str]] = []
    tokens = MarkdownIt("commonmark").enable("table").parse(text)
    for token, after in zip(tokens, tokens[2:], strict=False):
        if token.type == "table_open":
            found.append([])
        if token.type == "tr_open" and after.type == "inline":
            found[-1].append(after.content)
    return found


def test_several_outputs_are_those_of_one_run(tmp_path: Path, capsys: Capture) -> None:
    """The page has its tables and each failed check with its command, and no link of the port."""
    command = answering(tmp_path / "port.py", BIT)
    files = [tmp_path / name for name in ("summary.md", "report.xml", "report.json")]
    words = ["--cell", f"{CELL},two-term/case-3/original", "--format", "markdown"]
    assert main(["verify", "--port", command, *words, "--also", ",".join(map(str, files))]) == 1
    page, junit, record = (path.read_text() for path in files)
    assert capsys.readouterr().out == page
    assert page.startswith("## verify --port: 2 checks, 2 failed\n")
    assert f"--cell {CELL}`" in page
    assert _tables(page) == [
        ["checks", "port/two-term"], ["variable", *VARIABLES], ["variable", *VARIABLES],
        ["runs", "port/two-term"],
    ]  # fmt: skip
    suite = ElementTree.fromstring(junit)
    counts = {name: suite.get(name) for name in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "2", "failures": "2", "errors": "0", "skipped": "0"}
    assert len([*suite.iter("testcase")]) == 2
    assert junit.count("<failure ") == 2
    assert len(re.findall(r' time="\d+\.\d{6}"', junit)) == 3  # of the suite and its two cases
    assert [each["passed"] for each in json.loads(record)["checks"]] == [False, False]
    assert main(["verify", "--port", "missing", "--format", "junit"]) == 1
    assert """<failure message="'missing' can't be started""" in capsys.readouterr().out


def test_a_wrong_end_alone_is_told_without_a_false_comparison(
    tmp_path: Path, capsys: Capture
) -> None:
    """Regression test: with equal rows, the line said ``0 > 0``."""
    ending = "import types; run = types.SimpleNamespace(ended='overflow', stop=None, ier=run.ier)"
    assert main(["verify", "--port", answering(tmp_path / "port.py", ending), "--cell", CELL]) == 1
    assert f"FAILED port/{CELL} 0, limit 0 (derived; ended: overflow" in capsys.readouterr().out


@pytest.mark.campaign
def test_every_kind_of_check_has_a_page(result_of: ResultOf) -> None:
    page = result_of(["verify", "--only", "orders", "--format", "markdown"]).out
    assert page.startswith("## verify: ")
    assert _tables(page) == [["checks", "orders"]]


def test_a_port_writes_no_markup_into_a_page(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "port.py"
    path.write_text("raise SystemExit('error: `</code> [a](b) <img>')")
    command = shlex.join(["python3", str(path)])
    assert main(["verify", "--port", command, "--format", "markdown"]) == 1
    (line,) = [x for x in capsys.readouterr().out.splitlines() if x.startswith("- FAILED")]
    assert line.rstrip().endswith("'</code> [a](b) <img>)`")
    assert line.count("`") == 2
