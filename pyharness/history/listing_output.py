"""Comparison of a machine's printed page with ours, to find the machine's arithmetic."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cache

from pyharness.history import printed_page
from pyharness.history.printed_page import Fit, printed_numbers, split_page
from pyharness.model.errors import InputError
from pyharness.model.listing import Listing, names_of
from pyharness.model.pipes import read_input
from pyharness.model.progress import Progress, no_progress
from pyharness.model.report import Column, Report, Section, Table, words
from pyharness.model.scene_file import case_scene
from pyharness.thesis.decks import card_steps
from pyharness.thesis.printer import page
from pyharness.thesis.programs import BINARY64, WORD_NAMES, run_program

_LARGEST = 1 << 24  # largest size (bytes) of a page's file


def read_page(path: str) -> list[list[str]]:
    """Return the numbers in each line of a page; at least one line must have six or more."""
    where = f"--listing-output '{path}'"
    content = read_input(path, where, _LARGEST, "what a program printed to TAPE6")
    found = printed_numbers(content.decode("ascii", "replace"))
    if not printed_page.has_rows(found):
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
    """Return comparisons of a page with our pages of the same heading and width, nearest first."""
    found: list[Fit] = []
    listings = {program: listings_of(program) for program in programs}
    every = len(cases) * len(WORD_NAMES) * sum(map(len, listings.values()))
    for program in programs:
        for case in cases:
            head, (row, *_) = split_page(_lines(Listing.original(program), case, 1))
            theirs = printed_page.rows_of_form(lines, head, len(row))
            if not theirs:
                continue
            given = case_scene(case).steps, card_steps(program)
            steps = printed_page.compared_steps(len(theirs), *given)
            for name, listing in listings[program].items():
                for word in WORD_NAMES:
                    progress(len(found), every, f"{program}, case {case}, {word}")
                    ours = split_page(_lines(listing, case, steps, word))[1]
                    compared = printed_page.compare_rows(theirs, ours)
                    found.append(Fit(program, case, name, word, *compared))
    if not found:
        raise InputError(
            f"--listing-output: no page of {', '.join(programs)} in case "
            f"{', '.join(map(str, cases))} has these moments, torques and columns; give a "
            "page of one of these programs and cases"
        )
    return sorted(found, key=lambda each: len(each.differences))


def listings_of(program: str) -> dict[str, Listing]:
    readings = names_of("reading", program)
    return {
        "original": Listing.original(program),
        "corrected": Listing.corrected(program),
        **{f"original with {name}": Listing.original(program, [name]) for name in readings},
    }


@cache
def our_page(listing: Listing, case: int, steps: int, word: str) -> str:
    scene = replace(case_scene(case), steps=steps)
    return page(scene, listing.program, run_program(scene, listing, "python", word=word))


def _lines(listing: Listing, case: int, steps: int, word: str = BINARY64) -> list[list[str]]:
    return printed_numbers(our_page(listing, case, steps, word))


def listing_output_report(path: str, found: Sequence[Fit]) -> Report:
    best = found[0]
    rows = [[x.program, x.case, x.listing, x.word, x.fields, len(x.differences)] for x in found]
    text: list[Section] = [printed_page.verdict(path, found), [Table(_TABLE, rows)]]
    if not best.is_whole:
        first = [list(asdict(each).values()) for each in best.differences[: printed_page.SHOWN]]
        text.append(["the first numbers that differ:", Table(_APART, first)])
    record = {"page": path, "passed": best.is_whole, "fits": list(map(asdict, found))}
    return Report("verify", text, lambda: record, Table(_TABLE, rows))


_TABLE = (*words("program case listing word"), Column("numbers"), Column("differ"))
_APART = (Column("row"), Column("place"), *words("theirs ours"))
