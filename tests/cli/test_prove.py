"""The verb prove: its tables, its JSON and CSV, and certificates."""

import csv
import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from pyharness.cli.main import main
from tests.conftest import Capture, Patch, Printed, ResultOf
from tests.json_reference import schema_of
from tests.truth.test_certificate import SCENES, genuine

DIGITS = "prove --case 3 --times 0.1,0.2 --digits 12"
DAMPED = """\
body.moments = [40.0, 30.0, 20.0]
initial.omega = [0.1, 1.0, 1.0]
torque.expression = ["-0.1*w1", "-0.1*w2 + 0.1*w1*w3", "-0.1*w3"]
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("damped.toml").write_text(DAMPED)


def valid(text: str) -> dict[str, Any]:
    record: dict[str, Any] = json.loads(text)
    Draft202012Validator(schema_of("prove")).validate(record)
    return record


def test_table_has_the_proved_values(printed: Printed) -> None:
    text = printed(DIGITS)
    assert "differs from a value by at most its radius" in " ".join(text.split())
    assert all(text.count(word) >= 2 for word in ("omega1", "omega2", "omega3", "energy"))
    row = valid(printed(f"{DIGITS} --format json"))["rows"][1]
    assert all(value in text for value in row["omega"])


@pytest.mark.parametrize("command", [
    f"{DIGITS} --certificate new.json",
    "prove --case 7 --times=-0.05 --digits 5",
    "prove --case 3 --times 0.01 --digits 5 --velocity",
    "prove --scene damped.toml --times 0,0.1 --digits 5 --transition",
])  # fmt: skip
def test_json_has_the_documented_fields(printed: Printed, command: str) -> None:
    if "new.json" not in command and "case" not in command:
        pytest.importorskip("flint")
    for row in valid(printed(f"{command} --format json"))["rows"]:
        assert len(row["omega"]) == 3
        assert row["radius"] <= 1.2e-4


def test_csv_has_a_line_for_each_component(printed: Printed) -> None:
    lines = list(csv.reader(printed(f"{DIGITS} --format csv").splitlines()))
    head = next(n for n, line in enumerate(lines) if line[:2] == ["time", "quantity"])
    assert [line[1] for line in lines[head + 1 :]] == ["omega1", "omega2", "omega3", "energy"] * 2
    record = json.loads(printed(f"{DIGITS} --format json"))
    assert [line[2] for line in lines[head + 1 : head + 4]] == record["rows"][0]["omega"]


def test_certificate_is_written_and_verified(printed: Printed) -> None:
    found = json.loads(printed(f"{DIGITS} --certificate new.json --format json"))
    record = json.loads(Path("new.json").read_text())
    assert [each["omega"] for each in record["rows"]] == [each["omega"] for each in found["rows"]]
    assert "proved" in printed("prove --check new.json")
    verdict = valid(printed("prove --check new.json --format json"))["certificates"]
    facts = {"file": "new.json", "proved": True, "steps": len(record["steps"]), "reason": ""}
    assert verdict == [{**facts, "scene": record["scene"], "rows": record["rows"]}]
    shown = printed("prove --check new.json")
    assert all(x in shown for row in record["rows"] for x in row["omega"])
    assert json.dumps(record["scene"]) in " ".join(shown.split())
    lines = printed("prove --check new.json --format csv").splitlines()
    assert lines[-1].startswith("new.json,proved")


def test_certificate_and_closed_form_agree(printed: Printed) -> None:
    first = json.loads(printed(f"{DIGITS} --certificate new.json --format json"))["rows"]
    second = json.loads(printed(f"{DIGITS} --format json"))["rows"]
    for one, other in zip(first, second, strict=True):
        for x, y in zip(one["omega"], other["omega"], strict=True):
            away = abs(Fraction(x) - Fraction(y))
            assert away <= Fraction(one["radius"]) + Fraction(other["radius"])


def test_falsified_certificate_has_exit_status_1(capsys: Capture, result_of: ResultOf) -> None:
    record = json.loads(json.dumps(genuine(next(iter(SCENES)))))
    Path("good.json").write_text(json.dumps(record))
    record["steps"][1][3][0] += 1
    Path("bad.json").write_text(json.dumps(record))
    Path("text.json").write_text(json.dumps(record)[:-1])
    for names, status in (
        ("good.json", 0), ("bad.json", 1), ("good.json,bad.json", 1),
        ("text.json,good.json", 1),
    ):  # fmt: skip
        assert main(["prove", "--check", names, "--format", "json"]) == status
        for each in valid(capsys.readouterr().out)["certificates"]:
            assert each["proved"] == (each["file"] == "good.json")
            assert bool(each["reason"]) != each["proved"]
    shown = result_of(["prove", "--check", "bad.json"], 1).out
    assert "not proved" in shown
    assert "step 2" in shown


@pytest.mark.parametrize("content", [None, b"", b"a = 1\n", b"{}", b"\xff\xfe{\0}\0"])
def test_file_that_is_no_certificate_is_refused(content: bytes | None, result_of: ResultOf) -> None:
    """Regression test: the exit status was 1, as for a certificate that does not hold."""
    if content is not None:
        Path("x.json").write_bytes(content)
    for name in ("x.json", str(Path.cwd())):
        told = result_of(["prove", "--check", name], 2)
        assert told.out == ""
        assert told.err.startswith(f"pyharness: --check '{name}': ")
        assert told.err.count("\n") == 1
