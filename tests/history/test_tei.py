"""The edition as TEI: it is valid and complete, and the scan can be reconstructed from it."""

import lzma
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import pytest
import yaml
from lxml import etree

import pyharness
from pyharness.cli.main import main
from pyharness.history.cards_report import card_record
from pyharness.history.tei import AUTHOR, SCHEMA, TITLE, tei_document
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import chosen, tight
from pyharness.thesis.collation import expected_lines

HERE = Path(__file__).parent
SOURCE = tomllib.loads((HERE / "tei_all.toml").read_text())
CITATION = yaml.safe_load((HERE.parents[1] / "CITATION.cff").read_text())
TEI = "{http://www.tei-c.org/ns/1.0}"
ID = "{http://www.w3.org/XML/1998/namespace}id"
SPACE = "{http://www.w3.org/XML/1998/namespace}space"
POINTERS = ("target", "corresp", "ana", "wit", "edRef", "resp", "source")
TEXT = tei_document().decode()


@pytest.fixture(scope="module")
def schema() -> Any:
    """Return the schema without the elements that are not used: the whole takes 16 s to read."""
    text = lzma.decompress((HERE / "tei_all.rng.xz").read_bytes())
    assert sha256(text).hexdigest() == SOURCE["sha256"]
    assert f"TEI Edition: P5 Version {SOURCE['version']}." in " ".join(text[:1000].decode().split())
    whole, relax = etree.fromstring(text), "{http://relaxng.org/ns/structure/1.0}"
    used = {each.tag.removeprefix(TEI) for each in xml.fromstring(TEXT).iter()}
    for each in list(whole.iter(relax + "element")):
        if each.get("name") not in {*used, None}:
            each.getparent().replace(each, etree.Element(relax + "notAllowed"))
    return etree.RelaxNG(whole)


@pytest.fixture(scope="module")
def root() -> xml.Element:
    return xml.fromstring(TEXT)


def _blocks(root: xml.Element) -> list[xml.Element]:
    return [each for each in root.iter(TEI + "ab") if each.get("type") == "card"]


def _reading(element: xml.Element, without: str) -> str:
    """Return the text of an element without the text in `without`, which is `lem` or `rdg`."""
    own = "" if element.tag == TEI + without else element.text or ""
    return own + "".join(_reading(each, without) + (each.tail or "") for each in element)


def _line(block: xml.Element) -> str | None:
    """Return the line of the scan without blanks, like a card's `scan`; None if it is supplied."""
    if block.find(TEI + "supplied") is not None:
        return None
    number, text = block
    return f"{tight(_reading(number, 'lem'))}-{tight(_reading(text, 'lem'))}"


def _unresolved(root: xml.Element) -> set[str]:
    pointers = {p for e in root.iter() for name in POINTERS for p in (e.get(name) or "").split()}
    ids = {each.get(ID) for each in root.iter()}
    return {p for p in pointers if p[0] == "#" and p[1:] not in ids}


@pytest.mark.campaign
def test_document_is_valid(schema: Any) -> None:
    assert schema.validate(etree.fromstring(TEXT.encode())), schema.error_log
    assert SOURCE["home"] == SCHEMA
    assert f"/{SOURCE['version']}/" in SCHEMA
    assert SCHEMA in TEXT.splitlines()[1]


@pytest.mark.sampled
@pytest.mark.parametrize(("ours", "other"), [
    ("lem", "lemma"), (' locus="value"', ""), ('<lem cert="high">', '<lem cert="certain">'),
    ("<listWit>", "<listWit><p>none</p>"), ('method="parallel-segmentation" ', ""),
    ('unit="line"', 'line="line"'),
])  # fmt: skip
def test_document_with_a_mistake_is_refused(ours: str, other: str, schema: Any) -> None:
    assert ours in TEXT
    assert not schema.validate(etree.fromstring(TEXT.replace(ours, other).encode()))


def test_every_card_stands_there_once_in_the_order_of_the_decks(root: xml.Element) -> None:
    found = [(each.get(ID), each.get("n")) for each in _blocks(root)]
    assert found == [(f"{c.program}.{c.number}", str(c.number)) for c in chosen(())]
    assert Counter(each.get(ID) for each in root.iter() if each.get(ID)).most_common(1)[0][1] == 1
    decks = [each.get(ID) for each in root.iter(TEI + "div") if each.get("type") == "deck"]
    assert decks == list(PROGRAMS)


def test_text_and_scan_of_every_card_are_there_with_the_blanks(root: xml.Element) -> None:
    for block, card in zip(_blocks(root), chosen(()), strict=True):
        assert block.get(SPACE) == "preserve"
        assert _reading(block, "rdg") == f"{card.number}{card.text}", card.name
        assert _line(block) == card.scan, card.name


def test_every_page_of_the_scan_can_be_had_again(root: xml.Element) -> None:
    pages: dict[int, list[str]] = {}
    for div in root.iter(TEI + "div"):
        number = 0
        for each in div if div.get("type") == "deck" else ():
            if each.tag == TEI + "pb":
                number = int(each.attrib["n"])
                pages[number] = []
            elif each.tag == TEI + "fw" or each.get("type") == "phantom":
                pages[number].append(tight("".join(each.itertext())))
            elif (line := _line(each) if each.tag == TEI + "ab" else None) is not None:
                pages[number].append(line)
    assert sorted(pages) == list(range(1, len(facts("cards/scan")["page"]) + 1))
    assert [each for n in sorted(pages) for each in pages[n]] == [e for e, _ in expected_lines()]
    moved = [each for each in root.iter(TEI + "pb") if each.get("corresp")]
    assert [(each.get("n"), each.get("corresp")) for each in moved] == [("12", "#noise-order")]


def test_every_difference_stands_there_once_with_its_entry(root: xml.Element) -> None:
    sure = ((each, each.find(f".//{TEI}certainty")) for each in root.iter(TEI + "note"))
    cert = {each.get(ID): part.get("cert") for each, part in sure if part is not None}
    for block, card in zip(_blocks(root), chosen(()), strict=True):
        wanted = [(str(card.number), *card.printed)] if card.printed else []
        wanted += [(each.ours, each.scans, each.entry) for each in card.differences]
        found = []
        for app in block.iter(TEI + "app"):
            lemma, reading = app
            entry = app.attrib["corresp"][1:]
            found.append((tight(lemma.text or ""), reading.text or "", entry))
            assert reading.get("wit") == "#S"
            assert lemma.get("cert") == cert[entry]
        assert found == wanted, card.name


def _records(root: xml.Element) -> Iterator[dict[str, Any]]:
    notes = list(root.iter(TEI + "note"))
    named: dict[tuple[str | None, str], list[xml.Element]] = {}
    for each in notes:
        for target in each.get("target", "").split():
            named.setdefault((each.get("type"), target), []).append(each)
    for block in _blocks(root):
        pointer = f"#{block.get(ID)}"
        program, number = pointer[1:].rsplit(".", 1)
        text, line = _reading(block[-1], "rdg"), _line(block)
        if block.find(TEI + "supplied") is not None:
            text = text.removeprefix(number)
        places: dict[str, list[dict[str, Any]]] = {"port": [], "twin": []}
        for kind, found in places.items():
            for each in named.get((kind, pointer), []):
                quote, bibl = each[0]
                line_ = int(bibl[1].text or "")
                found.append({"file": bibl[0].text, "line": line_, "text": quote.text})
        absent = [each.text for each in named.get(("absent", pointer), [])]
        yield {
            "program": program,
            "card": int(number),
            "statement": " ".join(text.split()),
            "scan": None if line == f"{number}-{tight(text)}" else line or "",
            "differences": [
                {"ours": tight(app[0].text or ""), "scans": app[1].text or "",
                 "entry": app.attrib["corresp"][1:]}
                for app in block[-1].iter(TEI + "app")
            ],
            "entries": [each.get(ID) for each in named.get(("entry", pointer), [])],
            "fortran": places["port"],
            "twin": places["twin"],
            "absent": absent[0] if absent else None,
            "parallels": [
                ":".join(each[1:].rsplit(".", 1)) for each in block.get("corresp", "").split()
            ],
        }  # fmt: skip


def test_what_json_has_of_a_card_can_be_had_from_it(root: xml.Element) -> None:
    for found, card in zip(_records(root), chosen(()), strict=True):
        assert found == card_record(card), card.name


def test_every_entry_stands_there_once_as_in_the_table(root: xml.Element) -> None:
    entries = [each for each in root.iter(TEI + "note") if each.get("type") == "entry"]
    kinds = root.iter(TEI + "category")
    classes = {f"#{each.get(ID)}": (each[0].text or "").split(": ") for each in kinds}
    ids = [each["id"] for each in facts("apparatus")["entry"]]
    assert [each.get(ID) for each in entries] == ids
    for note, entry in zip(entries, facts("apparatus")["entry"], strict=True):
        told = {part.get("type"): part.text for part in note.iter(TEI + "seg")}
        names = ("summary", "scan", "adopted", "original", "corrected", "evidence", "why")
        assert told == {name: entry[name] for name in names if name in entry}
        kind, certainty, *grounds = (classes[each] for each in note.attrib["ana"].split())
        assert (kind[0], certainty[0]) == (entry["kind"], entry["certainty"])
        assert [each[0] for each in grounds] == entry["grounds"]
        (sure,) = note.iter(TEI + "certainty")
        assert sure.get("cert") == certainty[1]
        programs = {each[1:].split(".")[0] for each in note.get("target", "").split()}
        assert programs == set(entry["programs"])


def test_pointers_lead_somewhere_and_the_command_writes_it(
    root: xml.Element, tmp_path: Path
) -> None:
    assert _unresolved(root) == set()
    without = xml.fromstring(TEXT.replace('xml:id="noise-t3"', 'n="noise-t3"'))
    assert _unresolved(without) == {"#noise-t3"}
    out = tmp_path / "edition.xml"
    assert main(["cards", "--format", "tei", "--out", str(out)]) == 0
    assert out.read_bytes() == TEXT.encode()


def test_the_scan_alone_is_a_witness(root: xml.Element) -> None:
    sigla = [each["siglum"] for each in facts("cards/scan")["ground"]]
    assert [each.get(ID) for each in root.iter(TEI + "witness")] == ["S"]
    grounds = next(e for e in root.iter(TEI + "taxonomy") if e.get(ID) == "ground")
    found = [each.get(ID) for each in grounds.iter(TEI + "category")]
    assert found == [f"ground.{each}" for each in sigla]
    for text in facts("cards/scan")["principles"].values():
        assert text in TEXT


def _part(root: xml.Element, path: str) -> xml.Element:
    found = root.find("/".join(f"{TEI}{name}" for name in path.split("/")))
    assert found is not None, path
    return found


def test_header_says_who_is_responsible_and_since_when(root: xml.Element) -> None:
    """The date is that of the changelog, and not of the day on which the document is written."""
    responsible = _part(root, "teiHeader/fileDesc/titleStmt/respStmt")
    names = [each.text for each in responsible.iter(TEI + "name")]
    assert names == [each["name"] for each in CITATION["authors"]]
    changelog = (HERE.parents[1] / "CHANGELOG.md").read_text()
    versions = re.findall(r"^## (\S+)(?: \((\S+)\))?$", changelog, re.MULTILINE)
    assert facts("edition")["released"] == dict(versions)
    edition = _part(root, "teiHeader/fileDesc/editionStmt/edition")
    date = _part(root, "teiHeader/fileDesc/publicationStmt/date")
    version = edition.attrib["n"]
    assert version == pyharness.__version__
    released = dict(versions).get(version) or "no date"
    assert date.text == released
    assert (date.get("when") or "") == (released if released[:1].isdigit() else "")


def test_rights_and_witness_are_described(root: xml.Element) -> None:
    available = _part(root, "teiHeader/fileDesc/publicationStmt/availability")
    rights, described = facts("edition")["rights"], facts("edition")["witness"]
    text = "".join(available.itertext())
    assert all(rights[name] in text for name in ("status", "edition", "where", "says"))
    (quote,) = available.iter(TEI + "quote")
    assert (quote.text, quote.get("source")) == (rights["says"], "#S.text")
    (witness,) = root.iter(TEI + "witness")
    assert {each.get(ID) for each in witness.iter(TEI + "biblScope")} == {"S.text", "S.appendix"}
    (checksum,) = (each.text for each in witness.iter(TEI + "idno"))
    assert checksum == facts("cards/scan")["witness"][0]["sha256"]
    assert described["state"] in "".join(witness.itertext())
    assert described["siglum"] == witness.get(ID)


def test_every_entry_says_who_decides_and_from_which_source(root: xml.Element) -> None:
    responsible = {each.get(ID) for each in root.iter(TEI + "respStmt")}
    parts = {f"#{each.get(ID)}" for each in root.iter(TEI + "biblScope")}
    entries = {each["id"]: each for each in facts("apparatus")["entry"]}
    notes = [each for each in root.iter(TEI + "note") if each.get("type") == "entry"]
    for each in [*notes, *root.iter(TEI + "app"), *root.iter(TEI + "supplied")]:
        assert each.attrib["resp"][1:] in responsible
    for each in [*notes, *root.iter(TEI + "app")]:
        assert set(each.attrib["source"].split()) <= parts
    for note in notes:
        entry = entries[note.attrib[ID]]
        # Grounds are categories and no sources.
        sources = note.attrib["source"].split()
        assert sources
        assert ("#S.appendix" in sources) == bool(entry["cards"])


def test_bibliography_is_that_of_the_data_and_the_citation(root: xml.Element) -> None:
    (works,) = root.iter(TEI + "listBibl")
    listed = [f"work.{each['id']}" for each in facts("edition")["work"]]
    assert [each.get(ID) for each in works] == listed
    assert facts("edition")["rights"]["licence"] == "MIT"
    (thesis,) = CITATION["references"]
    (author,) = thesis["authors"]
    assert facts("edition")["work"][0]["title"] == thesis["title"] == TITLE
    assert f"{author['given-names']} {author['family-names']}" == AUTHOR
    assert f'when="{thesis["year"]}-{thesis["month"]:02}"' in TEXT
