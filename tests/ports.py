"""Ports for tests: cells that cover all branches, and the commands of two ports."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from pyharness.checks.port import Cell, port_cells
from pyharness.model.listing import PROGRAMS
from pyharness.model.scene_file import case_numbers

ROOT = Path(__file__).parent.parent
WEB = ROOT / "web"
# Ten cells: every program, every ending, a reading, the conjecture of Case 7.
SAMPLE = (
    "two-term/case-2/original", "two-term/case-6/original", "two-term/case-7/initial-torque",
    "two-term/case-3/c1-for-c", "four-term/case-5/original", "four-term/case-7/corrected",
    "runge-kutta/case-2/original", "runge-kutta/case-3/stage-base",
    "runge-kutta/case-6/do-variable", "runge-kutta/case-7/original",
)  # fmt: skip


def sample(names: Sequence[str] = SAMPLE) -> list[Cell]:
    """Return the cells whose names begin with one of `names`."""
    return port_cells(PROGRAMS, case_numbers(), names)


def documented() -> str:
    """Return the port that the documentation shows."""
    (text,) = re.findall(r"```py\n(.*?)```", (ROOT / "docs/how-to/ports.md").read_text(), re.DOTALL)
    return str(text)


def documented_command() -> str:
    """Return the command that starts the documented port."""
    return shlex.join([sys.executable, "-c", documented()])


def engine() -> str:
    """Return the path of Node; skip the test if there is none."""
    found = shutil.which("node")
    if found is None:
        pytest.skip("no node on the PATH: the JavaScript is not tried")
    return found


def node(web: Path) -> str:
    """Return the command of the port in a copy of `web`."""
    return shlex.join([engine(), str(web / "port.js")])


def run_javascript(modules: Mapping[str, Path], body: str, **given: Any) -> Any:
    """Return what JavaScript statements return, which use modules and values by their names."""
    imports = [
        f"import * as {name} from {json.dumps(str(path))};" for name, path in modules.items()
    ]
    script = (
        f"{''.join(imports)} import {{ readFileSync }} from 'node:fs';"
        f"const {{ {', '.join(given)} }} = JSON.parse(readFileSync(0));"
        f"console.log(JSON.stringify((() => {{ {body} }})()));"
    )
    done = subprocess.run(
        [engine(), "--input-type=module", "--eval", script],
        input=json.dumps(given), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-500:]
    return json.loads(done.stdout)
