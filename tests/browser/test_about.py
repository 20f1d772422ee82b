"""Citations in a browser: the page about the edition copies them, others show them."""

import json
from pathlib import Path

from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.expected_conditions import text_to_be_present_in_element
from selenium.webdriver.support.wait import WebDriverWait

from pyharness.edition.citation import bibtex
from pyharness.history.identifiers import text_digest
from tests.browser.screen import click, errors

# A browser without a window may refuse its clipboard, which the test therefore replaces.
_CLIPBOARD = """
const refuse = arguments[0];
navigator.clipboard.writeText = async (text) => {
  if (refuse) throw new Error("refused");
  window.written = text;
};
"""


def test_the_citation_is_copied(browser: Chrome, site: Path) -> None:
    browser.get("about:blank")
    errors(browser)
    for refuse, told in ((False, "copied"), (True, "the browser does not allow copying from here")):
        browser.get((site / "about.html").as_uri())
        browser.execute_script(_CLIPBOARD, refuse)
        click(browser, "button.copy")
        noted = text_to_be_present_in_element((By.ID, "copied"), told)
        WebDriverWait(browser, 10).until(noted)
        written = browser.execute_script("return window.written ?? null")
        assert written == (None if refuse else bibtex())
        assert errors(browser) == []


def test_a_page_a_card_a_claim_and_a_run_are_cited(browser: Chrome, site: Path) -> None:
    digest = text_digest()
    for page, button, place in (
        (
            "listing/runge-kutta.html#860",
            "[id='860'] .cite-here",
            "card 860 of the runge-kutta program",
        ),
        ("claims.html#vi-superior", "[id='vi-superior'] .cite-here", "claim vi-superior"),
        ("apparatus.html#stage-base", "[id='stage-base'] .cite-here", "entry stage-base"),
        ("thesis.html", "#cite-page", "The thesis, executable"),
        ("laboratory.html#case=5&program=two-term", ".pages .cite-here", "Laboratory: case=5, "),
    ):
        browser.get("about:blank")
        errors(browser)
        path, _, anchor = page.partition("#")
        browser.get(f"{(site / path).as_uri()}{'#' if anchor else ''}{anchor}")
        click(browser, button)
        assert place in browser.find_element(By.ID, "cite-place").text
        assert browser.find_element(By.ID, "cite-address").text.startswith(page)
        assert browser.find_element(By.ID, "cite-digest").text == digest
        assert "sets address in" in browser.find_element(By.ID, "cite-publish").text
        bib = browser.find_element(By.ID, "cite-bibtex").text
        for told in (f"howpublished = {{{page}", place, digest, "@techreport{jacobs-1982"):
            assert told in bib
        edition, report = json.loads(browser.find_element(By.ID, "cite-csl").text)
        assert (place in edition["title"], report["type"]) == (True, "report")
        browser.find_element(By.CSS_SELECTOR, "dialog form button").click()
        assert not browser.find_element(By.ID, "cite-place").is_displayed()
        assert errors(browser) == []
