"""Lines that may be changed, a fair draw from them, and the changes known to have no effect."""

import ast
import difflib
import random
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.campaigns.mutations import python_source, text_source
from tests.campaigns.mutations.text_source import language_of
from tests.campaigns.mutations.tree import ROOT

EQUIVALENT = Path(__file__).parent / "equivalent.toml"
# Code that computes, judges, reads and keeps numbers. Excluded are `cli`, `views`, `edition`,
# pictures and reports, whose texts `tests/outputs` compares, and `bench`, whose results are run
# times.
_PYTHON = ("model", "engine", "truth", "thesis", "checks", "sweep", "history/claims")
# Random scenes are no results.
_OTHER_PYTHON = re.compile(
    r"report[^/]*$|picture[^/]*$|sentences|__init__|facts|ledger|checks/scenes/"
)
# Excluded are `levels.c` and `levels.f90`, which choose among instruction sets of equal results,
# and what f2py reads, where a change is a signature that does not fit.
_OTHERS = ("fortran/original/*.f90", "fortran/original/*.fypp", "fortran/many/*.f90",
           "fortran/many/*.c", "fortran/modern/*.f90", "fortran/modern/*.c", "fortran/*.c",
           "web/programs/*.js", "web/port.js")  # fmt: skip
_NO_RESULT = re.compile(r"levels\.|wide_functions|words\.fypp")


@dataclass(frozen=True)
class Mutation:
    """A change to one line, known by its file, operator, line and number among equal lines."""

    file: str
    line: int
    operator: str
    source: str  # the line, with each run of blanks as one
    occurrence: int
    changed: Callable[[], str]

    @property
    def id(self) -> str:
        """Return a name that does not change with edits elsewhere."""
        return f"{self.operator} {self.occurrence}: {self.source}"

    @property
    def language(self) -> str:
        """Return the language of the file."""
        return language_of(self.file)

    @property
    def is_compiled(self) -> bool:
        """Return whether a build is needed."""
        return self.file.startswith("fortran/")

    def diff(self) -> str:
        """Return the change as a difference of two texts."""
        before = (ROOT / self.file).read_text().splitlines()
        lines = difflib.unified_diff(before, self.changed().splitlines(), lineterm="", n=0)
        return "\n".join(f"{line}" for line in list(lines)[2:])

    def function(self) -> str | None:
        """Return the name of the function around the line; None outside of all."""
        text = (ROOT / self.file).read_text()
        return _python_function(text, self.line) if self.language == "Python" else _other_function(
            text, self.line, self.language)  # fmt: skip


def files() -> list[str]:
    python = [path for folder in _PYTHON for path in (ROOT / "pyharness" / folder).rglob("*.py")]
    kept = [path for path in python if not _OTHER_PYTHON.search(path.as_posix())]
    others = [path for pattern in _OTHERS for path in ROOT.glob(pattern)]
    kept += [path for path in others if not _NO_RESULT.search(path.name)]
    return sorted(str(path.relative_to(ROOT)) for path in kept)


def mutations(file: str) -> list[Mutation]:
    text = (ROOT / file).read_text()
    language = language_of(file)
    if language == "Python":
        found = python_source.changes(text)
    else:
        found = text_source.changes(text, language)
    lines = text.split("\n")
    seen: Counter[tuple[str, str]] = Counter()
    result = []
    for line, operator, changed in found:
        source = " ".join(lines[line - 1].split())
        seen[operator, source] += 1
        result.append(Mutation(file, line, operator, source, seen[operator, source], changed))
    return result


def lines_of_code(file: str) -> int:
    """Return the number of lines that are neither blank nor a comment."""
    text, language = (ROOT / file).read_text(), language_of(file)
    plain = text_source.blanked(text, language) if language != "Python" else text
    return sum(bool(line.strip()) and line.strip()[0] != "#" for line in plain.splitlines())


def draw(seed: int | str, only: str = "") -> Iterator[Mutation]:
    """Draw changes without end: a file by its lines of code, a line, an operator, a place.

    Languages are thus drawn in proportion to their lines of code, and an operator with many
    variants is no likelier than one with few. `only` has parts of file names, separated by commas;
    changes to files without any of them are left out of the same sequence. Raise ValueError if no
    file has any of them.
    """
    parts = only.split(",")
    wanted = {file for file in files() if any(part in file for part in parts)}
    if not wanted:
        raise ValueError(f"no file that may be changed has {only} in its name")
    generator = random.Random(f"mutations {seed}")
    names = files()
    weights = [lines_of_code(file) for file in names]
    known: dict[str, list[Mutation]] = {}
    drawn: set[tuple[str, str]] = set()
    while True:
        (file,) = generator.choices(names, weights)
        if file not in known:
            known[file] = mutations(file)
        if not known[file]:
            continue
        line = generator.choice(sorted({each.line for each in known[file]}))
        of_line = [each for each in known[file] if each.line == line]
        operator = generator.choice(sorted({each.operator for each in of_line}))
        one = generator.choice([each for each in of_line if each.operator == operator])
        if (file, one.id) not in drawn:
            drawn.add((file, one.id))
            if file in wanted:
                yield one


def equivalent(path: Path = EQUIVALENT) -> dict[tuple[str, str], str]:
    """Return the reasons why changes have no effect, by file and name."""
    table = tomllib.loads(path.read_text())
    return {(file, id): why for file, of_file in table.items() for id, why in of_file.items()}


def stale(known: dict[tuple[str, str], str]) -> list[str]:
    """Return the entries that no longer name a change."""
    every = {file: {each.id for each in mutations(file)}
             for file in {file for file, _ in known} if (ROOT / file).exists()}  # fmt: skip
    return [f"{file}: {id}" for file, id in known if id not in every.get(file, set())]


def _python_function(text: str, line: int) -> str | None:
    def within(body: list[ast.stmt], prefix: str) -> str | None:
        for node in body:
            if node.lineno <= line <= (node.end_lineno or 0):
                if isinstance(node, ast.FunctionDef):
                    return prefix + node.name
                if isinstance(node, ast.ClassDef):
                    return within(node.body, f"{prefix}{node.name}.")
        return None

    return within(ast.parse(text).body, "")


_BEGIN = {
    text_source.FORTRAN: re.compile(
        r"^\s*(?!end )[\w() =,]*?\b(?:subroutine|function) (\w+)", re.I
    ),
    text_source.C: re.compile(r"^(?:[\w*]+ )+\*?(?:OF_LEVEL\()?(\w+)(?:, LEVEL\))?\([^;]*$"),
    text_source.JAVASCRIPT: re.compile(r"^(?:export )?function (\w+)"),
}


def functions_in(file: str) -> set[str]:
    """Return the names of all functions in a file that is not in Python."""
    text, language = (ROOT / file).read_text(), language_of(file)
    lines = text_source.blanked(text, language).split("\n")
    return {found[1].lower() for each in lines if (found := _BEGIN[language].match(each))}


def _other_function(text: str, line: int, language: str) -> str | None:
    for before in reversed(text_source.blanked(text, language).split("\n")[:line]):
        if found := _BEGIN[language].match(before):
            return str(found[1]).lower()
    return None
