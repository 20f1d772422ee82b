"""The README: its output is what the command prints today, its example runs, its file is read."""

import re
from pathlib import Path

import pytest

from pyharness import read_scene
from pyharness.cli.main import main

README = Path(__file__).parent.parent / "README.md"


def _block(language: str, number: int = 0) -> str:
    blocks = re.findall(rf"```{language}\n(.*?)```", README.read_text(), re.DOTALL)
    block: str = blocks[number]
    return block


def _without_times(text: str) -> list[str]:
    """Drop what changes from run to run and with SciPy: times, and the table of solve_ivp."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("solve_ivp"))
    kept = lines[:start] + lines[start + 5 :]
    return [re.sub(r" +\d+\.\d\d$", "", line) for line in kept]


def test_output_is_current(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "--case", "3"]) == 0
    assert _without_times(capsys.readouterr().out) == _without_times(_block("text"))


def test_python_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(_block("python"), "README.md", "exec"), {})
    assert capsys.readouterr().out.startswith("stopped Stop(step=")
    exec(compile(_block("python", 1), "README.md", "exec"), {})
    assert capsys.readouterr().out.count("23.12") == 2


def test_scene_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "brick.toml"
    path.write_text(_block("toml"))
    scene = read_scene(path)
    assert scene.name == "spinning brick"
    assert scene.torque.is_zero


def test_every_verb_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    verbs = re.findall(r"^  (\w+)  ", capsys.readouterr().out, re.MULTILINE)
    assert len(verbs) >= 3
    for verb in verbs:
        assert f"| `{verb}" in README.read_text(), verb
