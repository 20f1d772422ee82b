"""The page about the edition in a browser: its button copies the citation."""

from pathlib import Path

from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.expected_conditions import text_to_be_present_in_element
from selenium.webdriver.support.wait import WebDriverWait

from pyharness.edition.citation import bibtex
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
