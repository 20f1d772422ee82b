"""`tests/style.py`: what it reads of each kind of file, and what it leaves alone."""

import re
from pathlib import Path

import pytest

from tests.style import ROOT, TERMS, files, findings, private_imports

_PROCEDURE = re.compile(
    r"^(?!\s*end\b)[^!\n]*\b(?:subroutine|function)\s+(\w+)\s*\(([^)]*)\)", re.M
)


@pytest.mark.parametrize(("name", "text", "lines"), [
    ("a.md", "A text.\nIt hangs on the scene.\n", [2]),
    ("a.md", "It hangs\non the scene.\n", [1]),
    ("a.md", '```sh\nhangs on\n```\n`hangs on` and "hangs on"\n', []),
    ("a.py", '"""Return it.\n\nIt hangs on the scene.\n"""\n', [3]),
    ("a.py", "x = 1  # it hangs on the scene\n", [1]),
    ("a.py", 'text = "it hangs on the scene"\n', []),
    ("a.py", 'def f():\n    """What it returns."""\n', [2]),
    ("a.py", 'def f():\n    """Return what it is."""\n', []),
    ("a.f90", "x = 1\n!! It hangs on the scene.\n", [2]),
    ("a.f90", "x = 1  ! it hangs on the scene\n", [1]),
    ("a.f90", "call hangs_on(the)\n", []),
    ("a.c", "int a;\n/* It\n   hangs on the scene. */\n", [3]),
    ("a.js", "let a = 1;  // it hangs on the scene\n", [1]),
    ("a.js", "let a = 'hangs on';\n", []),
])  # fmt: skip
def test_expressions_are_found_in_prose_alone(
    tmp_path: Path, name: str, text: str, lines: list[int]
) -> None:
    path = tmp_path / name
    path.write_text(text)
    assert [line for line, *_ in findings(path)] == lines


@pytest.mark.parametrize(("text", "found"), [
    (
        "from pyharness.bench.random_loads import _LENGTHS",
        ["pyharness.bench.random_loads._LENGTHS"],
    ),
    ("def f():\n    from tests.attitude_errors import _draw", ["tests.attitude_errors._draw"]),
    ("from pyharness.bench._own import name", ["pyharness.bench._own._own"]),
    ("from pyharness.checks.judge import _own", []),
    ("from pyharness import _kernels", []),
    ("from collections import _private", []),
])  # fmt: skip
def test_private_names_of_other_packages_are_found(text: str, found: list[str]) -> None:
    assert [name for _, name in private_imports(text, "pyharness.checks")] == found


def test_each_expression_has_its_replacement() -> None:
    assert all(instead.strip() for part in TERMS.values() for instead in part.values())


def test_sources_and_documents_of_every_language_are_read() -> None:
    suffixes = {".py", ".f90", ".fypp", ".c", ".js", ".md", ".toml", ".yml", ".build", ""}
    assert {path.suffix for path in files()} == suffixes


def test_kernels_have_at_most_eight_arguments() -> None:
    """More of them go into a type. f2py reads the api files, which have none."""
    found = {}
    for path in (ROOT / "fortran").glob("*/*.f*"):
        for name, arguments in _PROCEDURE.findall(re.sub(r"&\s*\n\s*&?", "", path.read_text())):
            found[f"{path.name}: {name}"] = len(arguments.split(","))
    assert len(found) > 200
    assert {name: count for name, count in found.items() if count > 8} == {}
