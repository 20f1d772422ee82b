"""Compare a page that a machine printed with the pages of our programs.

The module needs only Python's standard library, and is also the data package's `machine/judge.py`.
``python judge.py FILE`` has the exit status 0 if one of our pages is equal, 1 if all differ, and 2
if FILE is unreadable or has no page of this form.
"""

import csv
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

PAGES = "pages.csv"
"""The table of the pages, in the script's folder."""

# A number as FORTRAN prints it: asterisks if too long; on the CDC, R or I if not finite.
_FIELD = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)|\*+|[-+]?[RI]")
_LEAST = 6  # least count of numbers in a row of results; lines of the heading have fewer
SHOWN = 5
"""The number of differences shown if no page is equal."""


@dataclass(frozen=True)
class Difference:
    """A number that differs between two pages; `row` and `place` in the row count from 1."""

    row: int
    place: int
    theirs: str
    ours: str


@dataclass(frozen=True)
class Fit:
    """The comparison of another machine's page with one of our pages."""

    program: str
    case: int
    listing: str  # "original", "corrected" or "original with" a reading
    word: str  # arithmetic of the program
    fields: int  # number of compared numbers
    differences: tuple[Difference, ...]

    @property
    def is_whole(self) -> bool:
        return not self.differences

    @property
    def name(self) -> str:
        return f"{self.program}, case {self.case}, {self.listing}, in {self.word}"


def printed_numbers(text: str) -> list[list[str]]:
    """Return the lines of `text` that contain only numbers, each as a list."""
    lines = [line.split() for line in text.splitlines()]
    return [line for line in lines if line and all(map(_FIELD.fullmatch, line))]


def has_rows(lines: Iterable[Sequence[str]]) -> bool:
    """Return whether a line has at least six numbers, as rows of results have."""
    return any(len(line) >= _LEAST for line in lines)


def split_page(lines: Sequence[list[str]]) -> tuple[list[list[str]], list[list[str]]]:
    """Return the heading's lines of numbers (moments and torques), and the rows of results."""
    begin = next((n for n, line in enumerate(lines) if len(line) >= _LEAST), len(lines))
    return [*lines[:begin]], [*lines[begin:]]


def rows_of_form(
    lines: Sequence[Sequence[str]], head: Sequence[Sequence[str]], width: int
) -> list[Sequence[str]]:
    """Return the lines with `width` numbers; none if the page lacks the heading `head`."""
    wanted, size = [list(line) for line in head], len(head)
    starts = range(len(lines))
    if not any([list(line) for line in lines[at : at + size]] == wanted for at in starts):
        return []
    return [line for line in lines if len(line) == width]


def compared_steps(rows: int, steps: int, card_steps: int) -> int:
    """Return `steps`, by the thesis's text, or `card_steps`, if the page has more rows."""
    return card_steps if rows > steps else steps


def compare_rows(
    theirs: Sequence[Sequence[str]], ours: Sequence[Sequence[str]]
) -> tuple[int, tuple[Difference, ...]]:
    """Return the count of compared numbers and the differences; "-" replaces a missing number."""
    none: Sequence[str] = ()
    places = [
        (row, place, x, y)
        for row, (a, b) in enumerate(zip_longest(theirs, ours, fillvalue=none), 1)
        for place, (x, y) in enumerate(zip_longest(a, b, fillvalue="-"), 1)
    ]
    return len(places), tuple(Difference(*each) for each in places if each[2] != each[3])


def stored_fits(lines: Sequence[Sequence[str]], folder: Path) -> list[Fit]:
    """Return comparisons with pages in `folder` of the same heading and width, nearest first."""
    found = []
    with open(folder / PAGES, newline="", encoding="ascii") as file:
        for each in csv.DictReader(file):
            page = (folder / each["page"]).read_text(encoding="ascii")
            head, ours = split_page(printed_numbers(page))
            if not (theirs := rows_of_form(lines, head, len(ours[0]))):
                continue
            steps = compared_steps(len(theirs), int(each["steps"]), int(each["card_steps"]))
            ran = each["program"], int(each["case"]), each["listing"], each["word"]
            found.append(Fit(*ran, *compare_rows(theirs, ours[:steps])))
    return sorted(found, key=lambda each: len(each.differences))


def verdict(path: str, found: Sequence[Fit]) -> list[str]:
    """Return lines that name our pages equal to the page in `path`, or else the nearest one."""
    whole = [each for each in found if each.is_whole]
    said = "printed so by" if whole else "by none; the nearest is"
    return [f"{path}: {said} {each.name}" for each in whole or found[:1]]


def main(arguments: Sequence[str], folder: Path) -> int:
    """Print the comparison of a page's file with the pages in `folder`; return the exit status."""
    if len(arguments) != 1:
        print("usage: python judge.py FILE, a page as a program printed it", file=sys.stderr)
        return 2
    (path,) = arguments
    try:
        lines = printed_numbers(Path(path).read_bytes().decode("ascii", "replace"))
    except OSError as error:
        print(f"{path}: it can't be read ({error.strerror})", file=sys.stderr)
        return 2
    found = stored_fits(lines, folder) if has_rows(lines) else []
    if not found:
        print(
            f"{path}: it has no page with the moments, torques and columns of a job of this folder",
            file=sys.stderr,
        )
        return 2
    print(*verdict(path, found), "", "differ of    page", sep="\n")
    for fit in found:
        print(f"{len(fit.differences):6d} {fit.fields:5d} {fit.name}")
    if not found[0].is_whole:
        print("\nthe first numbers that differ from the first of these pages:")
        for each in found[0].differences[:SHOWN]:
            where = f"row {each.row}, number {each.place}"
            print(f"{where}: the page has {each.theirs}, ours {each.ours}")
    return 0 if found[0].is_whole else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], Path(__file__).parent))
