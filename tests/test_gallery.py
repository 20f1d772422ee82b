"""The gallery: its pages have their parts, its answers have the printed numbers, its notebooks run.

`tests/test_docs.py` executes the pages, and compares outputs and pictures with the stored ones.
"""

import ast
import json
import re
import warnings
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

import pyharness
from docs.gallery import build
from docs.gallery.build import PAGES, answer, examples, page, question
from docs.gallery.execution import OUTPUT, PICTURE, PYTHON, executed, is_current, shown_output
from pyharness.edition.documents import notebook
from tests.conftest import Patch, Printed

_PUBLIC = {f"pyharness.{name}" for name in ("events", "torques")}
TEXTS = {name: text for name, (_, text) in examples().items()}
_NUMBER = re.compile(r"\d+(?:[ ,]\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?")


def test_every_page_is_in_the_index() -> None:
    assert {path.stem for path in build.HERE.glob("*.md")} == {*PAGES, "README"}
    assert len(TEXTS) >= 12
    files = [path for path in build.HERE.iterdir() if path.suffix in (".svg", ".png", ".csv")]
    assert {path.stem for path in files} == TEXTS.keys()
    assert all(path.stat().st_size < 100_000 for path in files)


@pytest.mark.parametrize("name", TEXTS)
def test_example_has_its_parts(name: str) -> None:
    text = TEXTS[name]
    assert question(text).endswith("?")
    first = PYTHON.search(text)
    assert first is not None
    introduction = text[: first.start()].partition("\n")[2]
    assert 3 <= len(re.findall(r"[.!?:](?=\s+[A-Z`]|\s*$)", introduction.strip())) <= 7
    assert 10 <= len([line for line in first[1].splitlines() if line.strip()]) <= 34
    assert all(len(line) <= 100 for block in PYTHON.findall(text) for line in block.splitlines())
    assert all(len(line) <= 120 for line in text.splitlines())
    assert len(PYTHON.findall(text)) == 2
    (picture,) = PICTURE.findall(text)
    assert Path(picture).stem == name
    assert len(OUTPUT.findall(text)) == 1


@pytest.mark.parametrize("name", TEXTS)
def test_example_uses_public_names_only(name: str) -> None:
    for block in PYTHON.findall(TEXTS[name]):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("pyharness"):
                found = {each.name for each in node.names}
                assert node.module in _PUBLIC or found <= {*pyharness.__all__, "Taylor"}, (
                    node.module
                )
            elif isinstance(node, ast.Import):
                assert not any(each.name.startswith("pyharness") for each in node.names)


@pytest.mark.parametrize("name", TEXTS)
def test_numbers_of_the_answer_are_printed(name: str) -> None:
    """Each number of the answer is in the output of the example, or in its code or introduction."""
    text = TEXTS[name]
    (output,) = OUTPUT.findall(text)
    known = output + text[: text.index("```output")]
    for number in _NUMBER.findall(answer(text)):
        plain = number.replace(",", "").replace(" ", "")
        pattern = rf"(?<![\d.]){re.escape(plain)}(?![\d]|\.\d)"
        assert re.search(pattern, known.replace("_", "").replace(",", "")), number


@pytest.mark.parametrize(("shown", "printed", "agrees"), [
    ("4 flips in 1.25 s", "4 flips in 1.25 s", True),
    ("4 flips in 1.25 s", "4 flips in 1.27 s", True),
    ("4 flips in 1.25 s", "4 flips in 1.28 s", False),
    ("4 flips in 1.25 s", "5 flips in 1.25 s", False),
    ("4 flips in 1.25 s", "4 turns in 1.25 s", False),
    ("error 2e-14", "error 9e-14", True),
    ("error 2e-14", "error 3e-13", False),
    ("error 2.0e-03", "error 2.2e-03", True),
    ("error 2.0e-03", "error 2.3e-03", False),
    ("a b", "a  b", True),
    ("1.0", "1.0 2.0", False),
])  # fmt: skip
def test_outputs_are_compared_apart_from_rounding(shown: str, printed: str, agrees: bool) -> None:
    assert is_current(shown, printed) == agrees


def test_command_of_the_wing_nut_runs(tmp_path: Path, monkeypatch: Patch, printed: Printed) -> None:
    """The animation takes half a minute, and is not made here."""
    monkeypatch.chdir(tmp_path)
    text = TEXTS["wing-nut"]
    (scene,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    (command,) = re.findall(r"```sh\npyharness (.*?)\n```", text)
    (tmp_path / "nut.toml").write_text(scene)
    run, _, file = command.partition(" --animate ")
    assert file == "nut.gif"
    assert "error amplification" in printed(run)
    assert "--animate FILE" in printed("help run")


def test_outputs_belong_to_their_examples() -> None:
    text = "# A\n\n```python\nx = 1\nprint(x)\n```\n\n```output\n2\n```\n\n```python\nx += 1\n```\n"
    first, second = executed(text, "a.md")
    assert (first.printed, shown_output(text, first)) == ("1\n", "2\n")
    assert (second.printed, shown_output(text, second)) == ("", None)


def test_build_replaces_outputs_and_draws(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setattr(build, "HERE", tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    text = (
        "# A?\n\n```python\nimport matplotlib.pyplot as plt\nprint(1)\n```\n\n"
        '```python\nplt.subplots()[1].plot([1, 2], label="a")\n```\n\n![a](a.svg)\n'
    )
    path = tmp_path / "a.md"
    path.write_text(text)
    build.rebuild(path)
    once = path.read_text()
    assert once == text.replace("(1)\n```", "(1)\n```\n\n```output\n1\n```")
    assert (tmp_path / "a.csv").read_text() == "plot,curve,x,y,z\n1,a,0.0,1.0,\n1,a,1.0,2.0,\n"
    picture = (tmp_path / "a.svg").read_bytes()
    path.write_text(once.replace("\n1\n", "\n7\n"))
    build.rebuild(path)
    assert path.read_text() == once
    assert (tmp_path / "a.svg").read_bytes() == picture


def test_pages_of_the_site_link_to_their_notebooks(built_site: dict[str, bytes]) -> None:
    for name in PAGES:
        html = built_site[f"docs/gallery/{name}.html"].decode()
        assert f'href="{name}.ipynb"' in html
        assert all(f'src="{each}' in html for each in PICTURE.findall(page(name).read_text()))
        nbformat.validate(json.loads(built_site[f"docs/gallery/{name}.ipynb"]))
    assert "docs/tutorials/integrate-a-body.ipynb" in built_site
    assert b".ipynb" not in built_site["docs/index.html"]
    index = built_site["docs/gallery/README.html"].decode()
    assert all(f'href="{name}.html#' in index for name in PAGES)


def test_notebooks_are_valid(tmp_path: Path) -> None:
    build.write_notebooks(tmp_path)
    files = sorted(tmp_path.glob("*.ipynb"))
    assert {path.stem for path in files} >= {*PAGES, "integrate-a-body"}
    for path in files:
        found = nbformat.reads(path.read_text(), as_version=4)  # type: ignore[no-untyped-call]
        nbformat.validate(found)
        assert len({cell.id for cell in found.cells}) == len(found.cells)
    assert sum(path.stat().st_size for path in files) < 2_000_000


@pytest.mark.parametrize("name", PAGES)
def test_notebook_has_code_output_and_picture_of_its_page(name: str) -> None:
    text = page(name).read_text()
    pictures = {each: (build.HERE / each).read_bytes() for each in PICTURE.findall(text)}
    record = json.loads(notebook(text, pictures))
    cells = [cell for cell in record["cells"] if cell["cell_type"] == "code"]
    assert ["".join(cell["source"]) + "\n" for cell in cells] == PYTHON.findall(text)
    outputs = [each for cell in cells for each in cell["outputs"]]
    printed = ["".join(each["text"]) for each in outputs if each["output_type"] == "stream"]
    assert printed == OUTPUT.findall(text)
    assert sum(each["output_type"] == "display_data" for each in outputs) == len(pictures)
    prose = "".join("".join(c["source"]) for c in record["cells"] if c["cell_type"] != "code")
    assert "](" not in prose
    assert all(question(TEXTS[Path(each).stem]) in prose for each in pictures)


@pytest.mark.campaign
def test_a_notebook_runs_in_jupyter(tmp_path: Path) -> None:
    """A kernel executes the notebook of a page, prints its output and shows its picture."""
    text = TEXTS["wing-nut"]
    cells = nbformat.reads(notebook(text, {}).decode(), as_version=4)  # type: ignore[no-untyped-call]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        NotebookClient(
            cells, timeout=120, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
        ).execute()
    outputs = [each for cell in cells.cells for each in cell.get("outputs", [])]
    assert [each.output_type for each in outputs] == ["stream", "display_data"]
    assert is_current(OUTPUT.findall(text)[0], outputs[0].text)
    assert "image/png" in outputs[1].data
