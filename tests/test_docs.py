"""README and reports: commands print what stands there, examples run, every link is whole."""

import re
import shlex
from pathlib import Path

import pytest

from pyharness import read_scene
from pyharness.cli.main import VERBS, main
from pyharness.history import figures
from pyharness.views.csv import csv_text
from tests.conftest import Printed

ROOT = Path(__file__).parent.parent
DOCS = sorted((ROOT / "docs").rglob("*.md"))
README = ROOT / "README.md"


def _blocks() -> list[tuple[Path, str, str]]:
    found = []
    for path in DOCS:
        for block in re.findall(r"```text\n\$ (.*?)```", path.read_text(), re.DOTALL):
            command, _, output = block.partition("\n")
            found.append((path, command, output))
    return found


@pytest.mark.parametrize(("path", "command", "output"), _blocks())
def test_output_is_current(
    path: Path, command: str, output: str, printed: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`python -m tests.test_docs` writes the blocks anew."""
    monkeypatch.chdir(ROOT)
    assert printed(command.removeprefix("pyharness ")) == output, f"{path.name}: {command}"


def test_there_are_commands_to_check() -> None:
    assert len([path for path, _, _ in _blocks() if path.name == "findings.md"]) >= 8


def test_scene_files_are_as_shown() -> None:
    shown = "".join(path.read_text() for path in DOCS)
    files = list((ROOT / "docs").glob("*.toml"))
    assert files
    for path in files:
        assert f"```toml\n{path.read_text()}```" in shown, path.name


def test_links_and_pictures_are_there() -> None:
    for path in [*DOCS, README]:
        for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text()):
            # Above the checkout are the pages of its host.
            beyond = path == README and target.startswith("../../")
            assert beyond or (path.parent / target).exists(), f"{path.name}: {target}"


def test_pictures_of_the_report_are_current() -> None:
    """The stored numbers beside each picture are those of today, digit for digit."""
    stored = sorted((ROOT / "docs/figures").glob("figure-*.csv"))
    assert len(stored) == 4
    found = {each.plan.stem: each for each in figures.findings()}
    numbers = {name: figures.curve_numbers(each) for name, each in found.items()}
    together = figures.together_picture(found["figure-07"], found["figure-07-corrected"])
    numbers["figure-07-together"] = together.numbers
    for path in stored:
        assert csv_text(numbers[path.stem]) == path.read_text(), path.name
        assert path.with_suffix(".svg").exists()


@pytest.mark.parametrize("path", [*DOCS, README], ids=lambda path: path.name)
def test_examples_in_the_documents_run(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for block in re.findall(r"```python\n(.*?)```", path.read_text(), re.DOTALL):
        exec(compile(block, path.name, "exec"), {})
    printed = capsys.readouterr().out
    assert path != README or (printed.startswith("stopped Stop(") and printed.count("23.12") == 2)


def _without_times(text: str) -> list[str]:
    """Drop what changes from run to run and with SciPy: times, and the table of solve_ivp."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("solve_ivp"))
    return [re.sub(r" +\d+\.\d\d$", "", line) for line in lines[:start] + lines[start + 5 :]]


def test_readme_is_current(printed: Printed, tmp_path: Path) -> None:
    text = README.read_text()
    output, scene_file = (
        re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)[0] for language in ("text", "toml")
    )
    assert _without_times(printed("compare --case 3")) == _without_times(output)
    path = tmp_path / "brick.toml"
    path.write_text(scene_file)
    scene = read_scene(path)
    assert scene.name == "spinning brick"
    assert scene.torque.is_zero
    for verb in VERBS:
        assert f"| `{verb}" in text, verb


def write_anew() -> None:
    """Replace the output of every block by what the command prints today."""
    import contextlib
    import io

    for path in DOCS:

        def anew(match: re.Match[str]) -> str:
            command = match.group(1)
            buffer = io.StringIO()
            with contextlib.redirect_stdout(buffer):
                assert main(shlex.split(command)[1:]) == 0, command
            return f"```text\n$ {command}\n{buffer.getvalue()}```"

        text = path.read_text()
        path.write_text(re.sub(r"```text\n\$ (.*?)\n.*?```", anew, text, flags=re.DOTALL))


if __name__ == "__main__":
    write_anew()
