"""Modules bundled as one script: the same numbers, and a one-line error for unknown syntax."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from pyharness import case_scene, run_program
from pyharness.checks.port_protocol import requested_scene
from pyharness.edition.bundle import bundle
from pyharness.model.listing import PROGRAMS, Listing
from tests.ports import WEB, engine
from tests.tables import tables


def _run(script: str, **known: object) -> str:
    """Run a script without modules, with the globals `known`; return its value of `said`."""
    run = (
        "const vm = require('node:vm');"
        "const { script, known } = JSON.parse(require('node:fs').readFileSync(0));"
        "const world = { ...known, said: null };"
        "vm.runInNewContext(script, world); console.log(JSON.stringify(world.said));"
    )
    given = json.dumps({"script": script, "known": known})
    command = [engine(), "--eval", run]
    done = subprocess.run(command, input=given, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout


def test_the_bundled_programs_have_the_twins_bits(tmp_path: Path) -> None:
    entry = tmp_path / "entry.js"
    shutil.copytree(WEB / "programs", tmp_path / "programs")
    entry.write_text(
        'import * as four from "./programs/four-term.js";\n'
        'import * as third from "./programs/runge-kutta.js";\n'
        'import { run as two } from "./programs/two-term.js";\n'
        'const runs = { "four-term": four.run, "runge-kutta": third.run, "two-term": two };\n'
        "said = asked.map(([name, scene, on]) => runs[name](scene, new Set(on)).rows);\n"
    )
    cells = [(n, Listing.original(program)) for n in (2, 7) for program in PROGRAMS]
    asked = [
        (each.program, requested_scene(case_scene(n)), [*each.defects, *each.conjectures])
        for n, each in cells
    ]
    for (n, listing), rows in zip(cells, json.loads(_run(bundle(entry), asked=asked)), strict=True):
        twin = run_program(case_scene(n), listing, "python")
        assert [row[1:4] for row in rows] == twin.omega.tolist()


def test_every_module_is_there_once_and_behind_what_it_needs() -> None:
    text = bundle(WEB / "laboratory" / "laboratory.js")
    names = re.findall(r"^// (\w+/[\w-]+\.js)$", text, re.MULTILINE)
    assert len(set(names)) == len(names)
    assert names[-1] == "laboratory/laboratory.js"
    assert names.index("programs/circular.js") < names.index("programs/equations.js")
    assert re.search(r"^\s*(import|export)\b", text, re.MULTILINE) is None


@pytest.mark.parametrize(("text", "line", "told"), tables(__file__)["unknown_forms_are_refused"])
def test_unknown_forms_are_refused(text: str, line: int, told: str, tmp_path: Path) -> None:
    (tmp_path / "other.js").write_text("export const one = 1;\n")
    (tmp_path / "round.js").write_text('import { x } from "./entry.js";\nexport const back = 1;\n')
    entry = tmp_path / "entry.js"
    entry.write_text(f"{text}\nexport const x = 1;\n")
    with pytest.raises(ValueError, match=re.escape(told)) as caught:
        bundle(entry)
    at = "round.js:1" if "round" in text else f"entry.js:{line}"
    assert f"{at}: " in str(caught.value)


def test_names_may_be_changed_and_taken_together(tmp_path: Path) -> None:
    (tmp_path / "other.js").write_text(
        "const hidden = 2;\nexport const one = 1;\nexport function two() {\n  return hidden;\n}\n"
        "export class Three {\n  value = 3;\n}\n"
    )
    entry = tmp_path / "entry.js"
    entry.write_text(
        'import { one as first, two, Three } from "./other.js";\n'
        'import * as other from "./other.js";\n'
        "const hidden = 4;\n"
        "said = [first, two(), new Three().value, hidden, other.one];\n"
    )
    assert json.loads(_run(bundle(entry))) == [1, 2, 3, 4, 1]
