"""Every verb with a scene whose moments change with time: it works, or is refused."""

import json
import re
import shlex
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from pyharness import (
    ChangingMoments,
    Scene,
    solve,
)
from pyharness.cli.main import main
from pyharness.methods.registry import METHODS
from tests.json_reference import schema_of

BODY = "moments = [[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]"
FILE = f"""\
name = "booms"
[body]
{BODY}
[initial]
omega = [0.1, 1.0, 1.0]
attitude = [1.0, 0.0, 0.0, 0.0]
[run]
step_size = 0.5
steps = 4
"""

MOMENTS = ChangingMoments([[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]])


@pytest.fixture
def booms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("booms.toml").write_text(FILE)


@pytest.mark.usefixtures("booms")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("options", ["", "--attitude quaternion", "--times 1,2"])
def test_run_with_a_method_shows_the_moments_or_refuses_them(
    method: str, options: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(shlex.split(f"run --scene booms.toml --method {method} {options}"))
    captured = capsys.readouterr()
    chosen = METHODS[method]
    if chosen.state_torque and (chosen.attitude or "attitude" not in options):
        assert status == 0
        assert "I = (40 + 1.5 t - 0.25 t^2, 30 + 0.5 t, 20) kg m2" in captured.out
    else:
        assert status == 2
        assert f"method {method} " in captured.err


@pytest.mark.usefixtures("booms")
def test_json_has_the_polynomials(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(shlex.split("run --scene booms.toml --method auto --times 2 --format json")) == 0
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(schema_of("run")).validate(record)
    assert record["scene"]["body"] == {"moments": [[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]}
    found = solve(Scene("booms", (0.1, 1.0, 1.0), moments=MOMENTS), 2.0)
    assert record["trajectory"]["omega"] == found.omega.tolist()


@pytest.mark.usefixtures("booms")
def test_plan_names_the_moments_as_the_reason(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--scene", "booms.toml", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(schema_of("plan")).validate(record)
    assert main(["plan", "--scene", "booms.toml", "--tolerance", "1e-3"]) == 0
    text = capsys.readouterr().out
    assert re.search(r"integration +yes +its inertia changes with time", text)
    assert "method: taylor" in text
