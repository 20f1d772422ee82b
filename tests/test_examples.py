"""The examples in all docstrings run, and give what they show."""

import ast
import doctest
import importlib
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from pyharness.model import attitude_picture
from tests.conftest import Patch

ROOT = Path(__file__).parent.parent
MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "pyharness").rglob("*.py"))
    if ">>> " in path.read_text()
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_the_docstrings_run(name: str, tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "tests/brick.toml", tmp_path)
    # Three pictures of an animation, since each takes a tenth of a second.
    monkeypatch.setattr(attitude_picture, "_LONGEST", 0.1)
    result = doctest.testmod(importlib.import_module(name))
    # What a decorator returns may hide its docstring from doctest.
    text = (ROOT / name.replace(".", "/")).with_suffix(".py").read_text()
    written = [each for each in map(ast.get_docstring, _documented(text)) if each]
    parse = doctest.DocTestParser().get_examples
    assert result.attempted == sum(len(parse(each)) for each in written) > 0
    assert result.failed == 0


def _documented(text: str) -> Iterator[ast.Module | ast.ClassDef | ast.FunctionDef]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            yield node


def test_each_package_has_examples() -> None:
    assert len(MODULES) > 25
