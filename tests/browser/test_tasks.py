"""Four tasks that a new reader begins on the home page, each within a few clicks."""

from pathlib import Path

from selenium.webdriver import Chrome, Keys
from selenium.webdriver.common.by import By

from tests.browser.screen import click, opening, screen


def _go(browser: Chrome, entry: str) -> None:
    menu = browser.find_element(By.CSS_SELECTOR, "header nav")
    menu.find_element(By.LINK_TEXT, entry).click()


def _seen(browser: Chrome, selector: str) -> str:
    found = browser.find_element(By.CSS_SELECTOR, selector)
    assert found.is_displayed(), selector
    return found.text


def test_a_reader_needs_one_click_or_two(browser: Chrome, site: Path) -> None:
    with screen(browser, 1200), opening(browser, site / "index.html") as opened:
        # Why did the run stop?
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
        # How is a card cited?
        opened("")
        _go(browser, "Programs")
        _go(browser, "Runge-Kutta")
        browser.find_element(By.ID, "card").send_keys("860", Keys.ENTER)
        assert browser.current_url.endswith("#860")
        assert "card 860" in _seen(browser, "[id='860'] .cite")
        place = "return document.getElementById('860').getBoundingClientRect().top"
        assert 0 <= browser.execute_script(place) < 900
        # What does the thesis say of Case 6?
        opened("")
        _go(browser, "Thesis and claims")
        sentences = browser.find_elements(By.CSS_SELECTOR, ".sentence:has(.verdict)")
        told = [each.text for each in sentences if "Case 6" in each.text]
        assert len(told) >= 2
        assert "as printed:" in told[0]
