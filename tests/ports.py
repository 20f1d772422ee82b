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
TEMPLATE = ROOT / "docs/how-to/port"
C_FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
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
    (text,) = re.findall(r"```py\n(.*?)```", (ROOT / "docs/how-to/ports.md").read_text(), re.DOTALL)
    return str(text)


def documented_command() -> str:
    """Return the command that starts the documented port."""
    return shlex.join([sys.executable, "-c", documented()])


def answering(path: Path, change: str) -> str:
    """Return the command of the documented port with a line of Python that changes its `rows`."""
    before, place, after = documented().partition("    ier = ")
    path.write_text(f"{before}    {change}\n{place}{after}")
    return shlex.join([sys.executable, str(path)])


def scene_port(path: Path, change: str = "pass") -> str:
    """Return the command of a port that runs any requested scene by our compiled programs.

    `change` is a line of Python that may change `omega` before the run.
    """
    path.write_text(
        "import json, sys\n"
        "from pyharness import Listing, Scene, TorqueLaw, run_program\n"
        "for line in sys.stdin:\n"
        "    asked = json.loads(line)\n"
        "    given, law = asked['scene'], asked['scene']['torque']\n"
        "    waves = {k: [(w['amplitude'], w['frequency']) for w in law[k]]\n"
        "             for k in ('sines', 'cosines')}\n"
        "    omega = given['initial']['omega']\n"
        f"    {change}\n"
        "    scene = Scene(given['name'], omega, **given['body'], **given['run'],\n"
        "                  torque=TorqueLaw(law['constant'], law['rate'], **waves),\n"
        "                  masses=given['masses'], forces=given['forces'],\n"
        "                  case=given['case'] if given['initial_torque'] else None)\n"
        "    active = [asked['listing'][k] for k in ('defects', 'readings', 'conjectures')]\n"
        "    run = run_program(scene, Listing(asked['program'], *active),\n"
        "                      lipschitz=asked['lipschitz'], may_stop=asked['may_stop'])\n"
        "    columns = run.recorded_time, *run.omega.T, *run.velocity.T\n"
        "    rows = [[x.hex() for x in row] for row in zip(*(c.tolist() for c in columns))]\n"
        "    ier = None if run.ier is None else run.ier.tolist()\n"
        "    answer = {'rows': rows, 'ended': run.ended, 'stop': run.stop and vars(run.stop),\n"
        "              'ier': ier}\n"
        "    print(json.dumps(answer), flush=True)\n"
    )
    return shlex.join([sys.executable, str(path)])


def compiled_port(folder: Path, source: str | None = None) -> str:
    """Compile the port in C, or another text of it, and return its path; skip without a compiler.

    Only the text of the template is compiled with warnings as errors.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no cc on the PATH: the port in C is not tried")
    text = (TEMPLATE / "port.c").read_text()
    (folder / "port.c").write_text(text if source is None else source)
    flags = C_FLAGS if source is None else ["-std=c99", "-w", "-ffp-contract=off"]
    command = [compiler, "-O1", *flags, "-o", "port", "port.c", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return str(folder / "port")


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
    """Return the result of JavaScript statements, which use modules and values by their names."""
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


def with_fault(folder: Path, name: str, here: str, planted: str) -> Path:
    """Return a copy of the web's folder, in which a passage of a file is replaced."""
    web = Path(shutil.copytree(WEB, folder / "web"))
    text = (web / name).read_text()
    assert text.count(here) == 1
    (web / name).write_text(text.replace(here, planted))
    return web
