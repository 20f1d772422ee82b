"""The budget of words: documents, docstrings, and what repeats itself on a page."""

import ast
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
DOCUMENTS, DOCSTRINGS, FILES = 80_000, 70_000, 50
LIMITS = {"CHANGELOG.md": 1500, "README.md": 700}
# Outside the public API, functions whose docstring has more lines than their body.
LONGER = 60
# Share of the sequences of four words that occurred before on the page.
REPEATED = 0.015
_CODE = re.compile(r"```.*?```|`[^`\n]*`|^\|[^\n]*\|$|\]\([^)\n]*\)", re.DOTALL | re.MULTILINE)
_DEFINITIONS = (ast.Module, ast.ClassDef, ast.FunctionDef)


def documents() -> dict[str, int]:
    """Return the number of words of each page."""
    pages = [*(ROOT / "docs").rglob("*.md"), *(ROOT / name for name in LIMITS)]
    return {str(path.relative_to(ROOT)): len(path.read_text().split()) for path in pages}


def docstrings() -> Iterator[tuple[str, ast.AST, str]]:
    """Yield path, definition and docstring of everything in the package that has one."""
    for path in sorted((ROOT / "pyharness").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, _DEFINITIONS) and (text := ast.get_docstring(node)):
                yield str(path.relative_to(ROOT)), node, text


def grown(counts: dict[str, int]) -> list[str]:
    """Return the pages that have more words than at the last commit, or else the longest."""
    found = {}
    for name, count in counts.items():
        shown = subprocess.run(["git", "show", f"HEAD:{name}"], cwd=ROOT, capture_output=True)
        found[name] = count - len(shown.stdout.split())
    chosen = sorted((name for name in found if found[name] > 0), key=lambda name: -found[name])
    return [f"{name}: {counts[name]} words, {found[name]:+}" for name in chosen] or [
        f"{name}: {counts[name]} words" for name in sorted(counts, key=lambda n: -counts[n])[:10]
    ]


def repeated(text: str) -> float:
    """Return the share of sequences of four words that occurred before."""
    words = re.findall(r"[a-z][a-z'-]+", _CODE.sub(" ", text).lower())
    sequences = list(zip(words, words[1:], words[2:], words[3:], strict=False))
    return 1.0 - len(set(sequences)) / max(1, len(sequences))


def test_documents_keep_to_their_budget() -> None:
    counts = documents()
    assert sum(counts.values()) <= DOCUMENTS, grown(counts)
    assert len([name for name in counts if name.startswith("docs/")]) <= FILES
    for name, limit in LIMITS.items():
        assert counts[name] <= limit, name


@pytest.mark.campaign
def test_docstrings_keep_to_their_budget() -> None:
    import pyharness

    every = list(docstrings())
    assert sum(len(text.split()) for _, _, text in every) <= DOCSTRINGS
    longer = [
        f"{path}: {node.name}"
        for path, node, text in every
        if isinstance(node, ast.FunctionDef)
        and node.name not in (*pyharness.__all__, "Taylor")
        and text.count("\n") + 1 > _lines(node.body[1:])
    ]
    assert len(longer) <= LONGER, longer


def _lines(body: list[ast.stmt]) -> int:
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 1


def test_pages_do_not_repeat_themselves() -> None:
    shares = {name: repeated((ROOT / name).read_text()) for name in documents()}
    assert {name: round(share, 4) for name, share in shares.items() if share > REPEATED} == {}
    assert repeated("The cat sat on the mat. The cat sat on the hat.") > 0.2
