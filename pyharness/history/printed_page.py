"""Compare a page that a machine printed with the pages that our programs print.

This module needs nothing but Python's standard library, and is also a script: the data package of
the edition has it as `machine/judge.py`, beside the pages that our programs print. There,
``python judge.py FILE`` compares the page in FILE with these pages. Its exit status is 0 if a
page is equal, 1 if all pages differ, and 2 if FILE has no page of this form.
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
    """A printed number that differs between a page from another machine and a page of our program.

    `row` is the row of the number, and `place` its position within the row; both count from 1.
    `theirs` and `ours` are the numbers as printed by the other machine and by our program.
    """

    row: int
    place: int
    theirs: str
    ours: str


@dataclass(frozen=True)
class Fit:
    """The comparison of a page from another machine with a page that our programs print.

    Attributes
    ----------
    program, listing, word : str
        The program of our page, the name of its listing (``original``, ``corrected``, or
        ``original with`` and the name of another reading of a doubtful card), and the name of the
        arithmetic in which it ran.
    case : int
        The number of the case of our page in Table 1.
    fields : int
        How many numbers are compared. A number is also counted if the other page has none at its
        place.
    differences : tuple of Difference
        The numbers that the two pages print differently.
    """

    program: str
    case: int
    listing: str
    word: str
    fields: int
    differences: tuple[Difference, ...]

    @property
    def is_whole(self) -> bool:
        """Return whether the page of the other machine and our page print every number alike."""
        return not self.differences

    @property
    def name(self) -> str:
        """Return text that names our page, as in `two-term, case 2, original, in binary64`.

        The text has the program, the case, the listing and the arithmetic of the page.
        """
        return f"{self.program}, case {self.case}, {self.listing}, in {self.word}"


def printed_numbers(text: str) -> list[list[str]]:
    """Return the lines of `text` that contain only numbers, each as a list of its numbers."""
    lines = [line.split() for line in text.splitlines()]
    return [line for line in lines if line and all(map(_FIELD.fullmatch, line))]


def has_rows(lines: Iterable[Sequence[str]]) -> bool:
    """Return whether some lines of numbers include a row of results, with at least six numbers."""
    return any(len(line) >= _LEAST for line in lines)


def split_page(lines: Sequence[list[str]]) -> tuple[list[list[str]], list[list[str]]]:
    """Return the lines of numbers in the heading of our page, and the rows of its results.

    `lines` are the lines of numbers of the page, from `printed_numbers`. The heading has the
    moments and the torques.
    """
    begin = next((n for n, line in enumerate(lines) if len(line) >= _LEAST), len(lines))
    return [*lines[:begin]], [*lines[begin:]]


def rows_of_form(
    lines: Sequence[Sequence[str]], head: Sequence[Sequence[str]], width: int
) -> list[Sequence[str]]:
    """Return the rows with `width` numbers of a page, if the page has the heading `head`.

    `lines` are the lines of numbers of the page, from `printed_numbers`, and `head` are those of
    the heading of our page. The result is empty if the heading is missing.
    """
    wanted, size = [list(line) for line in head], len(head)
    starts = range(len(lines))
    if not any([list(line) for line in lines[at : at + size]] == wanted for at in starts):
        return []
    return [line for line in lines if len(line) == width]


def compared_steps(rows: int, steps: int, card_steps: int) -> int:
    """Return how many steps our run needs for the comparison with a page of `rows` rows.

    The number is `steps`, that of the text of the thesis. If the page has more rows, the number is
    `card_steps`, that of the DO statement on the cards.
    """
    return card_steps if rows > steps else steps


def compare_rows(
    theirs: Sequence[Sequence[str]], ours: Sequence[Sequence[str]]
) -> tuple[int, tuple[Difference, ...]]:
    """Return how many numbers of two pages are compared, and those that differ.

    `theirs` are the rows of the page of another machine, and `ours` those of our page. If only one
    of the pages has a number at a place, the other number is shown as a dash.
    """
    none: Sequence[str] = ()
    places = [
        (row, place, x, y)
        for row, (a, b) in enumerate(zip_longest(theirs, ours, fillvalue=none), 1)
        for place, (x, y) in enumerate(zip_longest(a, b, fillvalue="-"), 1)
    ]
    return len(places), tuple(Difference(*each) for each in places if each[2] != each[3])


def stored_fits(lines: Sequence[Sequence[str]], folder: Path) -> list[Fit]:
    """Compare a page from another machine with the stored pages of the same form.

    `lines` are the lines of numbers of the page, from `printed_numbers`. `folder` has the table
    `PAGES` and the pages that the table names. Return the comparisons, sorted by the number of
    differences, the smallest first. The list is empty if no stored page has the form of the page.
    """
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
    """Return the lines that name our pages that are equal to the page in the file `path`.

    `found` has the comparisons of this page with our pages, the page with the fewest differences
    first. If none of our pages is equal, the only line names the first.
    """
    whole = [each for each in found if each.is_whole]
    said = "printed so by" if whole else "by none; the nearest is"
    return [f"{path}: {said} {each.name}" for each in whole or found[:1]]


def main(arguments: Sequence[str], folder: Path) -> int:
    """Compare the page in a file with the pages in `folder`, print the result, and return a status.

    `arguments` has the path of the file. The status is 0 if one of the pages is equal, 1 if all
    of them differ, and 2 if the file can't be compared.
    """
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
