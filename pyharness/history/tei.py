"""The edition as a TEI P5 document: every card, the scan's variants, and the apparatus.

Its elements are:

- `pb`: the beginning of a page, with its position `n` in the scan;
- `app`: a difference, where `lem` is our reading and `rdg` the scan's;
- `fw`: a heading added by an editor;
- `surplus`: text that belongs to no card.

Cards are in the order of their numbers. The scan's text is the pages in the order of `n`, with
their cards, `fw` and `surplus`, and each `rdg` for its `lem`.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import pyharness
from pyharness.history.timeline import Revision, revisions
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import Card, deck, numbers, parallels

SCHEMA = "https://www.tei-c.org/Vault/P5/4.12.0/xml/tei/custom/schema/relaxng/tei_all.rng"
"""Schema of the document, from version 4.12.0 of the TEI guidelines."""
TITLE = "A Digital Computer Approach to the Unsymmetric Rigid Body Problem"
AUTHOR = "Richard Jacobs"
_XML = "{http://www.w3.org/XML/1998/namespace}"
_RESPONSIBLE = "#editors"
_HEAD = (
    '<?xml version="1.0" encoding="utf-8"?>\n'
    f'<?xml-model href="{SCHEMA}" type="application/xml" '
    'schematypens="http://relaxng.org/ns/structure/1.0"?>\n'
)
# Fields of apparatus entries that the document has.
_TOLD = ("summary", "scan", "adopted", "original", "corrected", "evidence", "why")

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
"""The kinds of apparatus entries, with descriptions."""

CERTAINTY = {"certain": "high", "probable": "medium", "conjecture": "low", "undecidable": "unknown"}
"""The degrees of certainty in the apparatus, with TEI's values of `cert`."""


def tei_document() -> bytes:
    root = xml.Element("TEI", xmlns="http://www.tei-c.org/ns/1.0")
    root.set(_XML + "lang", "en")
    root.append(_header())
    text = _add(root, "text")
    body = _add(text, "body")
    blocks = [block for program in PROGRAMS for block in _deck(body, program)]
    back = _add(text, "back")
    _write_apparatus(_add(back, "div", type="apparatus"))
    _write_places(_add(back, "div", type="places"))
    _write_bibliography(_add(back, "div", type="bibliography"))
    # Fill in the cards after the indentation, whose blanks would be significant in them.
    xml.indent(root)
    for block, card in blocks:
        _fill(block, card)
    return (_HEAD + xml.tostring(root, "unicode") + "\n").encode()


def _add(
    parent: xml.Element, tag: str, text: str | None = None, id: str | None = None, **more: str
) -> xml.Element:
    element = xml.SubElement(parent, tag, {} if id is None else {_XML + "id": id}, **more)
    element.text = text
    return element


def _header() -> xml.Element:
    edition, scan, version = facts("edition"), facts("cards/scan"), pyharness.__version__
    released = edition["released"].get(version, "") or "no date"
    values = {
        "title": TITLE, "author": AUTHOR, "version": version, "edition": edition, "scan": scan,
        "released": released, "when": released if released[:1].isdigit() else "",
    }  # fmt: skip
    header = xml.fromstring(Path(__file__).with_name("tei-header.xml").read_text(encoding="utf-8"))
    for element in header.iter():
        element.text = element.text and element.text.format(**values)
        attributes = {name: text.format(**values) for name, text in element.items()}
        element.attrib = {name: text for name, text in attributes.items() if text}
    lists = {element.tag: element for element in header.iter()}
    for place, name in enumerate(edition["editors"]):
        lists["respStmt"].insert(place, xml.Element("name"))
        lists["respStmt"][place].text = name
    grounds = {each["siglum"]: each["what"] for each in scan["ground"]}
    for name, described, categories in (
        ("kind", "kinds of entries", KINDS),
        ("certainty", "how sure an entry is, and its value of cert", CERTAINTY),
        ("ground", "grounds of an entry, no witnesses of the text", grounds),
    ):
        taxonomy = _add(lists["classDecl"], "taxonomy", id=name)
        _add(taxonomy, "desc", described)
        for each, what in categories.items():
            category = _add(taxonomy, "category", id=_class_of(name, each))
            _add(category, "catDesc", f"{each}: {what}")
    for revision in revisions():
        change = _add(
            lists["revisionDesc"], "change", f"{revision.what} ", when=revision.date,
            who=_RESPONSIBLE, target=" ".join(_changed(revision)),
        )  # fmt: skip
        if revision.digest:
            _add(change, "idno", revision.digest, type="text-digest")
    return header


def _class_of(taxonomy: str, name: str) -> str:
    return f"{taxonomy}.{name.replace(' ', '-')}"


def _changed(revision: Revision) -> Iterator[str]:
    """Yield pointers to the elements that a revision added or changed and that still exist."""
    present = {entry["id"] for entry in facts("apparatus")["entry"]}
    yield from (f"#{id}" for id in (*revision.added, *revision.changed) if id in present)
    for program, cards in revision.cards.items():
        changed = numbers(cards)
        if changed == list(deck(program).cards):
            yield f"#{program}"
        else:
            yield from (f"#{program}.{number}" for number in changed)


def _deck(body: xml.Element, program: str) -> Iterator[tuple[xml.Element, Card]]:
    div = _add(body, "div", id=program, type="deck")
    _add(div, "head", f"The {program} program")
    cards = deck(program).cards
    lost = [n for n, card in cards.items() if card.lost]
    scan = enumerate(facts("cards/scan")["page"], 1)
    pages = [(place, page) for place, page in scan if page["program"] == program]
    for place, page in sorted(pages, key=lambda each: first_card(each[1]["lines"])):
        begin = _add(div, "pb", n=str(place), edRef="#S")
        if "moved" in page:  # apparatus entry that explains the page's unexpected position
            begin.set("corresp", f"#{page['moved']}")
        for item in page["lines"]:
            if isinstance(item, str):
                for number in numbers(item):
                    # A lost card is on no page; write it before the next card.
                    while lost and lost[0] < number:
                        card = cards[lost.pop(0)]
                        yield _block(div, card), card
                    yield _block(div, cards[number]), cards[number]
            elif "furniture" in item:
                _add(div, "fw", item["furniture"], type="furniture")
            else:
                line = _add(div, "ab", type="phantom", corresp=f"#{item['entry']}")
                _add(line, "surplus", item["phantom"])


def first_card(lines: Iterable[Any]) -> int:
    return min(n for each in lines if isinstance(each, str) for n in numbers(each))


def _block(div: xml.Element, card: Card) -> xml.Element:
    kind = deck(card.program).statement_kind(card)
    block = _add(div, "ab", id=_id(card), type="card", subtype=kind, n=str(card.number))
    if beside := parallels(card):
        block.set("corresp", " ".join(f"#{_id(each)}" for each in beside))
    return block


def _fill(block: xml.Element, card: Card) -> None:
    block.set(_XML + "space", "preserve")
    if card.lost:
        block = _add(
            block, "supplied", reason="lost", corresp=f"#{card.lost}", cert=_cert(card.lost),
            resp=_RESPONSIBLE,
        )  # fmt: skip
    number = _add(block, "num")
    if card.printed:
        _write_variant(number, str(card.number), *card.printed)
    else:
        number.text = str(card.number)
    text = _add(block, "seg")
    before: xml.Element | None = None
    for passage, difference in card.passages():
        if difference is not None:
            before = _write_variant(text, passage, difference.scans, difference.entry)
        elif before is None:
            text.text = passage
        else:
            before.tail = passage


def _write_variant(parent: xml.Element, ours: str, scans: str, entry: str) -> xml.Element:
    app = _add(parent, "app", corresp=f"#{entry}", resp=_RESPONSIBLE, source="#S.appendix")
    _add(app, "lem", ours, cert=_cert(entry))
    _add(app, "rdg", scans, wit="#S")
    return app


def _write_apparatus(div: xml.Element) -> None:
    _add(div, "head", "The apparatus")
    for entry in facts("apparatus")["entry"]:
        classes = [_class_of("kind", entry["kind"]), _class_of("certainty", entry["certainty"])]
        classes += [_class_of("ground", siglum) for siglum in entry["grounds"]]
        ana = " ".join(f"#{each}" for each in classes)
        note = _add(div, "note", id=entry["id"], type="entry", ana=ana, resp=_RESPONSIBLE)
        # The appendix of the thesis is a source only if the entry names cards.
        parts = ["appendix"] if entry["cards"] else []
        if not parts or {"T", "R"} & set(entry["grounds"]):
            parts.append("text")
        note.set("source", " ".join(f"#S.{part}" for part in parts))
        if entry["programs"]:
            note.set("target", " ".join(f"#{each}" for each in _targets(entry)))
        for name in _TOLD:
            if name in entry:
                _add(note, "seg", entry[name], type=name)
        _add(note, "certainty", locus="value", cert=CERTAINTY[entry["certainty"]])


def _targets(entry: dict[str, Any]) -> Iterator[str]:
    for program in entry["programs"]:
        cards = deck(program).cards
        named = numbers(entry["cards"].get(program, ""))
        yield from (_id(cards[n]) for n in named) if named else (program,)


def _write_places(div: xml.Element) -> None:
    _add(div, "head", "Where the cards stand in the port and in the twin")
    for program in PROGRAMS:
        found = deck(program)
        for number, card in found.cards.items():
            target = f"#{_id(card)}"
            for kind, places in (("port", found.port), ("twin", found.twin)):
                for place in places.get(number, ()):
                    cited = _add(_add(div, "note", type=kind, target=target), "cit")
                    _add(cited, "quote", place.text)
                    where = _add(cited, "bibl")
                    _add(where, "title", place.file)
                    _add(where, "biblScope", str(place.line), unit="line")
            if number in found.absent:
                _add(div, "note", found.absent[number], type="absent", target=target)


def _write_bibliography(div: xml.Element) -> None:
    _add(div, "head", "Works cited")
    works = _add(div, "listBibl")
    for each in facts("edition")["work"]:
        work = _add(works, "bibl", id=f"work.{each['id']}")
        _add(work, "author", each["author"])
        _add(work, "title", each["title"])
        _add(work, "note", each["imprint"], type="imprint")
        _add(work, "note", each["use"], type="use")


def _id(card: Card) -> str:
    return f"{card.program}.{card.number}"


def _cert(entry: str) -> str:
    found = next(each for each in facts("apparatus")["entry"] if each["id"] == entry)
    return CERTAINTY[found["certainty"]]
