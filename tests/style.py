"""`python -m tests.style [FILE ...]`: find what the project's prose and imports do not use.

Expressions are searched in docstrings and comments of Python, Fortran and C, and in documents,
outside code and quotations; `style.toml` has them. A private name that is imported from another
package is found too. Exit status 1 if there is any.
"""

import ast
import io
import re
import sys
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
TERMS = tomllib.loads((Path(__file__).parent / "style.toml").read_text())
_FOLDERS = (
    "pyharness", "fortran", "docs", "tests",
    "web/programs", "web/laboratory", "web/body", "web/story",
)  # fmt: skip
_SINGLE = ("README.md", "CONTRIBUTING.md", "Makefile", "meson.build", "pyproject.toml")
_SHARED = ("_build", "_kernels", "_many", "_solver")
_NOT = ("_build.py",)  # written by the build
_CODE = re.compile(
    r"```.*?```|``.*?``|`[^`]*`|\$[^$]*\$|\"[^\"\n]*\"|“[^”]*”|\]\([^)]*\)|(?<!\w)'[^'\n]+'(?!\w)"
    r"|^ *(>>>|\.\.\.) .*?$",
    re.DOTALL | re.MULTILINE,
)
# An expression may continue on the next line.
PATTERNS = [
    (re.compile(rf"\b({each})\b".replace(" ", r"\s+"), re.IGNORECASE), instead)
    for each, instead in TERMS["instead"].items()
]


def files() -> list[Path]:
    """Return the files whose prose is checked."""
    found = [path for folder in _FOLDERS for path in (ROOT / folder).rglob("*")]
    found += [ROOT / name for name in _SINGLE]
    found += [*(ROOT / ".github").rglob("*.yml"), *(ROOT / ".ci").glob("*")]
    return sorted(path for path in found if _is_read(path) and path.name not in _NOT)


def _is_read(path: Path) -> bool:
    kept = (".py", ".f90", ".fypp", ".c", ".js", ".md", ".toml", ".yml", ".build", "")
    return path.suffix in kept and path.is_file() and path.name != "style.toml"


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the passages of a file that people read, each with its first line."""
    text = path.read_text()
    if path.suffix == ".md":
        yield 1, text
    elif path.suffix == ".py":
        yield from _docstrings(text)
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT:
                yield token.start[0], token.string.strip("# ")
    elif path.suffix in (".c", ".js"):
        for found in re.finditer(r"/\*((?:.|\n)*?)\*/|(?<!:)//(.*)$", text, re.MULTILINE):
            yield text.count("\n", 0, found.start()) + 1, found[1] or found[2]
    elif path.suffix in (".f90", ".fypp"):
        for number, line in enumerate(text.split("\n"), 1):
            comment = re.search(r"!+(?!\$)([^!]*)$", line)
            if comment and not re.search(r"['\"]", line):
                yield number, comment[1]

    else:
        for found in re.finditer(r"(?:^|[ \t])#+ (.*)$", text, re.MULTILINE):
            yield text.count("\n", 0, found.start(1)) + 1, found[1]


def _docstrings(text: str) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            found = ast.get_docstring(node, clean=False)
            if found is not None:
                yield node.body[0].lineno, f"\0{found}"


def findings(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield line, expression and what to write instead."""
    for first, passage in prose(path):
        # What is code or quoted is blanked, and keeps its lines.
        plain = _CODE.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), passage)
        for pattern, instead in PATTERNS:
            for found in pattern.finditer(plain):
                yield first + plain.count("\n", 0, found.start()), found[0], instead
        for pattern, instead in TERMS["begin"].items():
            if begin := re.match(rf"\0({pattern})\b", plain):
                yield first, begin[1], instead


def private_imports(text: str, package: str) -> Iterator[tuple[int, str]]:
    """Yield line and name of each private name that a module imports from another package.

    `package` is that of the module, as in ``pyharness.model`` or ``tests.cli``. The compiled
    modules of pyharness and `_build` are no one's private names.
    """
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.ImportFrom) or node.module is None:
            continue
        parts = node.module.split(".")
        if parts[0] not in ("pyharness", "tests") or ".".join(parts[:2]) == package:
            continue
        for name in [*parts[1:], *(each.name for each in node.names)]:
            if re.match("_(?!_)", name) and name not in _SHARED:
                yield node.lineno, f"{node.module}.{name}"


def main(arguments: list[str]) -> int:
    """Print what is found in the files, by default in all."""
    paths = [Path(each).resolve() for each in arguments] or files()
    count = 0
    for path in paths:
        for line, found, instead in findings(path):
            shown = " ".join(found.split())
            print(f"{path.relative_to(ROOT)}:{line}: '{shown}'; write: {instead}")
            count += 1
        if path.suffix == ".py":
            package = ".".join(path.relative_to(ROOT).with_suffix("").parts[:2])
            for line, name in private_imports(path.read_text(), package):
                print(f"{path.relative_to(ROOT)}:{line}: {name} is private to its package")
                count += 1
    return int(count > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
