"""README and documents: outputs are current, examples run, and all links resolve."""

import csv
import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from docs.article import build as article
from docs.campaign import page as promises
from docs.certificates import page as proofs
from docs.gallery import build as gallery
from docs.gallery.execution import executed, is_current, picture_file, picture_of, shown_output
from docs.reference import made_tables
from docs.text import page as about_text
from pyharness import read_scene
from pyharness.cli import options
from pyharness.cli.json_help import fields
from pyharness.cli.main import VERBS, main
from pyharness.history import figures
from pyharness.model.report import Report
from pyharness.views import render as views
from pyharness.views.render import csv_text
from tests.conftest import Patch, Printed
from tests.json_reference import SCHEMA, schema_of
from tests.tables import tables

ROOT = Path(__file__).parent.parent
DOCS = sorted((ROOT / "docs").rglob("*.md"))
README = ROOT / "README.md"
CONTRIBUTING = ROOT / "CONTRIBUTING.md"
SCENES = ROOT / "docs/reference/scene-files.md"
# The files that are made of data, or have tables of data, and their text.
BUILT = (
    (f"docs/{about_text.PAGE}", about_text.text_page()),
    (f"docs/{proofs.PAGE}", proofs.proofs_page()),
    (f"docs/{promises.PAGE}", promises.promises_page()),
    (f"docs/{gallery.PAGE}", gallery.gallery_page()),
    *made_tables.pages(),
)


_LEFT_OUT = "\n...\n"  # stands for lines of an output that a document leaves out


def _blocks() -> list[tuple[Path, str, str]]:
    found = []
    for path in DOCS:
        for block in re.findall(r"```text\n\$ (.*?)```", path.read_text(), re.DOTALL):
            command, _, output = block.partition("\n")
            found.append((path, command, output))
    return found


def test_picture_of_the_architecture_is_the_import_contract() -> None:
    page = (ROOT / "docs/contributing/architecture.md").read_text()
    picture = page.split("```")[1].strip("\n").split("\n")
    names = [re.split(r" {2,}", line)[0].split() for line in picture]
    (contract, *_) = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
        "contracts"
    ]
    assert names == [each.split(" | ") for each in contract["layers"]]


@pytest.mark.sampled
@pytest.mark.parametrize(("path", "command", "output"), _blocks())
def test_output_is_current(
    path: Path, command: str, output: str, printed: Printed, monkeypatch: Patch
) -> None:
    """Its JSON has the documented fields. `python -m tests.test_docs` writes the blocks anew."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("COLUMNS", "100")
    reports: list[Report] = []
    show = options.show

    def shown(report: Report, *rest: Any, **options: Any) -> int:
        reports.append(report)
        return show(report, *rest, **options)

    monkeypatch.setattr(options, "show", shown)
    words = command.removeprefix("pyharness ")
    assert _is_excerpt(output, printed(words)), f"{path.name}: {command}"
    assert len(reports) == (not words.startswith("help"))
    for report in reports:
        record = json.loads(views.render(report, "json"))
        Draft202012Validator(schema_of(words.split()[0])).validate(record)


def _is_excerpt(shown: str, output: str) -> bool:
    """Return whether `shown` is the output, in which a line "..." stands for lines left out."""
    parts = map(re.escape, shown.split(_LEFT_OUT))
    return re.fullmatch(r"\n(?:.*\n)*?".join(parts), output) is not None


@pytest.mark.parametrize(("shown", "agrees"), [
    ("a\nb\nc\nd\n", True), ("a\n...\nd\n", True), ("a\n...\nc\nd\n", True),
    ("a\n...\ne\n", False), ("a\nc\n...\nd\n", False), ("b\n...\nd\n", False), ("a\n", False),
])  # fmt: skip
def test_an_excerpt_leaves_out_lines_and_changes_none(shown: str, agrees: bool) -> None:
    assert _is_excerpt(shown, "a\nb\nc\nd\n") == agrees


def test_there_are_commands_to_check() -> None:
    assert len(_blocks()) >= 8


def test_scene_files_are_as_shown() -> None:
    shown = "".join(path.read_text() for path in DOCS)
    files = list((ROOT / "docs").glob("*.toml"))
    assert files
    for path in files:
        assert f"```toml\n{path.read_text()}```" in shown, path.name


def test_links_and_pictures_are_there() -> None:
    for path in [*DOCS, README, CONTRIBUTING]:
        for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text()):
            # Above the checkout are the pages of its host.
            beyond = path == README and target.startswith("../../")
            assert beyond or (path.parent / target).exists(), f"{path.name}: {target}"


def test_pictures_of_the_report_are_current() -> None:
    """The stored numbers beside each picture are those of today, digit for digit."""
    stored = sorted((ROOT / "docs/figures").glob("figure-*.csv"))
    assert len(stored) == 5
    found = {each.plan.stem: each for each in figures.findings()}
    numbers = {name: figures.curve_numbers(each) for name, each in found.items()}
    together = figures.together_picture(found["figure-07"], found["figure-07-corrected"])
    numbers["figure-07-together"] = together.numbers
    numbers["figure-points"] = figures.points_picture().numbers
    for path in stored:
        assert csv_text(numbers[path.stem]) == path.read_text(), path.name
        assert path.with_suffix(".svg").exists()


@pytest.mark.sampled
@pytest.mark.parametrize("path", [*DOCS, README], ids=lambda path: path.stem)
def test_examples_in_the_documents_run(path: Path, monkeypatch: Patch) -> None:
    """Shown outputs and the numbers of pictures are current: `python -m docs.gallery.build`."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    text = path.read_text()
    printed = []
    for step in executed(text, path.name):
        printed.append(step.printed)
        shown = shown_output(text, step)
        assert shown is None or is_current(shown, step.printed), step.printed
        file = picture_file(path, step)
        if step.figure is not None and file is not None:
            stored = file.with_suffix(".csv").read_text()
            assert numbers_agree(stored, csv_text(picture_of(step.figure).numbers)), file.name
    assert path != README or "[2.408592 7.225776] True" in "".join(printed)


def numbers_agree(stored: str, today: str) -> bool:
    """Return whether the numbers of a picture agree to a thousandth of the largest of a curve."""
    old, new = (list(csv.reader(each.splitlines()))[1:] for each in (stored, today))
    if [row[:2] for row in old] != [row[:2] for row in new]:
        return False
    for curve in {tuple(row[:2]) for row in old}:
        was, now = (
            np.array(
                [[float(x or 0.0) for x in row[2:]] for row in rows if tuple(row[:2]) == curve]
            )
            for rows in (old, new)
        )
        largest = np.nanmax(np.abs(was), axis=0, initial=0.0)
        if not (np.abs(was - now) <= 1e-3 * largest + 1e-9)[~np.isnan(was)].all():
            return False
    return True


def test_readme_is_current_and_short(printed: Printed) -> None:
    text = README.read_text()
    (output,) = re.findall(r"```text\n(.*?)```", text, re.DOTALL)
    assert printed("compare --case 3") == output
    assert len(text.splitlines()) <= 120
    assert len(text.split()) <= 700


def test_scene_file_in_the_reference_is_one(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", SCENES.read_text(), re.DOTALL)
    path = tmp_path / "brick.toml"
    path.write_text(text)
    scene = read_scene(path)
    assert scene.name == "spinning brick"
    assert scene.torque.is_zero
    every = tomllib.loads(text)
    keys = {f"{name}.{key}" for name, table in every.items() if name != "name" for key in table}
    assert keys <= set(re.findall(r"`(\w+\.\w+)`", SCENES.read_text()))


@pytest.mark.sampled
@pytest.mark.parametrize("command", tables(__file__)["json_has_the_documented_fields"])
def test_json_has_the_documented_fields(command: str, printed: Printed, monkeypatch: Patch) -> None:
    monkeypatch.chdir(ROOT)
    record = json.loads(printed(f"{command} --format json"))
    Draft202012Validator(schema_of(command.split()[0])).validate(record)


def test_schema_describes_each_field_of_each_verb() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    assert {f"verb-{verb}" for verb in VERBS} <= set(SCHEMA["$defs"])
    # Without a fragment, the file describes the output of any command.
    each = [name for name in SCHEMA["$defs"] if name.startswith("verb-")]
    assert [one["$ref"] for one in SCHEMA["anyOf"]] == [f"#/$defs/{name}" for name in each]
    for name, each in SCHEMA["$defs"].items():
        assert each["description"], name
        for path, meaning in fields(SCHEMA, each, name):
            assert meaning, path


@pytest.mark.parametrize(("page", "text"), BUILT)
def test_page_is_made_of_the_data(page: str, text: str) -> None:
    """Lines are at most 120 characters long, except in tables."""
    assert (ROOT / page).read_text() == text
    assert page.endswith(".json") or all(
        len(line) <= 120 for line in text.splitlines() if not line.startswith("|")
    )


def test_a_field_that_is_not_documented_is_found(printed: Printed) -> None:
    record = json.loads(printed("doctor --format json"))
    for changed in (record | {"more": 1}, record | {"missing": None}, {"schema": 1}):
        assert not Draft202012Validator(schema_of("doctor")).is_valid(changed)
    for changed, is_valid in ((record, True), ({}, False), (record | {"more": 1}, False)):
        assert Draft202012Validator(SCHEMA).is_valid(changed) == is_valid


def write_anew() -> None:
    """Replace the output of every block by the present output of the command; build the article."""
    import contextlib
    import io
    import os

    os.environ["COLUMNS"] = "100"
    article.main()
    for page, text in BUILT:
        (ROOT / page).write_text(text)
    for path in DOCS:

        def anew(match: re.Match[str]) -> str:
            command = match.group(1)
            if _LEFT_OUT in match[0]:
                return match[0]
            buffer = io.StringIO()
            with contextlib.redirect_stdout(buffer):
                assert main(shlex.split(command)[1:]) == 0, command
            return f"```text\n$ {command}\n{buffer.getvalue()}```"

        text = path.read_text()
        path.write_text(re.sub(r"```text\n\$ ([^\n]*)\n.*?```", anew, text, flags=re.DOTALL))


if __name__ == "__main__":
    write_anew()
