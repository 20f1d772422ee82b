"""A page printed by any machine, compared with the pages that our programs print.

Our programs print their pages in each of several arithmetics. The digits that a machine printed,
real or emulated, therefore show in which arithmetic its program ran.
"""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import zip_longest

from pyharness.model.errors import InputError
from pyharness.model.listing import Listing
from pyharness.model.pipes import read_input
from pyharness.model.progress import Progress, no_progress
from pyharness.model.report import Column, Report, Section, Table, words
from pyharness.model.scene_file import case_scene
from pyharness.original.printer import page
from pyharness.original.programs import WORD_NAMES, run_program

# A number as FORMAT writes it: asterisks if it does not fit, R or I (CDC) if it is not finite.
_FIELD = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)|\*+|[-+]?[RI]")
_SHOWN = 5
_LARGEST = 1 << 24  # largest size of a page's file, in bytes


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
        The program of our page, the label of its listing (``original`` or ``corrected``), and the
        name of the arithmetic in which it ran.
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


def read_page(path: str) -> list[list[str]]:
    """Return the lines of a printed page that contain only numbers, split into these numbers.

    The page is the file `path`, as a program printed it. Raise InputError if no line has at least
    six numbers.
    """
    where = f"--listing-output '{path}'"
    content = read_input(path, where, _LARGEST, "what a program printed to TAPE6")
    found = _numbers(content.decode("ascii", "replace"))
    if not any(len(line) >= 6 for line in found):
        raise InputError(
            f"{where}: it has no row of numbers; give a page as a program printed it to TAPE6"
        )
    return found


def fits(
    lines: Sequence[Sequence[str]],
    programs: Sequence[str],
    cases: Sequence[int],
    progress: Progress = no_progress,
) -> list[Fit]:
    """Compare a page from another machine with those of our pages that have the same form.

    `lines` are the lines of numbers of the page, from `read_page`. Our pages are printed by the
    `programs` in the `cases`, original and corrected, in every arithmetic that we emulate. Two
    pages have the same form if their moments and torques (in the heading) and their numbers of
    columns agree. Return the comparisons, sorted by the number of differences, the smallest first.
    Raise InputError if none of our pages has the form of the page. `progress` is called before each
    comparison.
    """
    found: list[Fit] = []
    every = len(programs) * len(cases) * 2 * len(WORD_NAMES)
    for program in programs:
        for case in cases:
            head, width = _form(program, case)
            theirs = [line for line in lines if len(line) == width]
            begins = any(list(lines[at : at + len(head)]) == head for at in range(len(lines)))
            if not (begins and theirs):
                continue
            for listing in (Listing.original(program), Listing.corrected(program)):
                for word in WORD_NAMES:
                    progress(len(found), every, f"{program}, case {case}, {word}")
                    found.append(_fit(theirs, listing, case, word))
    if not found:
        raise InputError(
            f"--listing-output: no page of {', '.join(programs)} in case "
            f"{', '.join(map(str, cases))} has these moments, torques and columns; give a "
            "page of one of these programs and cases"
        )
    return sorted(found, key=lambda each: len(each.differences))


def _form(program: str, case: int) -> tuple[list[list[str]], int]:
    """Return the lines of numbers in the heading of our page, and how many numbers each row has.

    Our page is the one that the program `program` prints in the case `case`.
    """
    scene = replace(case_scene(case), steps=1)
    *head, row = _numbers(
        page(scene, program, run_program(scene, Listing.original(program), "python"))
    )
    return head, len(row)


def _fit(theirs: Sequence[Sequence[str]], listing: Listing, case: int, word: str) -> Fit:
    scene = case_scene(case)
    trajectory = run_program(scene, listing, "python", word=word)
    ours = _numbers(page(scene, listing.program, trajectory))[-trajectory.steps :]
    none: Sequence[str] = ()
    places = [
        (row, place, x, y)
        for row, (a, b) in enumerate(zip_longest(theirs, ours, fillvalue=none), 1)
        for place, (x, y) in enumerate(zip_longest(a, b, fillvalue="-"), 1)
    ]
    apart = tuple(Difference(*each) for each in places if each[2] != each[3])
    return Fit(listing.program, case, listing.label, word, len(places), apart)


def _numbers(text: str) -> list[list[str]]:
    """Return the lines of `text` that contain only numbers, each as a list of its numbers."""
    lines = [line.split() for line in text.splitlines()]
    return [line for line in lines if line and all(map(_FIELD.fullmatch, line))]


def listing_output_report(path: str, found: Sequence[Fit]) -> Report:
    """Return the report on which program, listing and arithmetic print the page in file `path`.

    A listing is the original or the corrected form of a program. `found` has the comparisons of
    this page with the pages of our programs, the page with the fewest differences first. If every
    comparison has differences, the report shows the first differences from the first page.
    """
    best = found[0]
    whole = [each for each in found if each.is_whole]
    told = [
        f"{path}: {'printed so by' if whole else 'by none; the nearest is'} {name_of(each)}"
        for each in whole or [best]
    ]
    rows = [
        [each.program, each.case, each.listing, each.word, each.fields, len(each.differences)]
        for each in found
    ]
    text: list[Section] = [told, [Table(_TABLE, rows)]]
    if not whole:
        first = [list(asdict(each).values()) for each in best.differences[:_SHOWN]]
        text.append(["the first numbers that differ:", Table(_APART, first)])
    return Report(
        "verify",
        text,
        record=lambda: {"page": path, "passed": bool(whole), "fits": [asdict(f) for f in found]},
        data=Table(_TABLE, rows),
    )


def name_of(fit: Fit) -> str:
    """Return text that names our page, as in `two-term, case 2, original, in binary64`.

    The text has the program, the case, the listing (original or corrected) and the arithmetic of
    the page in a comparison.
    """
    return f"{fit.program}, case {fit.case}, {fit.listing}, in {fit.word}"


_TABLE = (*words("program case listing word"), Column("numbers"), Column("differ"))
_APART = (Column("row"), Column("place"), *words("theirs ours"))
