"""`agree`: outputs read, programs compared, hostile programs named, faults found."""

import json
import math
import shutil
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.io import FortranFile

from pyharness.checks.agree.caller import load, rows_of
from pyharness.checks.agree.comparing import compare
from pyharness.checks.agree.plan import FORMS, Outputs, read_plan
from pyharness.checks.agree.reading import Rows, printed_value, read_rows
from pyharness.checks.port_process import PortError
from pyharness.cli.main import main
from tests.checks.agree.programs import PLAN, written
from tests.conftest import Capture
from tests.json_reference import schema_of
from tests.tables import tables

TABLES = tables(__file__)
EXAMPLES = Path(__file__).parents[3] / "docs/how-to/agree"
RIGHT = "print('1 2\\n3 4')"


@pytest.mark.parametrize(("text", "value"), TABLES["printed"])
def test_printed_numbers_are_read(text: str, value: str) -> None:
    assert repr(printed_value(text)) == value


@pytest.mark.parametrize(("form", "text", "rows"), TABLES["outputs"])
def test_rows_are_read(form: str, text: str, rows: Rows) -> None:
    known = form if form in FORMS else "text"
    outputs = Outputs(("a", "b", "c"), known, "", form == "labels", form == "control")
    assert read_rows(text.encode(), outputs) == rows


@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4"])
def test_unformatted_records_are_read(kind: str, tmp_path: Path) -> None:
    rows = np.arange(12.0).reshape(4, 3)
    with FortranFile(str(tmp_path / "x"), "w", ">u4" if kind[0] == ">" else "<u4") as file:
        file.write_record(rows[0].astype(kind))
        file.write_record(rows[1:].astype(kind))
    outputs = Outputs(("a", "b", "c"), "unformatted", "x", kind=kind)
    content = (tmp_path / "x").read_bytes()
    assert read_rows(content, outputs) == rows.tolist()
    with pytest.raises(PortError, match="no unformatted records"):
        read_rows(content[:-6], outputs)


@pytest.mark.parametrize(("code", "message"), TABLES["hostile"])
def test_a_wrong_program_is_named_in_a_line(
    code: str, message: str, tmp_path: Path, capsys: Capture
) -> None:
    seconds = 1 if "within" in message else 30
    plan = written(tmp_path, code, text=PLAN.replace("seconds = 1", f"seconds = {seconds}"))
    assert main(["agree", plan, "--format", "json"]) == 1
    failed = [x for x in json.loads(capsys.readouterr().out)["checks"] if not x["passed"]]
    assert any(message in each["note"] for each in failed), failed
    assert all("\n" not in each["note"] for each in failed)


@pytest.mark.parametrize(("table", "code", "message"), TABLES["others"])
def test_a_function_or_source_that_fails_is_named_in_a_line(
    table: str, code: str, message: str, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "port.py").write_text(code)
    plan = written(tmp_path, "", text=PLAN.replace("command = {port}", table))
    assert main(["agree", plan, "--format", "json"]) == 1
    (check,) = json.loads(capsys.readouterr().out)["checks"]
    assert message in check["note"]
    assert "\n" not in check["note"]


def test_a_wrong_original_is_an_error(tmp_path: Path, capsys: Capture) -> None:
    assert main(["agree", written(tmp_path, RIGHT, "raise ValueError('lost')")]) == 2
    assert "original: run-1: it ended with exit code 1" in capsys.readouterr().err


@pytest.mark.parametrize(("old", "new", "message"), TABLES["mistakes"])
def test_a_mistake_in_the_file_is_a_line(
    old: str, new: str, message: str, tmp_path: Path, capsys: Capture
) -> None:
    text = PLAN.replace("{", "{{").replace("}", "}}").replace("{{original}}", "{original}")
    new = new.replace("\\n", "\n").replace("{", "{{").replace("}", "}}")
    assert old in PLAN
    plan = written(tmp_path, RIGHT, text=text.replace("{{port}}", "{port}").replace(old, new))
    assert main(["agree", plan]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


@pytest.mark.parametrize(
    ("limit", "value", "passed"),
    [("ulp = 0", 4.0, True), ("ulp = 0", np.nextafter(4.0, 5.0), False),
     ("ulp = 2", 4.0 + 2 * math.ulp(4.0), True), ("ulp = 2", 4.0 + 3 * math.ulp(4.0), False),
     ("relative = 0.01", 4.039, True), ("relative = 0.01", 4.041, False),
     ("absolute = 0.01", 4.009, True), ("absolute = 0.01", 3.98, False),
     ("relative = 0.5", math.nan, False), ("absolute = 1", math.inf, False),
     ("ulp = 9", -4.0, False)],
)  # fmt: skip
def test_limits_have_units(limit: str, value: float, passed: bool, tmp_path: Path) -> None:
    text = PLAN.replace("ulp = 0", f"{limit}\nbecause = 'test'")
    plan = read_plan(written(tmp_path, RIGHT, text=text))
    found = compare(plan, [[[1.0, 2.0], [3.0, 4.0]]], [[[1.0, 2.0], [3.0, value]]])
    assert found.passed == passed
    if not passed:
        assert found.first is not None
        assert (found.first.row, found.first.column) == (2, "b")


def test_values_that_are_no_numbers_agree_only_with_themselves(tmp_path: Path) -> None:
    plan = read_plan(written(tmp_path, RIGHT))
    odd: Rows = [[math.nan, "asterisks"], [math.inf, -0.0]]
    same = compare(plan, [odd], [odd])
    assert same.passed
    assert same.columns[0].kinds == {"NaN": 1, "inf": 1}
    other = compare(plan, [odd], [[[1.0, "null"], [-math.inf, 0.0]]])
    assert other.columns[0].kinds == {"NaN, number": 1, "inf, -inf": 1}
    assert other.columns[1].kinds == {"asterisks, null": 1, "-0.0, 0.0": 1}
    assert [each.beyond for each in other.columns] == [2, 2]


def test_inputs_reach_programs(tmp_path: Path) -> None:
    text = PLAN + "[inputs]\n{inputs}\n"
    table: Any = {
        "table = {x = [1, 0.1], y = [3, 4]}": ["1 3\n", "0.1 4\n"],
        "grid = {x = [1, 2], y = [3]}\ntext = 'A={x},B={y}'": ["A=1,B=3", "A=2,B=3"],
        "files = ['one']": ["text of one"],
        "text = 'all'": ["all"],
    }
    (tmp_path / "one").write_text("text of one")
    for inputs, texts in table.items():
        plan = tmp_path / "plan.toml"
        code = text.replace("{original}", '"a"').replace("{port}", '"b"')
        plan.write_text(code.replace("{inputs}", inputs))
        assert [run.text for run in read_plan(str(plan)).runs] == texts
    drawn = "random = {x = [0.0, 1.0], n = [1, 3]}\ndraws = 50\nseed = 1"
    plan.write_text(code.replace("{inputs}", drawn))
    one, two = (read_plan(str(plan)).runs for _ in range(2))
    assert one == two
    assert {run.values["n"] for run in one} == {1, 2, 3}


def test_functions_are_called(tmp_path: Path) -> None:
    (tmp_path / "f.py").write_text("import numpy\ndef f(x): return x, numpy.array([1.0, x])\n")
    assert rows_of(load(f"{tmp_path}/f.py:f")(2.0)) == [[2.0, 1.0, 2.0]]
    assert rows_of(np.eye(2)) == [[1.0, 0.0], [0.0, 1.0]]
    assert rows_of(load("math:hypot")(3.0, 4.0)) == [[5.0]]
    if sys.platform == "linux":
        assert load("libm.so.6:cos")(0.0) == 1.0


def test_a_record_replaces_the_original_and_is_never_overwritten_silently(
    tmp_path: Path, capsys: Capture
) -> None:
    def plan(original: str) -> str:
        return written(tmp_path, RIGHT, original, 'record = "r.json"\n' + PLAN)

    assert main(["agree", plan(RIGHT), "--update", ""]) == 2
    assert main(["agree", plan(RIGHT), "--update", "first"]) == 0
    before = (tmp_path / "r.json").read_bytes()
    assert main(["agree", plan("raise SystemExit(3)")]) == 0
    assert "recorded in" in capsys.readouterr().out
    assert main(["agree", plan(RIGHT), "--update", "again"]) == 0
    assert "nothing changed" in capsys.readouterr().out
    assert (tmp_path / "r.json").read_bytes() == before
    assert main(["agree", plan("print('1 2\\n3 5')"), "--update", "a bug"]) == 0
    assert "1 cells changed; first run-1, row 2, b: 4.0, 5.0" in capsys.readouterr().out
    changes = json.loads((tmp_path / "r.json").read_text())["changes"]
    assert [each["reason"] for each in changes] == ["first", "a bug"]
    assert main(["agree", plan(RIGHT)]) == 1
    other = 'record = "r.json"\n[inputs]\ntext = "x"\n'
    assert main(["agree", written(tmp_path, RIGHT, text=PLAN.replace("[outputs]",
                 other.partition("\n")[2] + "[outputs]").replace("seconds = 1",
                 'seconds = 1\nrecord = "r.json"'))]) == 2  # fmt: skip
    assert "recorded with other inputs" in capsys.readouterr().err
    data = json.loads((tmp_path / "r.json").read_text())
    for rows in ([], [[["0x1p0"]]], [[[1.0, 2.0]]], [[["0x1p0", "x"]]], 3):
        (tmp_path / "r.json").write_text(json.dumps({**data, "rows": rows}))
        assert main(["agree", plan(RIGHT)]) == 2
        assert "r.json" in capsys.readouterr().err


def test_a_first_file_is_written_and_read(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "p.py").write_text("print('HEAD')\nfor n in range(3): print(n, n * 0.5, 'x'[1:])")
    assert main(["agree", "--new", f"{sys.executable} {tmp_path}/p.py"]) == 0
    text = capsys.readouterr().out
    (tmp_path / "port.py").write_text((tmp_path / "p.py").read_text())
    (tmp_path / "new.toml").write_text(text)
    assert main(["agree", str(tmp_path / "new.toml")]) == 0
    assert read_plan(str(tmp_path / "new.toml")).outputs.columns == ("x1", "x2")
    assert main(["agree", "--new", "true"]) == 2


@pytest.fixture
def examples(tmp_path: Path) -> Path:
    return Path(shutil.copytree(EXAMPLES, tmp_path / "agree"))


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "least", "noise"),
    [("lorenz", 20, True), ("tridiagonal", 20, False), ("deck", 20, True)],
)
def test_examples_agree_and_their_planted_faults_are_found(
    name: str, least: int, noise: bool, examples: Path, capsys: Capture
) -> None:
    if noise and not (shutil.which("gcc") and shutil.which("gfortran")):
        pytest.skip("no compilers")
    if name == "deck":
        words = ["--program", "runge-kutta", "--case", "3", "--dialect", "gfortran"]
        assert main(["deck", *words, "--out", str(examples / "deck.f")]) == 0
    plan, cases = str(examples / f"{name}.toml"), str(examples / "cases.xml")
    also = ["--also", cases, "--format", "json"]
    assert main(["agree", plan, *["--noise"] * noise, *also]) == 0
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(schema_of("agree")).validate(record)
    assert (record["noise"] is not None) == noise
    (first, *rest) = ElementTree.parse(cases).iter("testcase")
    assert float(first.attrib["time"]) > 0.0
    assert len(rest) == len(record["checks"]) - 1
    assert main(["agree", plan, "--self-test", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(schema_of("agree")).validate(record)
    found = [each for each in record["checks"] if each["note"].startswith("found")]
    assert len(found) >= least
    # Each port differs from the original by no more than the limits, and no less than is reported.
    assert main(["agree", plan, "--format", "html"]) == 0
    assert "<table" in capsys.readouterr().out


SAVED = """      PROGRAM P
      READ(*,*) A
      DO 10 I=1,3
      CALL S(A,I,Y)
   10 WRITE(*,20) I,Y
   20 FORMAT(1X,I4,D24.16)
      END
      SUBROUTINE S(A,I,Y)
      IF(I.EQ.1) B=A
      B=B*1.5+X
      Y=B
      END
"""


@pytest.mark.campaign
@pytest.mark.external
def test_a_source_that_depends_on_initial_is_reported(tmp_path: Path, capsys: Capture) -> None:
    if not shutil.which("gfortran"):
        pytest.skip("no gfortran")
    (tmp_path / "saved.f").write_text(SAVED)
    code = "a=float(input())\nfor i in (1,2,3):\n a*=1.5\n print(i, a)"
    text = PLAN.replace("command = {original}", 'source = "saved.f"\nflags = ["-fno-automatic"]')
    plan = written(tmp_path, code, text=text + "[inputs]\ntable = {{a = [1.0, 2.5]}}\n")
    assert main(["agree", plan, "--noise"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "X is used before it is set (line 10)" in told
    assert "B is used before it is set (line 10)" in told
    assert "with -finit-real=snan" in told


def test_a_fault_that_the_limits_allow_is_not_found(tmp_path: Path, capsys: Capture) -> None:
    text = PLAN.replace("ulp = 0", "relative = 0.9\nbecause = 'test'")
    plan = written(tmp_path, RIGHT, text=text)
    assert main(["agree", plan, "--self-test"]) == 0
    capsys.readouterr()
    # One row with one value of each column: binary32 has no effect, and the report says so.
    assert main(["agree", plan, "--self-test", "--format", "json"]) == 0
    notes = {x["id"]: x["note"] for x in json.loads(capsys.readouterr().out)["checks"]}
    assert notes["self-test/binary32"] == "no effect on any cell"
    wrong = written(tmp_path, "print('1 2\\n3 9')")
    assert main(["agree", wrong, "--self-test"]) == 1
