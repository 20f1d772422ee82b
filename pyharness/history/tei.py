"""The edition as a TEI P5 document: every card, the scan's variants, and the apparatus.

The elements are:

- `pb`: the beginning of a page, with its position `n` in the scan;
- `app`: a difference, where `lem` is our reading and `rdg` the scan's;
- `fw`: a heading added by an editor;
- `surplus`: text that belongs to no card.

Cards are in order. To restore the scan, take the pages in the order of `n`, each `rdg` instead of
its `lem`, and the lines of cards, `fw` and `surplus`.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple
from xml.etree import ElementTree as xml

from pyharness.history.tei_header import (
    CERTAINTY,
    EDITORS,
    XML,
    add_header,
    class_of,
    named,
    sources,
    with_text,
)
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import Card, Place, deck, numbers, parallels

SCHEMA = "https://www.tei-c.org/Vault/P5/4.12.0/xml/tei/custom/schema/relaxng/tei_all.rng"
"""The schema of the document, of version 4.12.0 of the TEI guidelines."""

_RESPONSIBLE = f"#{EDITORS}"
_HEAD = (
    '<?xml version="1.0" encoding="utf-8"?>\n'
    f'<?xml-model href="{SCHEMA}" type="application/xml" '
    'schematypens="http://relaxng.org/ns/structure/1.0"?>\n'
)
# The fields of an apparatus entry in the document.
_TOLD = ("summary", "scan", "adopted", "original", "corrected", "evidence", "why")


class _Page(NamedTuple):
    """A page of the scan; `moved` explains an unexpected place, or is None."""

    number: int
    lines: list[Any]
    moved: str | None

    @property
    def first(self) -> int:
        return min(n for each in self.lines if isinstance(each, str) for n in numbers(each))


def tei_document() -> bytes:
    """Return the cards and the apparatus as a TEI document, in UTF-8."""
    root = xml.Element("TEI", xmlns="http://www.tei-c.org/ns/1.0")
    root.set(XML + "lang", "en")
    add_header(root)
    text = xml.SubElement(root, "text")
    body = xml.SubElement(text, "body")
    blocks = [block for program in PROGRAMS for block in _deck(body, program)]
    back = xml.SubElement(text, "back")
    _apparatus(named(back, "div", type="apparatus"))
    _places(named(back, "div", type="places"))
    _bibliography(named(back, "div", type="bibliography"))
    # Indentation adds blanks, which are significant in cards; these are therefore filled in later.
    xml.indent(root)
    for block, card in blocks:
        _fill(block, card)
    return (_HEAD + xml.tostring(root, "unicode") + "\n").encode()


def _deck(body: xml.Element, program: str) -> Iterator[tuple[xml.Element, Card]]:
    div = named(body, "div", program, type="deck")
    with_text(div, "head", f"The {program} program")
    cards = deck(program).cards
    lost = [n for n, card in cards.items() if card.lost]
    for page in sorted(_pages(program), key=lambda each: each.first):
        begin = xml.SubElement(div, "pb", n=str(page.number), edRef="#S")
        if page.moved:
            begin.set("corresp", f"#{page.moved}")
        for item in page.lines:
            if isinstance(item, str):
                for number in numbers(item):
                    # A lost card, which is on no page, precedes the next card on a page.
                    while lost and lost[0] < number:
                        card = cards[lost.pop(0)]
                        yield _block(div, card), card
                    yield _block(div, cards[number]), cards[number]
            elif "furniture" in item:
                with_text(div, "fw", item["furniture"], type="furniture")
            else:
                line = xml.SubElement(div, "ab", type="phantom", corresp=f"#{item['entry']}")
                with_text(line, "surplus", item["phantom"])


def _pages(program: str) -> list[_Page]:
    return [
        _Page(place, page["lines"], page.get("moved"))
        for place, page in enumerate(facts("cards/scan")["page"], 1)
        if page["program"] == program
    ]


def _block(div: xml.Element, card: Card) -> xml.Element:
    kind = deck(card.program).statement_kind(card)
    block = named(div, "ab", _id(card), type="card", subtype=kind, n=str(card.number))
    if beside := parallels(card):
        block.set("corresp", " ".join(f"#{_id(each)}" for each in beside))
    return block


def _fill(block: xml.Element, card: Card) -> None:
    block.set(XML + "space", "preserve")
    if card.lost:
        where = {
            "reason": "lost",
            "corresp": f"#{card.lost}",
            "cert": _cert(card.lost),
            "resp": _RESPONSIBLE,
        }
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
    app = xml.SubElement(
        parent, "app", corresp=f"#{entry}", resp=_RESPONSIBLE, source="#S.appendix"
    )
    with_text(app, "lem", ours, cert=_cert(entry))
    with_text(app, "rdg", scans, wit="#S")
    return app


def _apparatus(div: xml.Element) -> None:
    with_text(div, "head", "The apparatus")
    for entry in facts("apparatus")["entry"]:
        classes = [class_of("kind", entry["kind"]), class_of("certainty", entry["certainty"])]
        classes += [class_of("ground", siglum) for siglum in entry["grounds"]]
        ana = " ".join(f"#{each}" for each in classes)
        note = named(div, "note", entry["id"], type="entry", ana=ana)
        note.set("resp", _RESPONSIBLE)
        note.set("source", sources(entry))
        if entry["programs"]:
            note.set("target", " ".join(f"#{each}" for each in _targets(entry)))
        for name in _TOLD:
            if name in entry:
                with_text(note, "seg", entry[name], type=name)
        xml.SubElement(note, "certainty", locus="value", cert=CERTAINTY[entry["certainty"]])


def _targets(entry: dict[str, Any]) -> Iterator[str]:
    for program in entry["programs"]:
        cards = deck(program).cards
        named = numbers(entry["cards"].get(program, ""))
        yield from (_id(cards[n]) for n in named) if named else (program,)


def _places(div: xml.Element) -> None:
    with_text(div, "head", "Where the cards stand in the port and in the twin")
    for program in PROGRAMS:
        found = deck(program)
        for number, card in found.cards.items():
            for kind, places in (("port", found.port), ("twin", found.twin)):
                for place in places.get(number, ()):
                    _write_place(
                        xml.SubElement(div, "note", type=kind, target=f"#{_id(card)}"), place
                    )
            if number in found.absent:
                with_text(div, "note", found.absent[number], type="absent", target=f"#{_id(card)}")


def _write_place(note: xml.Element, place: Place) -> None:
    cited = xml.SubElement(note, "cit")
    with_text(cited, "quote", place.text)
    where = xml.SubElement(cited, "bibl")
    with_text(where, "title", place.file)
    with_text(where, "biblScope", str(place.line), unit="line")


def _bibliography(div: xml.Element) -> None:
    with_text(div, "head", "Works cited")
    works = xml.SubElement(div, "listBibl")
    for each in facts("edition")["work"]:
        work = named(works, "bibl", f"work.{each['id']}")
        with_text(work, "author", each["author"])
        with_text(work, "title", each["title"])
        with_text(work, "note", each["imprint"], type="imprint")
        with_text(work, "note", each["use"], type="use")


def _id(card: Card) -> str:
    return f"{card.program}.{card.number}"


def _cert(entry: str) -> str:
    found = next(each for each in facts("apparatus")["entry"] if each["id"] == entry)
    return CERTAINTY[found["certainty"]]
