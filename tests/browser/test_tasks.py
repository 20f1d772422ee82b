"""Five tasks that a new reader begins on the home page, each within a few clicks."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium.webdriver import Chrome, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement

from tests.browser.screen import click, opening, screen


class Reader:
    """A reader on the home page, whose clicks are counted."""

    def __init__(self, browser: Chrome) -> None:
        self.browser = browser
        self.clicks = 0

    def click(self, selector: str) -> None:
        """Click a visible element."""
        click(self.browser, selector)
        self.clicks += 1

    def go(self, entry: str) -> None:
        """Click an entry of the menu."""
        found = self.browser.find_element(By.CSS_SELECTOR, "header nav")
        found.find_element(By.LINK_TEXT, entry).click()
        self.clicks += 1

    def see(self, selector: str) -> WebElement:
        """Return a visible element."""
        found = self.browser.find_element(By.CSS_SELECTOR, selector)
        assert found.is_displayed(), selector
        return found


@pytest.fixture
def reader(browser: Chrome, site: Path) -> Iterator[Reader]:
    """Yield a reader on the home page; the console must stay empty."""
    with screen(browser, 1200), opening(browser, site / "index.html") as opened:
        opened("")
        yield Reader(browser)


def test_why_the_run_stopped(reader: Reader) -> None:
    reader.click("#run")
    assert "V2, with a quotient of 3,305" in reader.see("#stop .answer").text
    reader.go("Laboratory")
    assert "V2 had just passed a turning point" in reader.see("#why").text
    assert reader.clicks == 2


@pytest.mark.campaign
def test_one_fault_switched_off(reader: Reader) -> None:
    reader.go("Laboratory")
    before = reader.see("#status").text
    reader.click("input[name=switch][value=stage-base]")
    assert reader.see("#status").text != before
    assert "fix=stage-base" in reader.browser.current_url
    assert reader.clicks == 2


def test_a_card_found_and_cited(reader: Reader) -> None:
    reader.go("Programs")
    reader.go("Runge-Kutta")
    reader.see("#card").send_keys("860", Keys.ENTER)
    card = reader.see("[id='860']")
    assert reader.browser.current_url.endswith("#860")
    assert "card 860" in card.find_element(By.CSS_SELECTOR, ".cite").text
    place = reader.browser.execute_script("return arguments[0].getBoundingClientRect().top", card)
    assert 0 <= place < 900
    assert reader.clicks == 2


@pytest.mark.campaign
def test_what_the_thesis_says_of_case_6(reader: Reader) -> None:
    reader.go("Thesis and claims")
    sentences = reader.browser.find_elements(By.CSS_SELECTOR, ".sentence")
    about = [each for each in sentences if "Case 6" in each.text]
    judged = [each for each in about if each.find_elements(By.CSS_SELECTOR, ".verdict")]
    assert len(judged) >= 2
    assert "as printed:" in judged[0].text
    assert reader.clicks == 1
