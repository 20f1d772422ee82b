"""The edition as plain data: cards, apparatus, verdicts, runs and printed pages.

The package is an RO-Crate. Its files contain neither times nor paths of the machine, so that two
runs write the same bytes.
"""

from collections.abc import Iterator
from hashlib import sha256

from pyharness.edition.citation import bibtex, codemeta, data_description, data_name
from pyharness.edition.crate import CRATE, KEPT, MANIFEST, PACKAGE_MARK, Part, crate_record
from pyharness.edition.machine_bundle import machine_parts
from pyharness.edition.made_pages import table
from pyharness.edition.package_runs import run_parts
from pyharness.history.ablation import apparatus_report, entries
from pyharness.history.claims.ledger import judgements
from pyharness.history.claims.report import claims_report
from pyharness.history.figures import curve_numbers, findings
from pyharness.history.identifiers import (
    card_identifier,
    content_identifier,
    data_identifier,
    source_files,
    text_digest,
)
from pyharness.history.tei import tei_document
from pyharness.model.facts import shipped
from pyharness.model.listing import PROGRAMS
from pyharness.model.progress import Progress, no_progress
from pyharness.model.report import numbers
from pyharness.model.schema import SCHEMAS
from pyharness.thesis.cards import deck
from pyharness.views.render import csv_text, json_text, render

_CSV, _JSON, _TEXT = "text/csv", "application/json", "text/plain"
_COLUMNS = "card kind text scan entries port twin swhid"


def data_package(progress: Progress = no_progress) -> dict[str, bytes]:
    """Return all files of the data package, content by path.

    `progress` receives the numbers of completed and of all parts, and the part's name.
    """
    parts = [*_list_files(progress)]
    parts.append(_readme(parts))
    content = {each.path: each.content for each in parts}
    content[CRATE] = json_text(crate_record(parts), indent=2).encode()
    listed = {path: content_identifier(each) for path, each in content.items()}
    mark = {
        "schema": SCHEMAS["data package"],
        "version": codemeta()["version"],
        "text": text_digest(),
        "data": data_identifier(),
        # The manifest has this file's checksum, so that its identifier is not known here.
        "files": {**listed, MANIFEST: None},
    }
    content[PACKAGE_MARK] = json_text(mark, indent=2).encode()
    # The form that `sha256sum -c` reads.
    lines = (f"{sha256(content[path]).hexdigest()}  {path}\n" for path in sorted(content))
    content[MANIFEST] = "".join(lines).encode()
    return dict(sorted(content.items()))


def _list_files(progress: Progress) -> Iterator[Part]:
    progress(0, 5, "cards")
    for program in PROGRAMS:
        yield Part(
            f"cards/{program}.csv", f"Cards of the {program} program",
            "A row for each card. card: its number. kind: comment, executable or specification. "
            "text: columns 1 to 72. scan: its line in the scan without blanks, empty if the scan "
            "lacks the card. entries: the entries of the apparatus that name the card. port, twin: "
            "the corresponding lines in our Fortran and Python versions. swhid: the line of the "
            "card in the data of the edition, as a Software Heritage identifier.",
            _CSV, _cards(program),
        )  # fmt: skip
    yield Part(
        "edition.xml", "The edition in TEI P5",
        "All cards with the characters of the scan beside ours, and the critical apparatus.",
        "application/tei+xml", tei_document(),
    )  # fmt: skip
    yield Part(
        "apparatus.json", "The critical apparatus",
        "The defects, doubtful readings, conjectures and other entries, each with its cards and "
        "its evidence; the output of `pyharness defects --format json`.",
        _JSON, render(apparatus_report(entries()), "json").encode(),
    )  # fmt: skip
    rows = [[path, content_identifier(each)] for path, each in source_files().items()]
    yield Part(
        "sources.csv", "Software Heritage identifiers of the sources",
        "A row for each file of the edition's data and of the Fortran port, with its path in the "
        "source repository.",
        _CSV, csv_text(numbers("path swhid", rows)).encode(),
    )  # fmt: skip
    progress(1, 5, "claims")
    yield Part(
        "claims.json", "The claims of the thesis, and our verdicts",
        "Verdicts for the programs as printed and as corrected, with the numbers behind them and "
        "the assumptions; the output of `pyharness claims --format json`.",
        _JSON, render(claims_report(judgements()), "json").encode(),
    )  # fmt: skip
    progress(2, 5, "figures")
    for each in findings():
        yield Part(
            f"figures/{each.plan.stem}.csv", f"{each.plan.title}, {each.plan.set} programs",
            f"{each.plan.caption.removesuffix('.')}. time and recorded_time in s, omega in rad/s. "
            "recorded_time is the variable TIME of the program.",
            _CSV, csv_text(curve_numbers(each)).encode(),
        )  # fmt: skip
    progress(3, 5, "runs")
    yield from run_parts()
    progress(4, 5, "pages")
    yield from machine_parts()
    yield Part(
        "citation.bib", "Citation of the edition and of the thesis", "BibTeX.",
        "application/x-bibtex", bibtex().encode(),
    )  # fmt: skip
    for path, title, media_type in (
        ("CITATION.cff", "Citation of the software, in the Citation File Format", "text/yaml"),
        ("codemeta.json", "Description of the software, in the format CodeMeta", "text/json"),
        ("LICENSE", "The licence of the edition", _TEXT),
    ):
        content = shipped(path).read_bytes()
        yield Part(path, title, f"The file {path} of the source repository.", media_type, content)


def _cards(program: str) -> bytes:
    found = deck(program)
    rows = [
        [
            card.number, found.statement_kind(card), card.text.rstrip(), card.scan,
            " ".join(card.entries),
            *(" ".join(f"{place.file}:{place.line}" for place in places.get(card.number, ()))
              for places in (found.port, found.twin)),
            card_identifier(card),
        ]
        for card in found.cards.values()
    ]  # fmt: skip
    return csv_text(numbers(_COLUMNS, rows)).encode()


def _readme(parts: list[Part]) -> Part:
    described = codemeta()
    lines = [
        f"# {data_name()}", "", data_description(), "",
        f"Version {described['version']}, text {text_digest()}. Licence: {described['license']}. "
        "`citation.bib` has the citation.", "",
        table("file | content", [[each.path, each.title] for each in (*parts, *KEPT)]),
        f"`{CRATE}` describes the columns of each table.", "",
        f"Check the files with: `sha256sum -c {MANIFEST}`", "",
    ]  # fmt: skip
    return Part(
        "README.md", "What the package contains", "A list of all files.", "text/markdown",
        "\n".join(lines).encode(),
    )  # fmt: skip
