"""The examples in all docstrings run, and give what they show."""

import doctest
import importlib
from pathlib import Path

import pytest

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
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0


def test_each_package_has_examples() -> None:
    assert len(MODULES) > 25
