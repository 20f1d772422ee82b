"""The site: no dead link, nothing from outside, everything of the edition on its page."""

import hashlib
import io
import json
import re
import tomllib
import zipfile
from itertools import pairwise

import pytest

from pyharness.edition import api, decks, documents, ledger, parallel_decks, site
from pyharness.edition.data_package import archive, data_package
from pyharness.edition.ledger import counts
from pyharness.edition.markdown import document, slug
from pyharness.history.ablation import entries
from pyharness.history.claims.ledger import claims, judgements, kinds_table
from pyharness.history.claims.stories import sentences
from pyharness.history.origins import disagreements
from pyharness.history.timeline import timeline
from pyharness.model.facts import facts, shipped
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Picture
from pyharness.thesis.cards import deck, tight
from pyharness.views import pictures
from tests.edition.pages import dead, pages


def test_no_link_is_dead(built_site: dict[str, bytes]) -> None:
    found = list(dead(built_site))
    scripts = [each for each in found if ": script " in each]
    assert scripts == [], "name it in scripts of _assets, edition/site.py"
    assert found == []


@pytest.mark.parametrize(("page", "old", "new"), [
    ("index.html", b'href="thesis.html"', b'href="these.html"'),
    ("claims.html", b'href="#evidence"', b'href="#evident"'),
    ("docs/article/article.html", b'src="../figures/', b'src="../figure/'),
    ("listing/two-term.html", b"../apparatus.html#", b"../apparatus.html#no-"),
])  # fmt: skip
def test_a_dead_link(built_site: dict[str, bytes], page: str, old: bytes, new: bytes) -> None:
    assert old in built_site[page]
    broken = built_site | {page: built_site[page].replace(old, new)}
    assert any(each.startswith(page) for each in dead(broken))


def test_pages_load_nothing_from_outside_and_name_places_once(built_site: dict[str, bytes]) -> None:
    assert sum(map(len, built_site.values())) < 15e6
    for name, page in pages(built_site).items():
        assert len(set(page.anchors)) == len(page.anchors), name
        for element, path, _ in page.targets:
            assert element == "a" or "//" not in path, (name, path)
            assert not path.startswith("/"), (name, path)  # it works under any path
        kinds = [each.get("type") for tag, each in page.elements if tag == "script"]
        assert "module" not in kinds, name  # which browsers refuse from a file
    ours = [name for name in built_site if name.endswith((".css", ".js"))]
    vendor = {file for each in site.vendor() for file in each["sha256"]}
    for name in ours:
        text = built_site[name].decode()
        if name.rpartition("/")[2] not in vendor:
            assert not re.search(r"\bfetch\(|XMLHttpRequest|new Worker|\bimport\(", text), name
        if name.endswith(".css"):
            assert not re.search(r"url\(|@import", text), name


def test_pages_have_landmarks_and_one_title(built_site: dict[str, bytes]) -> None:
    for name, page in pages(built_site).items():
        tags = [tag for tag, _ in page.elements]
        for tag in ("main", "header", "nav", "footer", "h1", "title"):
            assert tags.count(tag) == 1, (name, tag)
        assert dict(page.elements)["html"]["lang"] == "en"
        # A menu says where one is; a page behind an entry of it is under that entry.
        current = [each["aria-current"] for _, each in page.elements if each.get("aria-current")]
        assert current in (["page"], ["page", "page"], ["true", "page"], ["true", "true"]), name
        for tag, each in page.elements:
            if tag == "img":
                assert each.get("alt"), (name, each)
        # A heading is at most one level below the one before it. (The browser sees fewer of them.)
        levels = [int(tag[1]) for tag in tags if re.fullmatch("h[1-6]", tag)]
        assert all(below <= above + 1 for above, below in pairwise(levels)), name


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_card_is_there_with_its_scan(built_site: dict[str, bytes], program: str) -> None:
    page = pages(built_site)[f"listing/{program}.html"]
    cards = deck(program).cards
    assert [each for each in page.anchors if each.isdigit()] == [str(each) for each in cards]
    for card, view in zip(cards.values(), decks.card_views(program), strict=True):
        text = "".join(run.text for run in view.card)
        # A card that the scan lacks is in brackets.
        assert tight(text) == f"[{tight(card.text)}]" if card.lost else text == card.text
        for runs in (view.card, view.scan or []):
            for run in runs:
                assert run.entry is None or run.entry in card.entries
        marked = [tight(run.text) for run in view.card if run.entry]
        # Neighbours of one entry are one mark.
        assert "".join(marked) == "".join(each.ours for each in card.differences)


def test_marks_stand_where_the_scan_differs() -> None:
    (view,) = [each for each in decks.card_views("two-term") if each.number == 1260]
    assert [run.text for run in view.card if run.entry] == ["V", "V"]
    assert [run.text for run in view.scan or [] if run.entry] == ["U", "U"]
    assert view.kinds[0] == "defect"


def test_every_claim_entry_and_sentence_is_there(built_site: dict[str, bytes]) -> None:
    read = pages(built_site)
    for page, names in (
        ("claims.html", [each["id"] for each in claims()]),
        ("apparatus.html", [each["id"] for each in entries()]),
        ("figures.html", ["figure-07", "figure-10b-corrected"]),
        ("api.html", [each.name for each in api.entries()]),
    ):
        assert set(names) <= set(read[page].anchors), page
    thesis = " ".join(" ".join(read["thesis.html"].text).split())
    for each in sentences():
        assert " ".join(each.quote.split()) in thesis
    assert {each["number"] for each in facts("figures")["printed"]} == {
        int(anchor[7:9]) for anchor in read["figures.html"].anchors if anchor.startswith("figure-")
    }


def test_counts_and_verdicts_are_on_their_pages(built_site: dict[str, bytes]) -> None:
    counted = kinds_table(judgements())
    names = [each.head for each in counted.columns]
    table = {row[0]: dict(zip(names, row, strict=True)) for row in counted.rows}
    before, after = table["result"]["reproduced"].split(" / ")
    # A design is judged as printed, all else without the faults.
    sides = {"theory": 1, "design": 0, "history": 1, "recommendation": 1}
    hold, part, false, untested = (
        sum(int(table[kind][verdict].split(" / ")[side]) for kind, side in sides.items()
            if table[kind][verdict] != "-")
        for verdict in ("reproduced", "reproduced in part", "false", "not testable")
    )  # fmt: skip
    told = (
        f"Of 29 claims about results, the programs as printed reproduce {before}, and the "
        f"corrected ones {after}; of the 29 others, {hold} hold, {part} hold in part, {false} are "
        f"false, and {untested} cannot be tested."
    )
    assert hold + part + false + untested == 29
    for name in ("about.html", "claims.html"):
        assert told in " ".join(built_site[name].decode().split())
    told = f"Of 29 statements about results, the programs as printed reproduce {before},"
    home = " ".join(built_site["index.html"].decode().split())
    assert f"{told} and the corrected ones {after}." in home
    # Two verdicts on a result, one on any other claim.
    text = built_site["claims.html"].decode()
    for each in judgements():
        _, _, line = text.partition(f'id="{each.claim["id"]}"')
        line = line.partition("</summary>")[0]
        found = re.findall(r'class="verdict [\w-]+">([\w ]+)<', line)
        both = [each.original.verdict, each.corrected.verdict]
        if each.claim["kind"] == "result":
            assert found == both
        else:
            assert found == [both[sides[each.claim["kind"]]]]


def test_the_data_are_downloaded_from_every_page(built_site: dict[str, bytes]) -> None:
    for name, page in pages(built_site).items():
        assert [each.path for each in page.targets if each.path.endswith("data.zip")], name
    with zipfile.ZipFile(io.BytesIO(built_site["data.zip"])) as packed:
        found = {each.partition("/")[2]: packed.read(each) for each in packed.namelist()}
    assert found == data_package()
    assert built_site["data.zip"] == archive(found, "jacobs-1982-data")


def test_the_search_knows_cards_entries_claims_and_names(built_site: dict[str, bytes]) -> None:
    data = built_site["assets/search-data.js"].decode()
    places = json.loads(data.removeprefix("window.searchData=").removesuffix(";\n"))
    anchors = {name: set(page.anchors) for name, page in pages(built_site).items()}
    for each in places:
        page, _, anchor = each["href"].partition("#")
        assert anchor in anchors[page], each["href"]
    kinds = {each["kind"] for each in places}
    assert {"card", "claim", "defect", "misreading", "document", "API"} <= kinds
    assert sum(each["kind"] == "card" for each in places) == 528


def test_what_others_wrote_is_what_its_checksum_says() -> None:
    folder = shipped("web") / "vendor"
    listed = tomllib.loads((folder / "vendor.toml").read_text())["package"]
    named = {"vendor.toml", *(each["name"] for each in listed)}
    assert named == {each.name for each in folder.iterdir()}
    for package in listed:
        files = {file.name: file for file in (folder / package["name"]).iterdir()}
        assert set(files) == set(package["sha256"])
        for name, digest in package["sha256"].items():
            assert hashlib.sha256(files[name].read_bytes()).hexdigest() == digest


@pytest.mark.campaign
def test_builds_are_alike(built_site: dict[str, bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    def saved(picture: Picture, name: str, *more: str) -> dict[str, bytes]:
        if name in ("figure-07-together.svg", "figure-10b-corrected.svg"):
            return pictures.saved(picture, name, *more)
        names = (name, name.replace(".svg", ".csv"))
        return {each: built_site[f"figures/{each}"] for each in names}

    monkeypatch.setattr(ledger, "saved", saved)
    again = site.build_site()
    assert [name for name in again if again[name] != built_site[name]] == []
    assert again.keys() == built_site.keys()


def test_documents_are_pages() -> None:
    text = "# Title\n\nSee [it](methods.md#which-one), [that](../setup.py) and ![p](a.svg).\n"
    links = {"methods.md#which-one": "methods.html#which-one", "a.svg": "a.svg"}
    found = document(text, links.get)
    assert found.title == "Title"
    assert '<a href="methods.html#which-one">it</a>' in found.html
    assert "<a>that</a>" in found.html
    assert 'src="a.svg"' in found.html
    with pytest.raises(ValueError, match="no picture"):
        document("# T\n\n![p](b.svg)\n", links.get)
    # Formulas are MathML, and HTML is text.
    text = "# T\n\nSo $a_1 < b$ and <b>no</b>, `$x$`.\n\n$$c = d$$\n\n"
    found = document(f"{text}| | n |\n|---|---|\n| a | 1 |\n", lambda _: None)
    assert "<td></td>\n<th>n</th>" in found.html  # an empty corner is no head
    assert found.html.count("<math") == 2
    assert 'display="block"' in found.html
    assert "&lt;b&gt;no&lt;/b&gt;" in found.html
    assert "<code>$x$</code>" in found.html
    # What data say is text.
    page = site._templates().from_string("{{ told }} {{ number | number }}")
    assert page.render(told="<b> & c", number=0.25) == "&lt;b&gt; &amp; c 0.25"
    # Headings are named as on GitHub.
    text = "# T\n\n## Which one, *now*?\n\na\n\n## Which one now\n\nb `c` [d](e.md)\n"
    found = document(text, lambda _: None)
    assert [(part.anchor, part.title, part.text) for part in found.parts] == [
        ("t", "T", ""),
        ("which-one-now", "Which one, now?", "a"),
        ("which-one-now-1", "Which one now", "b c d"),
    ]
    assert 'id="which-one-now-1"' in found.html


def test_the_api_has_what_docstrings_say() -> None:
    found = {each.name: each for each in api.entries()}
    (title, attributes), *_ = found["Trajectory"].groups
    assert title == "Attributes"
    assert attributes[0].name == "time"
    assert [title for title, _ in found["solve"].groups] == ["Parameters", "Returns", "Raises"]
    assert "times: " in found["solve"].signature
    assert "numpy" not in found["solve"].signature
    methods = {each.name: each for each in found["Scene"].methods}
    assert methods["times"].anchor == "Scene.times"
    assert (methods["is_impossible"].kind, methods["is_impossible"].signature) == ("property", "")


def test_a_page_says_under_which_entry_of_the_menu_it_is(built_site: dict[str, bytes]) -> None:
    article = "docs/article/article.html"
    for name, *current in (
        ("index.html", ("index.html", "page")),
        (
            "listing/two-term.html", ("listing/index.html", "true"),
            ("listing/two-term.html", "page"),
        ),
        ("docs/explanation/words.html", ("about.html", "true"), ("docs/index.html", "true")),
        (article, ("about.html", "true"), (article, "page")),
        ("claims.html", ("thesis.html", "true"), ("claims.html", "page")),
    ):  # fmt: skip
        links = r'href="(?:\.\./)*([^"]*)" aria-current="(\w+)"'
        assert re.findall(links, built_site[name].decode()) == current


def test_dates_pictures_and_licences_are_on_the_site(built_site: dict[str, bytes]) -> None:
    shown = re.findall(r"<dt>([^<]*\d)</dt>", built_site["about.html"].decode())
    assert shown == [each.date for each in timeline() if each.certainty == "certain"]
    for each in timeline():
        assert each.date in built_site["docs/explanation/about-the-text.html"].decode()
    assert b"MIT" in built_site["assets/uplot-LICENSE.txt"]
    assert "docs/atlas/history.png" in built_site
    # What is not on the site is named, and no link.
    assert b'href="../../tests' not in built_site["docs/atlas/README.html"]


def test_disagreements_are_linked_from_operations_and_entries(built_site: dict[str, bytes]) -> None:
    links = {
        page: re.findall(r'href="(?:\.\./)*([^"]*)"', built_site[page].decode())
        for page in ("apparatus.html", "listing/collation.html")
    }
    shown = {each.row.what for each in parallel_decks.operations()}
    for each in disagreements():
        anchor = f"listing/collation.html#{slug(each.title)}"
        assert links["apparatus.html"].count(anchor) == len(each.entries), each.id
        assert links["listing/collation.html"].count(anchor) == len(shown & {*each.steps}), each.id


def test_verdicts_are_counted_for_both() -> None:
    judged = [each for each in judgements() if each.claim["id"].startswith("v2-case-2")]
    found = counts(judged)
    # Results alone: that none was found is history.
    others = [each.claim["id"] for each in judged if each.claim["kind"] != "result"]
    assert others == ["v2-case-2-no-error"]
    assert found["reproduced"] == (5, 2)
    assert sum(first for first, _ in found.values()) == len(judged) - 1
    assert sum(second for _, second in found.values()) == len(judged) - 1


@pytest.mark.parametrize(("name", "target", "found"), [
    ("atlas/README.md", "../article/article.md#results", "../article/article.html#results"),
    ("explanation/methods.md", "../figures/growth.svg", "../figures/growth.svg"),
    ("explanation/methods.md", "../../README.md", None),
    ("explanation/methods.md", "../contributing/testing.md", None),
    ("explanation/methods.md", "../atlas/stops.csv", "../atlas/stops.csv"),
    ("explanation/methods.md", "missing.md", None),
    ("explanation/methods.md", "../space-torque.toml", None),
    ("explanation/methods.md", "#which-one", "#which-one"),
    ("explanation/methods.md", "https://example.org/a.md", "https://example.org/a.md"),
])  # fmt: skip
def test_links_of_documents(name: str, target: str, found: str | None) -> None:
    assert documents._link(shipped("docs"), name, target) == found
