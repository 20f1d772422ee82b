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


@pytest.mark.parametrize(("text", "line", "told"), [
    ('import x from "./other.js";', 1, "a form that is not known: import x from"),
    ('\n\nimport "./other.js";', 3, "a form that is not known"),
    ('import { one } from "other";', 1, "a form that is not known"),
    ('import { one } from "./other.js"', 1, "a form that is not known"),
    ("export default 3;", 1, "a form that is not known: export default 3;"),
    ("const a = 1;\nexport { a };", 2, "a form that is not known"),
    ('export * from "./other.js";', 1, "a form that is not known"),
    ("export let a = 1;", 1, "a form that is not known"),
    ('const a = 1;\n\nconst b = import("./other.js");', 3, "a form that is not known"),
    ("const a = import.meta.url;", 1, "a form that is not known"),
    ('// A line.\nimport { two } from "./other.js";', 2, "other.js exports no two"),
    ('import { one } from "./none.js";', 1, "there is no ./none.js"),
    ('import { back } from "./round.js";', 1, "this module too"),
    ('import {\n  one,\n} from "./other.js";\nimport x from "./other.js";', 4, "not known"),
])  # fmt: skip
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
