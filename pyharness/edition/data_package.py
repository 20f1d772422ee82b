"""The edition as plain data: cards, apparatus, verdicts, runs and printed pages.

The RO-Crate has no times or paths of the machine, so that it is the same in every run.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from hashlib import sha256
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from pyharness.edition.citation import (
    CRATE,
    KEPT,
    MANIFEST,
    PACKAGE_MARK,
    Part,
    bibtex,
    codemeta,
    crate_record,
    data_description,
    data_name,
    described,
)
from pyharness.edition.made_pages import table
from pyharness.history import printed_page
from pyharness.history.ablation import apparatus_report, case_truth, entries
from pyharness.history.claims.ledger import claims_report, judgements
from pyharness.history.figures import curve_numbers, findings
from pyharness.history.identifiers import (
    card_identifier,
    content_identifier,
    data_identifier,
    source_files,
    text_digest,
)
from pyharness.history.listing_output import listings_of, our_page
from pyharness.history.tei import tei_document
from pyharness.model.facts import facts, facts_folder, shipped
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset
from pyharness.model.progress import Progress, no_progress
from pyharness.model.report import numbers
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.schema import SCHEMAS
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.cards import deck
from pyharness.thesis.decks import SYSTEMS, card_steps, deck_text, job_text
from pyharness.thesis.programs import WORD_NAMES, run_program
from pyharness.views.render import csv_text, json_text, render

_COLUMNS = "card kind text scan entries port twin swhid"


def data_package(progress: Progress = no_progress) -> dict[str, bytes]:
    """Return the contents of all files of the data package by path."""
    parts = [*_list_files(progress)]
    parts.append(_readme(parts))
    content = {each.path: each.content for each in parts}
    content[CRATE] = json_text(crate_record(parts), indent=2).encode()
    listed = {path: content_identifier(each) for path, each in content.items()}
    mark = {"schema": SCHEMAS["data package"], "version": codemeta()["version"]}
    # The mark cannot identify the manifest, which contains the mark's checksum.
    files = {**listed, MANIFEST: None}
    mark |= {"text": text_digest(), "data": data_identifier(), "files": files}
    content[PACKAGE_MARK] = json_text(mark, indent=2).encode()
    # The format of `sha256sum -c`.
    lines = (f"{sha256(content[path]).hexdigest()}  {path}\n" for path in sorted(content))
    content[MANIFEST] = "".join(lines).encode()
    return dict(sorted(content.items()))


def archive(content: Mapping[str, bytes], folder: str) -> bytes:
    """Return a ZIP file, without times, that has `content` in `folder`."""
    found = BytesIO()
    with ZipFile(found, "w") as packed:
        for path, each in content.items():
            packed.writestr(ZipInfo(f"{folder}/{path}"), each, ZIP_DEFLATED)
    return found.getvalue()


def _list_files(progress: Progress) -> Iterator[Part]:
    progress(0, 5, "cards")
    for program in PROGRAMS:
        yield described("cards", _cards(program), program=program)
    yield described("tei", tei_document())
    yield described("apparatus", render(apparatus_report(entries()), "json").encode())
    rows = [[path, content_identifier(each)] for path, each in source_files().items()]
    yield described("sources", csv_text(numbers("path swhid", rows)).encode())
    progress(1, 5, "claims")
    yield described("claims", render(claims_report(judgements()), "json").encode())
    progress(2, 5, "figures")
    for each in findings():
        content = csv_text(curve_numbers(each)).encode()
        caption = each.plan.caption.removesuffix(".")
        yield described("figure", content, plan=each.plan, caption=caption)
    progress(3, 5, "runs")
    yield from run_parts()
    progress(4, 5, "pages")
    yield from machine_parts()
    yield described("citation", bibtex().encode())
    for name in ("cff", "codemeta", "licence"):
        part = described(name)
        yield part._replace(content=shipped(part.path).read_bytes())


def _cards(program: str) -> bytes:
    found = deck(program)
    rows = []
    for n, card in found.cards.items():
        both = (places.get(n, ()) for places in (found.port, found.twin))
        where = (" ".join(f"{each.file}:{each.line}" for each in places) for places in both)
        ours = (n, found.statement_kind(card), card.text.rstrip(), card.scan)
        rows.append([*ours, " ".join(card.entries), *where, card_identifier(card)])
    return csv_text(numbers(_COLUMNS, rows)).encode()


def _readme(parts: list[Part]) -> Part:
    software = codemeta()
    lines = [
        f"# {data_name()}", "", data_description(), "",
        f"Version {software['version']}, text {text_digest()}. Licence: {software['license']}. "
        "`citation.bib` has the citation.", "",
        table("file | content", [[each.path, each.title] for each in (*parts, *KEPT)]),
        f"`{CRATE}` describes the columns of each table.", "",
        f"Check the files with: `sha256sum -c {MANIFEST}`", "",
    ]  # fmt: skip
    return described("readme", "\n".join(lines).encode())


FAULTS_CASE = 5
"""Case for the effects of single faults, whose initial omega is on the cards."""

_ENDS = "case program listing steps ended stop_step stop_variable"
_ROWS = "program listing step time omega1 omega2 omega3 velocity1 velocity2 velocity3"


def run_parts() -> Iterator[Part]:
    yield described("cases", (facts_folder() / "cases.toml").read_bytes())
    yield described("ends", csv_text(numbers(_ENDS, [*_ends()])).encode())
    for case in case_numbers():
        content = csv_text(numbers(_ROWS, [*_rows(case)])).encode()
        yield described("results", content, case=case, faults_case=FAULTS_CASE)


@cache
def _listings() -> dict[tuple[str, str], Listing]:
    found = {}
    for program in PROGRAMS:
        found[program, "original"] = Listing.original(program)
        found[program, "corrected"] = Listing.corrected(program)
    for name in names_of("defect"):
        for program in PROGRAMS:
            if name in names_of("defect", program):
                found[program, name] = subset(program, "corrected", keep=[name])
    return found


@cache
def _run(case: int, listing: Listing) -> Trajectory:
    return run_program(case_scene(case), listing)


def _ends() -> Iterator[list[Any]]:
    for case in case_numbers():
        for (program, name), listing in _listings().items():
            run = _run(case, listing)
            stop = [None, None] if run.stop is None else [run.stop.step, run.stop.variable]
            yield [case, program, name, run.steps, run.ended, *stop]


def _rows(case: int) -> Iterator[list[Any]]:
    curves: dict[tuple[str, str], Any] = {("reference", ""): case_truth(case)}
    for (program, name), listing in _listings().items():
        if case == FAULTS_CASE or name in ("original", "corrected"):
            curves[program, name] = _run(case, listing)
    for names, curve in curves.items():
        states = np.column_stack([curve.time, curve.omega, curve.velocity]).tolist()
        for step, state in enumerate(states, 1):
            yield [*names, step, *state]


# Arithmetics of the original machine, by options of its compiler.
_MACHINE = ("cdc48", "cdc48-rounded")
_PAGES = "program case listing word steps card_steps page"
_SYSTEMS = {"nos": "NOS", "nosbe": "NOS/BE"}


def machine_parts() -> Iterator[Part]:
    """Yield the files for runs on the original machine."""
    texts: dict[str, str] = {}
    rows: list[list[Any]] = []
    words = [*_MACHINE, *(word for word in WORD_NAMES if word not in _MACHINE)]
    for program, case in facts("cases")["published"].items():
        steps = case_scene(case).steps, card_steps(program)
        first_with: dict[str, str] = {}
        for (title, listing), word in product(listings_of(program).items(), words):
            text = our_page(listing, case, card_steps(program), word)
            name = _name(program, case, title, word)
            first = first_with.setdefault(text, name)
            # Equal pages are stored once, except those predicted for the original machine.
            if title != "original" or word not in _MACHINE:
                name = first
            texts[name] = text
            rows.append([program, case, title, word, *steps, name])
    for name, text in texts.items():
        program, case, listing, word = next(row[:4] for row in rows if row[-1] == name)
        ran = {"program": program, "case": case, "listing": listing, "word": word}
        yield described("page", text.encode(), name=name, **ran)
    content = csv_text(numbers(_PAGES, rows)).encode()
    yield described("pages", content, name=printed_page.PAGES)
    jobs = [*_jobs(texts)]
    yield from jobs
    yield described("judge", Path(printed_page.__file__).read_bytes())
    titles = [[f"`{each.path.removeprefix('machine/')}`", each.title] for each in jobs]
    tables = {"jobs": table("job | content", titles).rstrip(), "outcomes": outcomes_table()}
    tables["pages"] = table("page | rows | printed by", [*_shared(texts, rows)]).rstrip()
    yield described("guide", facts("machine")["readme"].format(**tables).encode())


def outcomes_table() -> str:
    rows = [[each["seen"], each["learned"], each["open"]] for each in facts("machine")["outcome"]]
    return table("outcome | what would be learned | what remains open", rows).rstrip()


def _name(program: str, case: int, listing: str, word: str) -> str:
    form = "" if listing == "original" else f"{listing.replace(' ', '-')}-"
    return f"{program}-case-{case}-{form}{word}.txt"


def _jobs(texts: dict[str, str]) -> Iterator[Part]:
    """Yield each system's jobs, also with the option ROUND if this changes the printed page."""
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
    """Yield each page's file, number of rows, and runs that print it."""
    for name, text in texts.items():
        _, printed = printed_page.split_page(printed_page.printed_numbers(text))
        words: dict[str, list[str]] = {}
        for program, _, listing, word, *_, page in rows:
            if texts[page] == text and name.startswith(f"{program}-case-"):
                words.setdefault(listing, []).append(f"`{word}`")
        by = "; ".join(f"{listing} in {', '.join(found)}" for listing, found in words.items())
        yield [f"`{name}`", str(len(printed)), by]
