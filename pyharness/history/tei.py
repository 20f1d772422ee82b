"""The edition as a TEI P5 document: every card, the scan's variants, and the apparatus.

Each deck is in the order of its cards. A `pb` element marks the beginning of a page of the scan;
its `n` is the position of the page in the scan. An `app` element marks each place where the scan
differs from our text: `lem` is our reading, and `rdg` is the reading of the scan. To restore the
scan, take the pages in the order of `n` and each `rdg` instead of its `lem`. The lines of the scan
are then the cards, the `fw` elements and the `surplus` elements. An `fw` element is a heading added
by an editor, and a `surplus` element is text that belongs to no card at its place in the scan.
"""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple
from xml.etree import ElementTree as xml

import pyharness
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.original.cards import Card, deck, numbers, parallels
from pyharness.original.port_lines import Place

TITLE = "A Digital Computer Approach to the Unsymmetric Rigid Body Problem"
AUTHOR = "Richard Jacobs"
SCHEMA = "https://www.tei-c.org/Vault/P5/4.12.0/xml/tei/custom/schema/relaxng/tei_all.rng"
"""The schema of the document, from version 4.12.0 of the TEI guidelines."""

_XML = "{http://www.w3.org/XML/1998/namespace}"
_HEAD = (
    '<?xml version="1.0" encoding="utf-8"?>\n'
    f'<?xml-model href="{SCHEMA}" type="application/xml" '
    'schematypens="http://relaxng.org/ns/structure/1.0"?>\n'
)
_KINDS = {
    "defect": "a fault of the author, kept in the text",
    "reading": "the reading that is not adopted, where the scan leaves two open",
    "conjecture": "what is assumed where no card exists",
    "misreading": "characters or numbers that the scan has wrong",
    "normalization": "a name made uniform, where that of the scan is legal and computes the same",
    "redundant": "cards that compute what is known already, or what no result needs",
    "unread": "what is set or declared, and read by no card",
    "unreachable": "the aim of a jump that no card makes",
    "missing text": "cards that the scan or the report does not have",
    "dialect": "what only the FORTRAN of the machine explains",
}
# The degrees of certainty in the apparatus, and the values of `cert` in TEI.
_CERTAINTY = {
    "certain": "high",
    "probable": "medium",
    "conjecture": "low",
    "undecidable": "unknown",
}
# The fields of an apparatus entry that the document shows.
_TOLD = ("summary", "scan", "adopted", "original", "corrected", "evidence", "why")


class _Page(NamedTuple):
    """A page of the scan of the thesis, with its lines.

    `number` is the position of the page in the scan, from 1. `moved` is None if the page is in its
    proper place. Otherwise it is the identifier of the note in the critical apparatus that explains
    why the page is elsewhere.
    """

    number: int
    lines: list[Any]
    moved: str | None

    @property
    def first(self) -> int:
        return min(n for each in self.lines if isinstance(each, str) for n in numbers(each))


def tei_document() -> bytes:
    """Return the cards of the programs and the critical apparatus as a TEI document, in UTF-8.

    TEI is an XML format for editions of texts. The critical apparatus describes, for example, the
    mistakes and the doubtful statements of the programs.
    """
    root = xml.Element("TEI", xmlns="http://www.tei-c.org/ns/1.0")
    root.set(_XML + "lang", "en")
    _header(root)
    text = xml.SubElement(root, "text")
    body = xml.SubElement(text, "body")
    blocks = [block for program in PROGRAMS for block in _deck(body, program)]
    back = xml.SubElement(text, "back")
    _apparatus(_named(back, "div", type="apparatus"))
    _places(_named(back, "div", type="places"))
    # Indentation adds blanks, which are significant in a card: the cards are filled in after it.
    xml.indent(root)
    for block, card in blocks:
        _fill(block, card)
    return (_HEAD + xml.tostring(root, "unicode") + "\n").encode()


def _header(root: xml.Element) -> None:
    edition = facts("cards/scan")
    header = xml.SubElement(root, "teiHeader")
    file = xml.SubElement(header, "fileDesc")
    titles = xml.SubElement(file, "titleStmt")
    _with_text(titles, "title", f"{TITLE}: the three programs of the appendix, with an apparatus")
    _with_text(titles, "author", AUTHOR)
    _with_text(titles, "editor", "The pyharness authors")
    _with_text(xml.SubElement(file, "editionStmt"), "edition", f"pyharness {pyharness.__version__}")
    publication = xml.SubElement(file, "publicationStmt")
    _with_text(publication, "publisher", "The pyharness authors")
    available = xml.SubElement(publication, "availability")
    _with_text(
        available, "licence", "The edition: MIT", target="https://opensource.org/license/mit"
    )
    source = xml.SubElement(file, "sourceDesc")
    printed = xml.SubElement(source, "bibl")
    _with_text(printed, "author", AUTHOR)
    _with_text(printed, "title", TITLE)
    _with_text(printed, "publisher", "AFWAL")
    _with_text(printed, "date", "March 1982", when="1982-03")
    _with_text(printed, "biblScope", "appendix", unit="section")
    witnesses = xml.SubElement(source, "listWit")
    for each in edition["witness"]:
        witness = _with_text(witnesses, "witness", each["what"], id=each["siglum"])
        _with_text(witness, "idno", each["sha256"], type="SHA-256")

    encoding = xml.SubElement(header, "encodingDesc")
    declared = xml.SubElement(encoding, "editorialDecl")
    principles = edition["principles"]
    _with_text(declared, "p", f"Kept: {principles['kept']}.")
    _with_text(
        declared,
        "p",
        "A line of the listing is the number of a card, a dash, and its text: the num and the seg "
        "of an ab. The columns of seg are those of the card.",
    )
    correction = xml.SubElement(declared, "correction", method="markup")
    _with_text(correction, "p", f"Emended: {principles['emended']}.")
    _with_text(correction, "p", f"Conjectured: {principles['conjectured']}.")
    normalization = xml.SubElement(declared, "normalization", method="markup")
    _with_text(normalization, "p", f"Normalized: {principles['normalized']}.")
    xml.SubElement(encoding, "variantEncoding", method="parallel-segmentation", location="internal")
    classes = xml.SubElement(encoding, "classDecl")
    _taxonomy(classes, "kind", "kinds of entries", _KINDS.items())
    sure = _CERTAINTY.items()
    _taxonomy(classes, "certainty", "how sure an entry is, and its value of cert", sure)
    grounds = [(each["siglum"], each["what"]) for each in edition["ground"]]
    _taxonomy(classes, "ground", "grounds of an entry, no witnesses of the text", grounds)


def _deck(body: xml.Element, program: str) -> Iterator[tuple[xml.Element, Card]]:
    """Append the cards of a program to `body`, and yield a pair for each card.

    A pair consists of the XML element of the card, which does not yet contain the card's text, and
    the card itself. The pairs are yielded in the order of the cards.
    """
    div = _named(body, "div", program, type="deck")
    _with_text(div, "head", f"The {program} program")
    cards = deck(program).cards
    lost = [n for n, card in cards.items() if card.lost]
    for page in sorted(_pages(program), key=lambda each: each.first):
        begin = xml.SubElement(div, "pb", n=str(page.number), edRef="#S")
        if page.moved:
            begin.set("corresp", f"#{page.moved}")
        for item in page.lines:
            if isinstance(item, str):
                for number in numbers(item):
                    # A lost card is on no page; it precedes the next card that is on a page.
                    while lost and lost[0] < number:
                        card = cards[lost.pop(0)]
                        yield _block(div, card), card
                    yield _block(div, cards[number]), cards[number]
            elif "furniture" in item:
                _with_text(div, "fw", item["furniture"], type="furniture")
            else:
                line = xml.SubElement(div, "ab", type="phantom", corresp=f"#{item['entry']}")
                _with_text(line, "surplus", item["phantom"])


def _pages(program: str) -> list[_Page]:
    return [
        _Page(place, page["lines"], page.get("moved"))
        for place, page in enumerate(facts("cards/scan")["page"], 1)
        if page["program"] == program
    ]


def _block(div: xml.Element, card: Card) -> xml.Element:
    computes = card.number in deck(card.program).executable
    kind = "comment" if card.is_comment else "executable" if computes else "specification"
    block = _named(div, "ab", _id(card), type="card", subtype=kind, n=str(card.number))
    if beside := parallels(card):
        block.set("corresp", " ".join(f"#{_id(each)}" for each in beside))
    return block


def _fill(block: xml.Element, card: Card) -> None:
    block.set(_XML + "space", "preserve")
    if card.lost:
        where = {"reason": "lost", "corresp": f"#{card.lost}", "cert": _cert(card.lost)}
        block = xml.SubElement(block, "supplied", where)
    number = xml.SubElement(block, "num")
    if card.printed:
        _app(number, str(card.number), *card.printed)
    else:
        number.text = str(card.number)
    text = xml.SubElement(block, "seg")
    before: xml.Element | None = None
    for passage, difference in card.passages():
        if difference is None:
            if before is None:
                text.text = passage
            else:
                before.tail = passage
        else:
            before = _app(text, passage, difference.scans, difference.entry)


def _app(parent: xml.Element, ours: str, scans: str, entry: str) -> xml.Element:
    app = xml.SubElement(parent, "app", corresp=f"#{entry}")
    _with_text(app, "lem", ours, cert=_cert(entry))
    _with_text(app, "rdg", scans, wit="#S")
    return app


def _apparatus(div: xml.Element) -> None:
    _with_text(div, "head", "The apparatus")
    for entry in facts("apparatus")["entry"]:
        classes = [_class("kind", entry["kind"]), _class("certainty", entry["certainty"])]
        classes += [_class("ground", siglum) for siglum in entry["grounds"]]
        ana = " ".join(f"#{each}" for each in classes)
        note = _named(div, "note", entry["id"], type="entry", ana=ana)
        if entry["programs"]:
            note.set("target", " ".join(f"#{each}" for each in _targets(entry)))
        for name in _TOLD:
            if name in entry:
                _with_text(note, "seg", entry[name], type=name)
        xml.SubElement(note, "certainty", locus="value", cert=_CERTAINTY[entry["certainty"]])


def _targets(entry: dict[str, Any]) -> Iterator[str]:
    """Yield the XML identifiers of the cards that an entry of the critical apparatus names.

    An entry describes, for example, a defect of the printed programs. For a program of which the
    entry names no card, yield the identifier of the program's whole deck of cards.
    """
    for program in entry["programs"]:
        cards = deck(program).cards
        named = numbers(entry["cards"].get(program, ""))
        yield from (_id(cards[n]) for n in named) if named else (program,)


def _places(div: xml.Element) -> None:
    _with_text(div, "head", "Where the cards stand in the port and in the twin")
    for program in PROGRAMS:
        found = deck(program)
        for number, card in found.cards.items():
            for kind, places in (("port", found.port), ("twin", found.twin)):
                for place in places.get(number, ()):
                    _place(xml.SubElement(div, "note", type=kind, target=f"#{_id(card)}"), place)
            if number in found.absent:
                _with_text(div, "note", found.absent[number], type="absent", target=f"#{_id(card)}")


def _place(note: xml.Element, place: Place) -> None:
    cited = xml.SubElement(note, "cit")
    _with_text(cited, "quote", place.text)
    where = xml.SubElement(cited, "bibl")
    _with_text(where, "title", place.file)
    _with_text(where, "biblScope", str(place.line), unit="line")


def _taxonomy(
    classes: xml.Element, name: str, told: str, categories: Iterable[tuple[str, str]]
) -> None:
    taxonomy = _named(classes, "taxonomy", name)
    _with_text(taxonomy, "desc", told)
    for each, what in categories:
        category = _named(taxonomy, "category", _class(name, each))
        _with_text(category, "catDesc", f"{each}: {what}")


def _named(parent: xml.Element, tag: str, id: str | None = None, **more: str) -> xml.Element:
    named = {} if id is None else {_XML + "id": id}
    return xml.SubElement(parent, tag, {**named, **more})


def _with_text(
    parent: xml.Element, tag: str, text: str, id: str | None = None, **more: str
) -> xml.Element:
    element = _named(parent, tag, id, **more)
    element.text = text
    return element


def _id(card: Card) -> str:
    """Return a card's XML identifier, as in ``two-term.1660``.

    Here 1660 is the number on the card. Unlike the name of a card, the identifier may not contain a
    colon.
    """
    return f"{card.program}.{card.number}"


def _class(taxonomy: str, name: str) -> str:
    return f"{taxonomy}.{name.replace(' ', '-')}"


def _cert(entry: str) -> str:
    found = next(each for each in facts("apparatus")["entry"] if each["id"] == entry)
    return _CERTAINTY[found["certainty"]]
