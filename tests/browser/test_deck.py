"""The pages of the decks in a browser: views, jumps, deep links, notes and print."""

import time
from pathlib import Path

import pytest
from selenium.webdriver import ActionChains, Chrome, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement

from tests.browser.screen import (
    WIDEST_FONT,
    WIDTHS,
    add_style,
    on_paper,
    screen,
    set_width,
    too_wide,
    without_scripts,
)
from tests.browser.test_pages import Examined

VIEWS = ("witness", "edited", "apparatus", "side")


def go(browser: Chrome, site: Path, address: str) -> None:
    browser.get("about:blank")
    browser.get(f"{(site / 'listing').as_uri()}/{address}")


def within(browser: Chrome, number: int, selector: str) -> WebElement:
    return browser.find_element(By.ID, str(number)).find_element(By.CSS_SELECTOR, selector)


def box(browser: Chrome, number: int, selector: str = "") -> dict[str, float]:
    """Return the place of a card, or of an element within it, on the screen (pixels)."""
    script = (
        "const card = document.getElementById(arguments[0]);"
        "return (arguments[1] ? card.querySelector(arguments[1]) : card)"
        ".getBoundingClientRect().toJSON()"
    )
    found: dict[str, float] = browser.execute_script(script, str(number), selector)
    return found


def place(browser: Chrome, number: int) -> float:
    """Return the distance from the tools at the top of the screen down to a card (pixels)."""
    script = "return document.querySelector('.tools').getBoundingClientRect().bottom"
    return box(browser, number)["top"] - float(browser.execute_script(script))


def test_the_witness_and_our_text_are_views(browser: Chrome, site: Path) -> None:
    foot = "//li[contains(@class, 'nowhere')][contains(., 'END DETERMINATION')]"
    with screen(browser, 1440):
        go(browser, site, "runge-kutta.html")
        # As the print has it: its names, no card where the scan has none, and its stray lines.
        for number, text in ((250, "M2=200."), (410, "R1=M1/I1"), (1010, "(not in the scan)")):
            assert browser.find_element(By.ID, str(number)).text.split("\n")[1].strip() == text
        lines = browser.find_element(By.XPATH, foot)
        assert lines.text.split("\n")[1].endswith("END DETERMINATION OF K'S.")
        assert len(lines.text.split("\n")) == 4
        assert box(browser, 1050)["bottom"] <= lines.rect["y"]
        browser.find_element(By.ID, "view-edited").click()
        assert browser.current_url.endswith("?view=edited")
        for number, text in ((250, "N2=200."), (410, "R1=N1/I1"), (1010, "[C]")):
            assert within(browser, number, ".ours").text.strip() == text
        assert not browser.find_element(By.XPATH, foot).is_displayed()
        # N is marked as ours. What the scan misreads is marked in the apparatus alone.
        style = "text-decoration-line"
        misread = within(browser, 800, ".ours mark.misreading")
        assert within(browser, 250, ".ours mark").value_of_css_property(style) == "underline"
        assert misread.value_of_css_property(style) == "none"
        seen = [each.text for each in browser.find_elements(By.CSS_SELECTOR, "[id='800'] .refs")]
        assert "26" not in " ".join(seen)
        browser.find_element(By.ID, "view-apparatus").click()
        assert misread.value_of_css_property(style) == "underline"
        assert "26" in within(browser, 800, ".refs").text.split()
        assert browser.find_element(By.XPATH, foot).is_displayed()


def test_the_program_comes_first_and_the_apparatus_on_demand(browser: Chrome, site: Path) -> None:
    with screen(browser, 1440):
        go(browser, site, "runge-kutta.html")
        assert within(browser, 860, ".ours").text.strip() == "U1(I)=U1(J)+.5*DT*KF(I)"
        for hidden in (".scan", ".code", ".about", ".ranges"):
            assert not within(browser, 890, hidden).is_displayed()
        # The cards have their columns, and the numbers of notes are below each other after them.
        for name in (".ours", ".refs"):
            assert box(browser, 860, name)["left"] == box(browser, 1270, name)["left"]
        browser.find_element(By.ID, "view-apparatus").click()
        assert within(browser, 890, ".scan").text == "630-      U1(I)=U1(J)+.5*DT*KX(I)"
        assert "Cards 890\u2013910: 14 redundant" in within(browser, 890, ".ranges").text
        assert not browser.find_elements(By.CSS_SELECTOR, "[id='900'] .ranges")
        browser.find_element(By.ID, "view-side").click()
        boxes = [box(browser, 860, name) for name in (".ours", ".corrected", ".port", ".twin")]
        rights = [0.0, *(each["right"] for each in boxes)]
        assert all(each["left"] > right for each, right in zip(boxes, rights, strict=False))
        assert max(each["top"] for each in boxes) - min(each["top"] for each in boxes) < 8
        assert within(browser, 860, ".corrected code").text == "U1(I)=UU1+.5*DT*KF(I)"
        assert within(browser, 1420, ".corrected em").text == "deleted"
        assert not within(browser, 860, ".scan").is_displayed()


@pytest.mark.campaign
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("view", VIEWS)
def test_a_deep_link_shows_its_card(browser: Chrome, site: Path, view: str, width: int) -> None:
    with screen(browser, width):
        go(browser, site, f"runge-kutta.html?view={view}#870")
        at = browser.execute_script("return scrollY")
        assert browser.find_element(By.ID, f"view-{view}").is_selected()
        assert 0 <= place(browser, 870) < 60
        style = "return getComputedStyle(document.getElementById(arguments[0])).outlineStyle"
        assert browser.execute_script(style, "870") == "solid"
        assert browser.execute_script(style, "880") == "none"
        # All that is known of the card is shown, also a note whose range begins before it.
        text = browser.find_element(By.ID, "870").text
        for told in ("2 defect", "stage-base", "630-", "U2(I)=UU2+.5*DT*KG(I)", "card 870; in"):
            assert told in text
        assert box(browser, 870, ".about")["right"] <= width
        time.sleep(0.3)
        assert browser.execute_script("return scrollY") == at
        assert too_wide(browser) <= 0


@pytest.mark.campaign
def test_a_reader_jumps_to_a_card(browser: Chrome, site: Path) -> None:
    with screen(browser, 800):
        go(browser, site, "runge-kutta.html")
        browser.find_element(By.ID, "card").send_keys("860", Keys.ENTER)
        assert browser.current_url.endswith("runge-kutta.html#860")
        assert 0 <= place(browser, 860) < 60
        assert browser.switch_to.active_element.text == "860"
        # The same number again, after the reader has moved on.
        browser.execute_script("scrollTo(0, 0)")
        browser.find_element(By.ID, "card").send_keys(Keys.ENTER)
        assert 0 <= place(browser, 860) < 60
        entry = browser.find_element(By.ID, "card")
        told = browser.find_element(By.ID, "jumped")
        for given, answer in (
            ("865", "There is no card 865; the nearest is 860."),
            ("9999", "There is no card 9999; the nearest is 1600."),
            ("U1", "Give the number of a card, from 100 to 1600."),
            ("", "Give the number of a card, from 100 to 1600."),
            ("100", ""),
        ):
            entry.clear()
            entry.send_keys(given, Keys.ENTER)
            assert told.text == answer
        assert browser.current_url.endswith("#100")
        # The cards that the scan lacks are copied with brackets.
        browser.find_element(By.ID, "view-edited").click()
        text: str = browser.execute_script(
            "getSelection().selectAllChildren(document.getElementById('1010').closest('ol'));"
            "return getSelection().toString()"
        )
        assert [line for line in text.splitlines() if line.strip().startswith("[")] == ["[C]"] * 3


@pytest.mark.campaign
def test_without_scripts_links_lead_to_pages_and_cards(browser: Chrome, site: Path) -> None:
    with without_scripts(browser):
        go(browser, site, "four-term.html")
        assert not browser.find_element(By.ID, "jump").is_displayed()
        browser.find_element(By.LINK_TEXT, "3 (1060\u20131530)").click()
        assert browser.current_url.endswith("#1060")
        browser.find_element(By.LINK_TEXT, "1070").click()
        assert "card 1070; in" in browser.find_element(By.ID, "1070").text
        browser.find_element(By.ID, "view-side").click()
        assert within(browser, 1080, ".corrected").is_displayed()


@pytest.mark.campaign
@pytest.mark.parametrize("width", [800, 1440])
def test_notes_are_shown_on_hover_and_on_focus(browser: Chrome, site: Path, width: int) -> None:
    with screen(browser, width):
        go(browser, site, "two-term.html")
        notes = within(browser, 1260, ".about")
        card = browser.find_element(By.ID, "1260")
        browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", card)
        for over in (".refs", ".ours mark"):
            ActionChains(browser).move_to_element(within(browser, 1260, over)).perform()
            assert "2 defect x3-reads-acl2 (probable): X3 is built on ACL2" in notes.text
            # The pointer can move into the notes, which then stay.
            ActionChains(browser).move_to_element(within(browser, 1260, ".about a")).perform()
            assert notes.is_displayed()
            elsewhere = browser.find_element(By.ID, "view-side")
            ActionChains(browser).move_to_element(elsewhere).perform()
            assert not notes.is_displayed()
        browser.execute_script("arguments[0].focus()", within(browser, 1250, ".number"))
        number = within(browser, 1260, ".number")
        for _ in range(9):
            if browser.switch_to.active_element != number:
                browser.switch_to.active_element.send_keys(Keys.TAB)
        assert notes.is_displayed()
        assert number.get_dom_attribute("aria-describedby") == notes.get_dom_attribute("id")


@pytest.mark.campaign
def test_the_address_keeps_the_view_and_a_view_keeps_the_card(browser: Chrome, site: Path) -> None:
    with screen(browser, 1440):
        go(browser, site, "two-term.html#1260")
        before = place(browser, 1260)
        for view in ("side", "apparatus"):
            browser.find_element(By.ID, f"view-{view}").click()
            assert browser.current_url.endswith(f"two-term.html?view={view}#1260")
            # The heads of the columns make the tools higher.
            assert abs(place(browser, 1260) - before) < 40
        browser.refresh()
        assert browser.find_element(By.ID, "view-apparatus").is_selected()
        assert 0 <= place(browser, 1260) < 60
        browser.find_element(By.ID, "view-witness").click()
        assert browser.current_url.endswith("two-term.html#1260")


@pytest.mark.campaign
@pytest.mark.parametrize("view", VIEWS)
def test_print_keeps_marks_notes_and_the_citation(browser: Chrome, site: Path, view: str) -> None:
    is_shown = "return arguments[0].checkVisibility()"
    with screen(browser, 718):
        go(browser, site, f"four-term.html?view={view}")
        citation = browser.find_element(By.CSS_SELECTOR, ".citation")
        assert not browser.execute_script(is_shown, citation)
        with on_paper(browser):
            kind, text = (
                ("witness", "(not in the scan)") if view == "witness" else ("ours", "[A(4,1)=1.]")
            )
            assert within(browser, 970, f".{kind}").text.strip() == text
            mark = within(browser, 460, ".ours mark")
            assert mark.is_displayed() == (view != "witness")
            assert "underline" in mark.value_of_css_property("text-decoration-line")
            assert within(browser, 780, ".refs").is_displayed()
            # What is folded away on the screen is printed.
            assert "in: pyharness" in str(citation.get_property("textContent"))
            assert browser.execute_script(is_shown, citation)
            assert browser.find_element(By.ID, "note-1").is_displayed()
            assert not browser.find_element(By.CSS_SELECTOR, ".tools").is_displayed()
            assert within(browser, 780, ".scan").is_displayed() == (view == "apparatus")
            assert too_wide(browser) <= 0


@pytest.mark.campaign
@pytest.mark.parametrize("view", VIEWS)
def test_no_view_is_too_wide_or_has_a_barrier(browser: Chrome, site: Path, view: str) -> None:
    for width in (320, 360, 640, 960, 1024):
        with screen(browser, width):
            go(browser, site, f"runge-kutta.html?view={view}#1530")
            assert too_wide(browser) <= 0, width
            add_style(browser, WIDEST_FONT)
            assert too_wide(browser) <= 0, width
    with screen(browser, 1000):
        go(browser, site, f"runge-kutta.html?view={view}#1530")
        assert Examined().barriers(browser) == []


@pytest.mark.campaign
def test_the_comparison_is_a_table_or_a_list(browser: Chrome, site: Path) -> None:
    with screen(browser, 1440):
        go(browser, site, "collation.html")
        row = browser.find_element(By.XPATH, "//td[contains(., 'A1=(I2-I3)/I1')]/..")
        cells = row.find_elements(By.TAG_NAME, "td")
        assert [each.text for each in cells] == [
            "400 A1=(I2-I3)/I1", "410 A1=(I2-I3)/I1", "360 A=(I2-I3)/I1", "name",
        ]  # fmt: skip
        assert len({each.rect["y"] for each in cells}) == 1
        set_width(browser, 360)
        assert len({each.rect["y"] for each in cells}) == 4
        assert too_wide(browser) <= 0
        row.find_element(By.LINK_TEXT, "360").click()
        assert browser.current_url.endswith("runge-kutta.html#360")
