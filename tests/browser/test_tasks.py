"""Six tasks that a new reader begins on the home page, each within a few clicks."""

from pathlib import Path

from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By

from pyharness.history.identifiers import text_digest
from tests.browser.screen import click, opening, screen

_TOP = "return document.getElementById(arguments[0]).getBoundingClientRect().top"


def _go(browser: Chrome, entry: str) -> None:
    browser.find_element(By.CSS_SELECTOR, "header nav").find_element(By.LINK_TEXT, entry).click()


def _seen(browser: Chrome, selector: str) -> str:
    found = browser.find_element(By.CSS_SELECTOR, selector)
    assert found.is_displayed(), selector
    return found.text


def test_a_reader_needs_one_click_or_two(browser: Chrome, site: Path) -> None:
    with screen(browser, 1200), opening(browser, site / "index.html") as opened:
        # Why did the run stop at step 25?
        opened("")
        click(browser, "#run")
        assert "V2, with a quotient of 3,305" in _seen(browser, "#stop .answer")
        _go(browser, "Laboratory")
        assert "V2 had just passed a turning point" in _seen(browser, "#why")
        # What does one fault do?
        before = _seen(browser, "#status")
        click(browser, "input[name=switch][value=stage-base]")
        assert _seen(browser, "#status") != before
        assert "fix=stage-base" in browser.current_url
        # Which card increments DT?
        opened("")
        click(browser, "#points a[href*='two-term.html']")
        assert browser.current_url.endswith("two-term.html#1660")
        assert "DT=DT+.01" in _seen(browser, "[id='1660'] .ours")
        assert 0 <= browser.execute_script(_TOP, "1660") < 900
        # Is collocation superior?
        opened("")
        _go(browser, "Thesis and claims")
        _go(browser, "Claims")
        line = browser.find_element(By.CSS_SELECTOR, "#vi-superior > summary")
        assert " ".join(line.text.split()).endswith("as printed: reproduced corrected: false")
        line.click()
        assert "The conclusion rests on faults" in _seen(browser, "#vi-superior .story")
        # How is this claim cited?
        click(browser, "#vi-superior .cite-here")
        assert _seen(browser, "#cite-address") == "claims.html#vi-superior"
        assert _seen(browser, "#cite-digest") == text_digest()
        # Which starts are assumed?
        opened("")
        assert "the initial omega of Cases 1, 3, 4, 6 and 7" in _seen(browser, ".assumed-legend")
        _go(browser, "Thesis and claims")
        _go(browser, "Figures")
        assert "* assumed" in _seen(browser, "#figure-08 figcaption")
        assert "* assumed" not in _seen(browser, "#figure-10b figcaption")
