"""The citation: BibTeX and linked data of the page about the edition."""

import json
import re
from pathlib import Path

import pytest

from pyharness.edition import citation, site
from pyharness.edition.citation import (
    PUBLISH,
    bibtex,
    check_publishable,
    cite_data,
    codemeta,
    csl,
    linked_data,
    release_date,
)
from pyharness.edition.site import build_site
from pyharness.history.identifiers import DATA, data_identifier, text_digest
from pyharness.model.errors import InputError
from pyharness.model.facts import facts, shipped
from tests.edition.pages import pages

PREVIEW = "figures/preview.png"


def _fields(entry: str) -> dict[str, str]:
    return dict(re.findall(r"^  (\w+) = \{(.*)\},$", entry, re.MULTILINE))


def test_bibtex_cites_the_edition_and_the_thesis() -> None:
    edition, thesis = bibtex().split("\n\n")
    assert edition.startswith(f"@misc{{pyharness-{codemeta()['version']},\n")
    assert thesis.startswith("@techreport{jacobs-1982,\n")
    for entry in (edition, thesis):
        assert entry.count("{") == entry.count("}")
        assert not set(entry) & set("&%$#_~^\\")  # which BibTeX would not take as they are
        assert entry.isascii()
    found, cited, work = _fields(edition), _fields(thesis), facts("account")["work"]
    assert (found["version"], found["year"]) == (codemeta()["version"], release_date()[:4])
    assert text_digest() in found["note"]
    assert data_identifier() in found["note"]
    assert (cited["author"], work["author"]) == ("Jacobs, Richard", "Richard Jacobs")
    assert (cited["year"], cited["month"], work["published"]) == ("1982", "3", "March 1982")
    assert "AFWAL" in cited["institution"]
    assert f"submitted in {work['submitted']}" in cited["note"]
    assert "number of the report is unknown to us" in cited["note"]


def test_a_place_is_cited_as_bibtex_and_csl(monkeypatch: pytest.MonkeyPatch) -> None:
    place = "card 860 of the runge-kutta program", "listing/runge-kutta.html#860"
    for address, url in (
        ("", None),
        ("https://example.org/e/", f"https://example.org/e/{place[1]}"),
    ):
        monkeypatch.setattr(citation, "address", lambda address=address: address)
        edition, report = csl(*place)
        cited = _fields(bibtex(*place).split("\n\n")[0])
        for title in (edition["title"], cited["title"]):
            assert place[0] in title
        assert edition.get("URL") == cited.get("url") == url
        assert place[1] in (url or cited["howpublished"])
        assert text_digest() in edition["note"]
        assert (report["type"], report["issued"]) == ("report", {"date-parts": [[1982, 3]]})
        assert "submitted in July 1981" in report["note"]
        assert report["author"] == [{"family": "Jacobs", "given": "Richard"}]


def test_placeholders_are_not_published(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With an address, the pages are built only from a CITATION.cff without placeholders."""
    check_publishable()
    monkeypatch.setattr(citation, "address", lambda: "https://example.org/")
    with pytest.raises(InputError, match=r"^CITATION.cff:10: SURNAME is a placeholder; fill it in"):
        build_site()
    lines = shipped("CITATION.cff").read_text().splitlines()
    filled = tmp_path / "CITATION.cff"
    monkeypatch.setattr(citation, "shipped", lambda _: filled)
    while True:
        filled.write_text("\n".join(lines))
        try:
            check_publishable()
        except InputError as error:
            del lines[int(str(error).split(":")[1]) - 1]
        else:
            break
    assert not any("YYYY" in line or "DOI OF" in line for line in lines)
    assert "authors:" in lines


def test_pages_say_their_address_or_how_to_give_one(
    built_site: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    read = pages(built_site)
    told = " ".join("".join(read["about.html"].text).split())
    assert PUBLISH in told
    assert f"Editors: {'; '.join(facts('edition')['editors'])} (" in told
    for name, page in read.items():
        (cite,) = (each for _, each in page.elements if each.get("id") == "cite-page")
        assert (cite["data-path"], str(cite["href"])[-15:]) == (name, "about.html#cite")
        assert not any(each.get("rel") == "canonical" for _, each in page.elements)
    monkeypatch.setattr(site, "address", lambda: "https://example.org/")
    found = site._rendered(site.Page("search.html", "Search", "search.html")).decode()
    assert '<link rel="canonical" href="https://example.org/search.html">' in found
    assert f'content="https://example.org/{PREVIEW}"' in found
    assert built_site[PREVIEW].startswith(b"\x89PNG")
    data = built_site["assets/cite-data.js"].decode()
    assert json.loads(data.removeprefix("window.citeData=").removesuffix(";\n")) == cite_data()


def test_the_date_is_that_of_a_publication(monkeypatch: pytest.MonkeyPatch) -> None:
    assert release_date() == str(codemeta()["copyrightYear"])
    published = {**codemeta(), "datePublished": "2031-05-06"}
    monkeypatch.setattr(citation, "codemeta", lambda: published)
    assert release_date() == "2031-05-06"
    assert "year = {2031}" in bibtex()
    assert linked_data()["@graph"][0]["datePublished"] == "2031-05-06"


@pytest.mark.campaign
def test_the_page_has_the_citation_and_the_linked_data(built_site: dict[str, bytes]) -> None:
    page = pages(built_site)["about.html"]
    text = "".join(page.text)
    assert bibtex() in text
    assert data_identifier() in text
    assert DATA in text
    html = built_site["about.html"].decode()
    (data,) = re.findall(r'<script type="application/ld\+json">(.*?)</script>', html, re.DOTALL)
    assert json.loads(data) == linked_data()
    software, dataset = linked_data()["@graph"]
    assert software["@type"] == "SoftwareSourceCode"
    assert dataset["@type"] == "Dataset"
    assert 50 <= len(dataset["description"]) <= 5000  # as search engines for data sets require
    assert data_identifier() in dataset["identifier"]
    for each in (software, dataset):
        assert each["license"] == "https://spdx.org/licenses/MIT"
        assert each["version"] == codemeta()["version"]
    # The button needs no network: it copies the text of an element of the page.
    (button,) = (each for tag, each in page.elements if tag == "button" and "data-of" in each)
    assert str(button["class"]).split() == ["button", "copy"]
    assert button["data-of"] in page.anchors
    assert "copied" in page.anchors
    assert b"navigator.clipboard.writeText" in built_site["assets/about.js"]


@pytest.mark.parametrize("path", [
    "docs/article/bibliography.bib", "docs/article/metadata.yaml.in",
    "docs/explanation/about-the-text.md", "pyharness/data/edition.toml", "CITATION.cff",
    "codemeta.json",
])  # fmt: skip
def test_every_full_citation_is_of_a_report_and_dates_the_thesis(path: str) -> None:
    text = shipped(path).read_text()
    assert not re.search(r"@mastersthesis|(?m:type: thesis$)|schema:Thesis", text)
    cited = text[text.index("Approach to the Unsymmetric Rigid Body Problem") :][:900]
    assert re.search(r"(?i)\breport\b|techreport", text)
    assert re.search(r"submitted (?:in )?July 1981", cited)
