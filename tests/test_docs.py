"""The reports: every command in them is run, and prints what stands there; every link is whole."""

import re
import shlex
from pathlib import Path

import pytest

from pyharness.cli.main import main
from pyharness.history import figures
from pyharness.views.csv import csv_text

ROOT = Path(__file__).parent.parent
DOCS = sorted((ROOT / "docs").glob("*.md"))


def _blocks() -> list[tuple[Path, str, str]]:
    found = []
    for path in DOCS:
        for block in re.findall(r"```text\n\$ (.*?)```", path.read_text(), re.DOTALL):
            command, _, output = block.partition("\n")
            found.append((path, command, output))
    return found


@pytest.mark.parametrize(("path", "command", "output"), _blocks())
def test_output_is_current(
    path: Path, command: str, output: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """`python -m tests.test_docs` writes the blocks anew."""
    assert main(shlex.split(command)[1:]) == 0
    assert capsys.readouterr().out == output, f"{path.name}: {command}"


def test_there_are_commands_to_check() -> None:
    assert len([path for path, _, _ in _blocks() if path.name == "findings.md"]) >= 8


def test_links_and_pictures_are_there() -> None:
    for path in [*DOCS, ROOT / "README.md"]:
        for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text()):
            assert (path.parent / target).exists(), f"{path.name}: {target}"


def test_pictures_of_the_report_are_current() -> None:
    """The stored numbers beside each picture are those of today, digit for digit."""
    stored = sorted((ROOT / "docs/figures").glob("figure-*.csv"))
    assert len(stored) == 3
    names = {path.stem for path in stored}
    for found in figures.findings():
        if found.plan.stem in names:
            path = ROOT / "docs/figures" / f"{found.plan.stem}.csv"
            assert csv_text(figures.curve_numbers(found)) == path.read_text(), path.name
            assert path.with_suffix(".svg").exists()


def test_examples_in_the_documents_run() -> None:
    for path in DOCS:
        for block in re.findall(r"```python\n(.*?)```", path.read_text(), re.DOTALL):
            exec(compile(block, path.name, "exec"), {})


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
