"""`sweep`: its output, its picture, and packages that are missing."""

import json
import sys
from pathlib import Path

import pytest

from pyharness.cli.main import main
from pyharness.cli.verbs import sweep as verb
from tests.conftest import Capture, Patch, Printed, ResultOf
from tests.sweep.claims import CLAIMS
from tests.sweep.sweeps import PROGRAM, SQUARE, TILT, text, written


@pytest.fixture(autouse=True)
def _beside(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path, text(TILT, SQUARE, top='reductions = ["end", "status", "growth"]'))


def test_report_says_what_was_found_and_the_estimate_came_before(result_of: ResultOf) -> None:
    captured = result_of(["sweep", "sweep.toml", "--out", "store"])
    assert captured.err.startswith("pyharness: 30 scenes in 1 chunks: about ")
    for words in ("growth", "complete", "body.square.1", "30 scenes"):
        assert words in captured.out
    again = result_of(["sweep", "sweep.toml", "--out", "store"])
    assert again.err == ""
    assert "all 1 chunks were there" in again.out


def test_record_is_strict_json(printed: Printed) -> None:
    record = json.loads(printed("sweep sweep.toml --out store --format json"))
    assert record["schema"] == 1
    assert record["scenes"] == 30
    assert [each["field"] for each in record["axes"]] == ["tilt", "body.square.1"]
    assert record["counts"] == [{"reduction": "status", "value": "complete", "scenes": 30}]
    assert "reduction,of,scenes" in printed("sweep sweep.toml --out store --format csv")


@pytest.mark.campaign
@pytest.mark.parametrize("content", [text(TILT, SQUARE), text(TILT), PROGRAM])
def test_picture_is_drawn_with_its_numbers(content: str, printed: Printed, tmp_path: Path) -> None:
    written(tmp_path, content)
    printed("sweep sweep.toml --out store --plot map.svg")
    assert (tmp_path / "map.svg").read_text().startswith("<?xml")
    lines = (tmp_path / "map.csv").read_text().splitlines()
    assert len(lines) > 6
    assert "end" in lines[0]
    printed("sweep sweep.toml --out store --plot status.png --quantity status")
    assert "status" in (tmp_path / "status.csv").read_text().splitlines()[0]


def test_claim_is_asked_by_its_name(printed: Printed, monkeypatch: Patch) -> None:
    monkeypatch.setattr(verb, "CLAIMS", CLAIMS)
    top = 'reductions = [{name = "claim", id = "stays"}]'
    written(Path(), text(TILT, top=top))
    assert "holds" in printed("sweep sweep.toml --out store")


@pytest.mark.parametrize(("package", "executor"), [("zarr", "here"), ("distributed", "dask")])
def test_missing_package_is_named(
    package: str, executor: str, capsys: Capture, monkeypatch: Patch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    assert main(["sweep", "sweep.toml", "--out", "store", "--executor", executor]) == 2
    assert "pip install 'rigid-body-harness[sweep]'" in capsys.readouterr().err
