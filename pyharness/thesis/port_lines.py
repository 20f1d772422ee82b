"""Lines of the Fortran ports and of the twins, and the corresponding cards.

The port names its cards in comments; `data/cards/places.toml` names the lines of the twin.
"""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from pyharness.model.facts import shipped

_MARGIN = re.compile(r"^(.*?)\s*!\s*(\d+(?:[-,\s]+\d+)*)\s*$")
_TWINS = Path(__file__).parent
PORT = "fortran/original"
"""The folder of the Fortran port in the source repository."""


class Place(NamedTuple):
    """A line of a source file: name of the file, number from 1, and text."""

    file: str
    line: int
    text: str


def port_file(program: str) -> str:
    """Return the name of a program's port in the folder `PORT`."""
    return f"{program.replace('-', '_')}.fypp"


def port_lines(program: str) -> Iterator[tuple[Place, str]]:
    """Yield each line of a port that corresponds to cards, with the card numbers as text."""
    file = port_file(program)
    for number, text in enumerate(_lines(shipped(PORT) / file), 1):
        if match := _MARGIN.match(text):
            yield Place(file, number, match[1].strip()), match[2]


def switch_at(place: Place) -> tuple[str, bool] | None:
    """Return the defect or reading on which a port's line depends, and whether it is active.

    Return None if the line depends on no single switch.
    """
    lines = _lines(shipped(PORT) / place.file)
    depth = _indentation(lines[place.line - 1])
    beyond_else = False
    for line in filter(str.strip, reversed(lines[: place.line - 1])):
        text, here = line.strip(), _indentation(line)
        # The line opens a block around the place, or the branch before the `else` around it.
        if here < depth or (beyond_else and here == depth and text.startswith(("if ", "else if "))):
            if match := re.fullmatch(r"if \(listing%(\w+)\) then", text):
                return match[1].replace("_", "-"), not beyond_else
            depth, beyond_else = here, text == "else"
    return None


def twin_line(file: str, text: str) -> Place:
    """Return the line of a twin with this text; raise ValueError unless there is exactly one."""
    where = [n for n, line in enumerate(_lines(_TWINS / file), 1) if line.strip() == text]
    if len(where) != 1:
        raise ValueError(f"{text!r} occurs {len(where)} times in {file}")
    return Place(file, where[0], text)


@cache
def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def _indentation(line: str) -> int:
    return len(line) - len(line.lstrip())
