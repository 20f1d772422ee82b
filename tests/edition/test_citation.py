"""The citation: BibTeX and linked data of the page about the edition."""

import json
import re

import pytest

from pyharness.edition import citation
from pyharness.edition.citation import bibtex, codemeta, linked_data, release_date
from pyharness.history.identifiers import DATA, data_identifier, text_digest
from pyharness.model.facts import facts, shipped
from tests.edition.pages import pages


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


@pytest.mark.parametrize(
    "path",
    [
        "docs/article/bibliography.bib", "docs/article/metadata.yaml.in",
        "docs/explanation/about-the-text.md", "pyharness/data/edition.toml", "CITATION.cff",
        "codemeta.json",
    ],
)  # fmt: skip
def test_every_full_citation_is_of_a_report_and_dates_the_thesis(path: str) -> None:
    text = shipped(path).read_text()
    assert not re.search(r"@mastersthesis|(?m:type: thesis$)|schema:Thesis", text)
    cited = text[text.index("Approach to the Unsymmetric Rigid Body Problem") :][:900]
    assert re.search(r"(?i)\breport\b|techreport", text)
    assert re.search(r"submitted (?:in )?July 1981", cited)
