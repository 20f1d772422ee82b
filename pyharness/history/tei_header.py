"""The header of the TEI document, and functions for elements in all its parts."""

from collections.abc import Iterable, Iterator
from typing import Any
from xml.etree import ElementTree as xml

import pyharness
from pyharness.history.revisions import Revision, revisions
from pyharness.model.facts import facts
from pyharness.thesis.cards import deck, numbers

TITLE = "A Digital Computer Approach to the Unsymmetric Rigid Body Problem"
AUTHOR = "Richard Jacobs"
XML = "{http://www.w3.org/XML/1998/namespace}"
EDITORS = "editors"
"""The XML identifier of the edition's editors."""

KINDS = {
    "defect": "a fault of the author, kept in the text",
    "reading": "the reading that is not adopted, where the scan leaves two open",
    "conjecture": "what is assumed where no card exists",
    "misreading": "characters or numbers that the scan has wrong",
    "normalization": "a name made uniform, where that of the scan is legal and computes the same",
    "redundant": "cards that compute what is known already, or what no result needs",
    "unread": "what is set or declared, and read by no card",
    "unreachable": "the aim of a jump that no card makes",
    "missing text": "cards or pages that the scan or the report does not have",
    "dialect": "what only the FORTRAN of the machine explains",
}
"""The kinds of apparatus entries, with their contents."""

CERTAINTY = {"certain": "high", "probable": "medium", "conjecture": "low", "undecidable": "unknown"}
"""The degrees of certainty in the apparatus, with the values of `cert` in TEI."""


def add_header(root: xml.Element) -> None:
    """Append the header to the document's root."""
    edition, scan = facts("edition"), facts("cards/scan")
    header = xml.SubElement(root, "teiHeader")
    file = xml.SubElement(header, "fileDesc")
    titles = xml.SubElement(file, "titleStmt")
    with_text(titles, "title", f"{TITLE}: the three programs of the appendix, with an apparatus")
    with_text(titles, "author", AUTHOR)
    responsible = named(titles, "respStmt", EDITORS)
    for name in edition["editors"]:
        with_text(responsible, "name", name)
    with_text(responsible, "resp", edition["responsibility"])
    version = pyharness.__version__
    with_text(xml.SubElement(file, "editionStmt"), "edition", f"pyharness {version}", n=version)
    publication = xml.SubElement(file, "publicationStmt")
    with_text(publication, "publisher", edition["publisher"])
    released = edition["released"].get(version, "") or "no date"
    with_text(publication, "date", released, **_when(released))
    _rights(xml.SubElement(publication, "availability"), edition["rights"])
    source = xml.SubElement(file, "sourceDesc")
    printed = named(source, "bibl", "report")
    with_text(printed, "author", AUTHOR)
    with_text(printed, "title", TITLE)
    with_text(printed, "publisher", "AFWAL")
    with_text(printed, "date", "March 1982", when="1982-03")
    with_text(printed, "biblScope", "appendix", unit="section")
    _witnesses(xml.SubElement(source, "listWit"), scan["witness"], edition["witness"])
    _encoding(xml.SubElement(header, "encodingDesc"), scan)
    _revisions(xml.SubElement(header, "revisionDesc"))


def sources(entry: dict[str, Any]) -> str:
    """Return the pointers to the parts of the scan that support an apparatus entry.

    The text is included if the entry is based on it or on results, or names no card.
    """
    parts = ["appendix"] if entry["cards"] else []
    if not parts or {"T", "R"} & set(entry["grounds"]):
        parts.append("text")
    return " ".join(f"#S.{part}" for part in parts)


def named(parent: xml.Element, tag: str, id: str | None = None, **more: str) -> xml.Element:
    """Return an element appended to a parent, with an identifier and attributes."""
    attributes = {} if id is None else {XML + "id": id}
    return xml.SubElement(parent, tag, {**attributes, **more})


def with_text(
    parent: xml.Element, tag: str, text: str, id: str | None = None, **more: str
) -> xml.Element:
    """Return an element appended to a parent, with a text."""
    element = named(parent, tag, id, **more)
    element.text = text
    return element


def class_of(taxonomy: str, name: str) -> str:
    """Return the XML identifier of a category in a taxonomy, as in ``kind.missing-text``."""
    return f"{taxonomy}.{name.replace(' ', '-')}"


def _rights(available: xml.Element, rights: dict[str, str]) -> None:
    address = rights["licence_address"]
    with_text(available, "licence", f"The edition: {rights['licence']}", target=address)
    with_text(available, "p", rights["edition"])
    said = with_text(available, "p", f"{rights['status']} {rights['where']}: ")
    with_text(said, "quote", rights["says"], source="#S.text")


def _witnesses(found: xml.Element, given: list[dict[str, str]], scan: dict[str, str]) -> None:
    for each in given:
        witness = with_text(found, "witness", each["what"], id=each["siglum"])
        described = xml.SubElement(witness, "bibl")
        with_text(described, "title", scan["title"])
        with_text(described, "idno", each["sha256"], type="SHA-256")
        with_text(described, "note", scan["medium"], type="medium")
        for part in ("text", "appendix"):
            id = f"{each['siglum']}.{part}"
            with_text(described, "biblScope", scan[part], id=id, unit="part")
        with_text(described, "note", scan["state"], type="state")


def _encoding(encoding: xml.Element, scan: dict[str, Any]) -> None:
    declared = xml.SubElement(encoding, "editorialDecl")
    principles = scan["principles"]
    with_text(declared, "p", f"Kept: {principles['kept']}.")
    with_text(
        declared,
        "p",
        "A line of the listing is the number of a card, a dash, and its text: the num and the seg "
        "of an ab. The columns of seg are those of the card.",
    )
    with_text(
        declared,
        "p",
        "The attribute wit names the witness of a variant, which is the scan alone. The attribute "
        "source of an entry names the part of the scan from which the entry is known. The grounds "
        "on which an entry is decided are categories in its attribute ana, and no witnesses.",
    )
    correction = xml.SubElement(declared, "correction", method="markup")
    with_text(correction, "p", f"Emended: {principles['emended']}.")
    with_text(correction, "p", f"Conjectured: {principles['conjectured']}.")
    normalization = xml.SubElement(declared, "normalization", method="markup")
    with_text(normalization, "p", f"Normalized: {principles['normalized']}.")
    xml.SubElement(encoding, "variantEncoding", method="parallel-segmentation", location="internal")
    classes = xml.SubElement(encoding, "classDecl")
    _taxonomy(classes, "kind", "kinds of entries", KINDS.items())
    sure = CERTAINTY.items()
    _taxonomy(classes, "certainty", "how sure an entry is, and its value of cert", sure)
    grounds = [(each["siglum"], each["what"]) for each in scan["ground"]]
    _taxonomy(classes, "ground", "grounds of an entry, no witnesses of the text", grounds)


def _taxonomy(
    classes: xml.Element, name: str, described: str, categories: Iterable[tuple[str, str]]
) -> None:
    taxonomy = named(classes, "taxonomy", name)
    with_text(taxonomy, "desc", described)
    for each, what in categories:
        category = named(taxonomy, "category", class_of(name, each))
        with_text(category, "catDesc", f"{each}: {what}")


def _revisions(described: xml.Element) -> None:
    for revision in revisions():
        change = with_text(
            described, "change", f"{revision.what} ", when=revision.date, who=f"#{EDITORS}",
            target=" ".join(_targets(revision)),
        )  # fmt: skip
        if revision.digest:
            with_text(change, "idno", revision.digest, type="text-digest")


def _targets(revision: Revision) -> Iterator[str]:
    """Yield pointers to a revision's added or changed elements that still exist."""
    present = {entry["id"] for entry in facts("apparatus")["entry"]}
    yield from (f"#{id}" for id in (*revision.added, *revision.changed) if id in present)
    for program, cards in revision.cards.items():
        changed = numbers(cards)
        if changed == list(deck(program).cards):
            yield f"#{program}"
        else:
            yield from (f"#{program}.{number}" for number in changed)


def _when(released: str) -> dict[str, str]:
    return {"when": released} if released[:1].isdigit() else {}
