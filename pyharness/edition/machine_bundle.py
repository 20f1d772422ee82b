"""The folder `machine` of the data package, for readers with an emulated CDC computer.

It has the jobs, the expected pages, a script that compares a page with them, and a table of the
conclusions from each outcome.
"""

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

from pyharness.edition.crate import Part, described
from pyharness.edition.made_pages import table
from pyharness.history import printed_page
from pyharness.history.listing_output import listings_of, our_page
from pyharness.model.facts import facts
from pyharness.model.listing import Listing
from pyharness.model.report import numbers
from pyharness.model.scene_file import case_scene
from pyharness.thesis.decks import SYSTEMS, card_steps, deck_text, job_text
from pyharness.thesis.programs import WORD_NAMES
from pyharness.views.render import csv_text

# The machine's arithmetics, one for each option of its compiler.
_MACHINE = ("cdc48", "cdc48-rounded")
_COLUMNS = "program case listing word steps card_steps page"
_SYSTEMS = {"nos": "NOS", "nosbe": "NOS/BE"}


def machine_parts() -> Iterator[Part]:
    """Yield the files of the folder."""
    texts: dict[str, str] = {}
    rows: list[list[Any]] = []
    # The machine's arithmetics are the first.
    words = [*_MACHINE, *(word for word in WORD_NAMES if word not in _MACHINE)]
    for program, case in facts("cases")["published"].items():
        steps = case_scene(case).steps, card_steps(program)
        first_with: dict[str, str] = {}
        for (title, listing), word in product(listings_of(program).items(), words):
            text = our_page(listing, case, card_steps(program), word)
            name = _name(program, case, title, word)
            first = first_with.setdefault(text, name)
            # Equal pages are stored once, but predictions for the machine under their own names.
            if title != "original" or word not in _MACHINE:
                name = first
            texts[name] = text
            rows.append([program, case, title, word, *steps, name])
    for name, text in texts.items():
        program, case, listing, word = next(row[:4] for row in rows if row[-1] == name)
        ran = {"program": program, "case": case, "listing": listing, "word": word}
        yield described("page", text.encode(), name=name, **ran)
    content = csv_text(numbers(_COLUMNS, rows)).encode()
    yield described("pages", content, name=printed_page.PAGES)
    jobs = [*_jobs(texts)]
    yield from jobs
    yield described("judge", Path(printed_page.__file__).read_bytes())
    readme = facts("machine")["readme"].format(
        jobs=table(
            "job | content",
            [[f"`{each.path.removeprefix('machine/')}`", each.title] for each in jobs],
        ).rstrip(),
        pages=table("page | rows | printed by", [*_shared(texts, rows)]).rstrip(),
        outcomes=outcomes_table(),
    )
    yield described("guide", readme.encode())


def outcomes_table() -> str:
    """Return a Markdown table of the conclusions from each outcome of a job."""
    rows = [[each["seen"], each["learned"], each["open"]] for each in facts("machine")["outcome"]]
    return table("outcome | what would be learned | what remains open", rows).rstrip()


def _name(program: str, case: int, listing: str, word: str) -> str:
    form = "" if listing == "original" else f"{listing.replace(' ', '-')}-"
    return f"{program}-case-{case}-{form}{word}.txt"


def _jobs(texts: dict[str, str]) -> Iterator[Part]:
    """Yield the jobs, also with rounding if it changes the program's page."""
    for program, case in facts("cases")["published"].items():
        first, second = (texts[_name(program, case, "original", word)] for word in _MACHINE)
        for system in SYSTEMS:
            for rounds in (False, True) if first != second else (False,):
                text = deck_text(Listing.original(program), dialect="ftn")
                suffix, option = ("-rounded", ", with the option ROUND") if rounds else ("", "")
                yield described(
                    "job", job_text(text, system, rounds).encode(), program=program, system=system,
                    system_name=_SYSTEMS[system], suffix=suffix, option=option,
                )  # fmt: skip


def _shared(texts: dict[str, str], rows: list[list[Any]]) -> Iterator[list[str]]:
    """Yield for each page its file, number of rows, and the runs that print it."""
    for name, text in texts.items():
        _, printed = printed_page.split_page(printed_page.printed_numbers(text))
        words: dict[str, list[str]] = {}
        for program, _, listing, word, *_, page in rows:
            if texts[page] == text and name.startswith(f"{program}-case-"):
                words.setdefault(listing, []).append(f"`{word}`")
        by = "; ".join(f"{listing} in {', '.join(found)}" for listing, found in words.items())
        yield [f"`{name}`", str(len(printed)), by]
