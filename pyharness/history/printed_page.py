"""Compare a page that a machine printed with the pages that our programs print.

It needs Python's standard library alone and is also a script, `machine/judge.py` in the data
package beside the pages: ``python judge.py FILE`` compares the page in FILE. Its exit status is 0
if a page is equal, 1 if all differ, and 2 if FILE has no page of this form.
"""

import csv
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

PAGES = "pages.csv"
"""The table of the pages that the script compares, in its own folder."""

# A number as FORMAT writes it: asterisks if it does not fit, R or I (CDC) if it is not finite.
_FIELD = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)|\*+|[-+]?[RI]")
_LEAST = 6  # every row of results has at least six numbers, and no line of the heading has
SHOWN = 5
"""How many differences are shown if no page is equal."""


@dataclass(frozen=True)
class Difference:
    """A printed number, counted by row and place from 1, that differs between two pages."""

    row: int
    place: int
    theirs: str
    ours: str


@dataclass(frozen=True)
class Fit:
    """The comparison of a page from another machine with a page that our programs print.

    `listing` is ``original``, ``corrected`` or ``original with`` a reading; `word` is the
    arithmetic; `fields` are compared numbers.
    """

    program: str
    case: int
    listing: str
    word: str
    fields: int
    differences: tuple[Difference, ...]

    @property
    def is_whole(self) -> bool:
        """Return whether the two pages print every number alike."""
        return not self.differences

    @property
    def name(self) -> str:
        """Return text that names our page, as in `two-term, case 2, original, in binary64`."""
        return f"{self.program}, case {self.case}, {self.listing}, in {self.word}"


def printed_numbers(text: str) -> list[list[str]]:
    """Return the lines of `text` that contain only numbers, each as a list of its numbers."""
    lines = [line.split() for line in text.splitlines()]
    return [line for line in lines if line and all(map(_FIELD.fullmatch, line))]


def has_rows(lines: Iterable[Sequence[str]]) -> bool:
    """Return whether some lines of numbers include a row of results, with at least six numbers."""
    return any(len(line) >= _LEAST for line in lines)


def split_page(lines: Sequence[list[str]]) -> tuple[list[list[str]], list[list[str]]]:
    """Return the lines of numbers in the heading (moments and torques), and the rows of results."""
    begin = next((n for n, line in enumerate(lines) if len(line) >= _LEAST), len(lines))
    return [*lines[:begin]], [*lines[begin:]]


def rows_of_form(
    lines: Sequence[Sequence[str]], head: Sequence[Sequence[str]], width: int
) -> list[Sequence[str]]:
    """Return the rows with `width` numbers, or nothing if the page lacks the heading `head`."""
    wanted, size = [list(line) for line in head], len(head)
    starts = range(len(lines))
    if not any([list(line) for line in lines[at : at + size]] == wanted for at in starts):
        return []
    return [line for line in lines if len(line) == width]


def compared_steps(rows: int, steps: int, card_steps: int) -> int:
    """Return how many steps our run needs: those of the text, or of the cards for a longer page."""
    return card_steps if rows > steps else steps


def compare_rows(
    theirs: Sequence[Sequence[str]], ours: Sequence[Sequence[str]]
) -> tuple[int, tuple[Difference, ...]]:
    """Return how many numbers are compared, and those that differ; a missing one is a dash."""
    none: Sequence[str] = ()
    places = [
        (row, place, x, y)
        for row, (a, b) in enumerate(zip_longest(theirs, ours, fillvalue=none), 1)
        for place, (x, y) in enumerate(zip_longest(a, b, fillvalue="-"), 1)
    ]
    return len(places), tuple(Difference(*each) for each in places if each[2] != each[3])


def stored_fits(lines: Sequence[Sequence[str]], folder: Path) -> list[Fit]:
    """Compare a page with those in `folder` of the same form, the nearest first."""
    found = []
    with open(folder / PAGES, newline="", encoding="ascii") as file:
        for each in csv.DictReader(file):
            page = (folder / each["page"]).read_text(encoding="ascii")
            head, ours = split_page(printed_numbers(page))
            if not (theirs := rows_of_form(lines, head, len(ours[0]))):
                continue
            steps = compared_steps(len(theirs), int(each["steps"]), int(each["card_steps"]))
            program, case, listing, word = (
                each[key] for key in ("program", "case", "listing", "word")
            )
            compared = compare_rows(theirs, ours[:steps])
            found.append(Fit(program, int(case), listing, word, *compared))
    return sorted(found, key=lambda each: len(each.differences))


def verdict(path: str, found: Sequence[Fit]) -> list[str]:
    """Return the lines that name our pages equal to that in the file `path`, else the nearest."""
    whole = [each for each in found if each.is_whole]
    said = "printed so by" if whole else "by none; the nearest is"
    return [f"{path}: {said} {each.name}" for each in whole or found[:1]]


def main(arguments: Sequence[str], folder: Path) -> int:
    """Compare the page in a file with the pages in `folder`, print the result, return a status."""
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
