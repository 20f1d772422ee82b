"""Integrators for tests of `verify --integrator`: the guide's example, and changed copies of it."""

import json
import shlex
import sys
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

from pyharness.cli.main import main
from tests.conftest import Capture
from tests.json_reference import schema_of

ROOT = Path(__file__).parent.parent.parent
FOLDER = ROOT / "docs/how-to/integrator"
RK4 = FOLDER / "rk4.py"


def command_of(path: Path) -> str:
    return shlex.join([sys.executable, str(path)])


def written(folder: Path, text: str) -> str:
    """Return the command of an integrator with this source."""
    (folder / "written.py").write_text(text)
    return command_of(folder / "written.py")


def edited(folder: Path, *changes: tuple[str, str]) -> str:
    """Return the command of a copy of the example with other texts."""
    text = RK4.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return written(folder, text)


def json_of(capsys: Capture, command: str, *words: str, status: int = 0) -> Any:
    assert main(["verify", "--integrator", command, *words, "--format", "json"]) == status
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(schema_of("verify")).validate(record)
    return record
