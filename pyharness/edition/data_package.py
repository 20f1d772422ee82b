"""The edition as plain data: cards, apparatus, verdicts, runs and printed pages.

The package is an RO-Crate. Its files contain neither times nor paths of the machine, so that two
runs write the same bytes.
"""

from collections.abc import Iterator, Mapping
from hashlib import sha256
from io import BytesIO
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from pyharness.edition.citation import bibtex, codemeta, data_description, data_name
from pyharness.edition.crate import (
    CRATE,
    KEPT,
    MANIFEST,
    PACKAGE_MARK,
    Part,
    crate_record,
    described,
)
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


def archive(content: Mapping[str, bytes], folder: str) -> bytes:
    """Return a ZIP file of files by path, in `folder`; it has no times, as the package."""
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
