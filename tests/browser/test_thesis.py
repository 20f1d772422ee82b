"""The pages of the thesis, claims and figures: the parts that addresses open, and the layout."""

import base64
import re
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver import Chrome

from pyharness.edition import ledger
from pyharness.history.ablation import entries
from tests.browser.screen import errors, on_paper, screen, without_scripts

_OPEN = Path(__file__).with_name("open.js").read_text()
_BOXES = Path(__file__).with_name("boxes.js").read_text()


def _boxes(browser: Chrome, *selectors: str) -> list[dict[str, float]]:
    found: list[dict[str, float]] = browser.execute_script(_BOXES, selectors)
    return found


@pytest.mark.campaign
def test_an_address_and_a_link_open_what_is_folded_there_alone(browser: Chrome, site: Path) -> None:
    with screen(browser, 1440):
        for page, name, folded in (
            ("thesis.html", "sentence-27", 2), ("claims.html", "vi-superior", 3),
        ):  # fmt: skip
            browser.get(f"{(site / page).as_uri()}#{name}")
            found: dict[str, Any] = browser.execute_script(_OPEN, name)
            assert (found["folded"], found["open"], found["others"]) == (folded, folded, 0)
            assert 0 <= found["top"] < 100  # at its place at once
        assert browser.execute_script(_OPEN, "v2-case-2-stopped")["open"] == 0
        browser.execute_async_script(
            "const done = arguments[1]; addEventListener('hashchange', () => setTimeout(done));"
            "location.hash = arguments[0];",
            "#v2-case-2-stopped",
        )
        found = browser.execute_script(_OPEN, "v2-case-2-stopped")
        assert found["open"] == found["folded"] > 0
        assert 0 <= found["top"] < 100
    assert errors(browser) == []


def test_verdicts_are_in_the_margin_or_below_the_sentence(browser: Chrome, site: Path) -> None:
    places = [f"#sentence-58 {each}" for each in (".said", ".margin", ".more")]
    with screen(browser, 1440):
        browser.get((site / "thesis.html").as_uri())
        said, margin, more = _boxes(browser, *places)
        assert margin["left"] >= said["right"]
        assert margin["top"] < more["top"]
        assert more["left"] == said["left"]
    with screen(browser, 360):
        said, margin, more = _boxes(browser, *places)
        assert said["bottom"] <= margin["top"] < margin["bottom"] <= more["top"]


@pytest.mark.campaign
def test_figures_of_the_paper_are_beside_ours(browser: Chrome, site: Path) -> None:
    places = ("#paper-7 .paper", "#figure-07", "#figure-07-corrected")
    with screen(browser, 1440):
        browser.get((site / "figures.html").as_uri())
        paper, printed, corrected = _boxes(browser, *places)
        assert paper["right"] < printed["left"] < printed["right"] < corrected["left"]
        assert printed["top"] == corrected["top"]
    with screen(browser, 360):
        paper, printed, corrected = _boxes(browser, *places)
        assert paper["bottom"] <= printed["top"] < printed["bottom"] <= corrected["top"]


@pytest.mark.campaign
def test_all_claims_and_entries_open_at_once(browser: Chrome, site: Path) -> None:
    for page, each in (("claims.html", ".claim"), ("apparatus.html", ".entry")):
        browser.get((site / page).as_uri())
        count = f"return document.querySelectorAll('{each}[open]').length"
        assert browser.execute_script(count) == 0
        for _ in range(2):
            browser.find_element("css selector", ".open-all").click()
        assert browser.execute_script(count) == 0
        browser.find_element("css selector", ".open-all").click()
        everything = f"return document.querySelectorAll('{each}').length"
        assert browser.execute_script(count) == browser.execute_script(everything) > 50


@pytest.mark.campaign
def test_print_keeps_verdicts_and_the_numbers_of_the_thesis(browser: Chrome, site: Path) -> None:
    script = (
        "const seen = (each) => each.checkVisibility();"
        "return ['.verdict', 'details table td'].map((each) => {"
        "  const all = [...document.querySelectorAll(each)];"
        "  return [all.length, all.filter(seen).length];"
        "});"
    )
    for page, least in (("claims.html", 87), ("thesis.html", 60)):
        browser.get((site / page).as_uri())
        with on_paper(browser):
            (verdicts, seen), (cells, printed) = browser.execute_script(script)
        assert verdicts == seen >= least
        assert printed == (0 if page == "claims.html" else cells)
        assert cells > 100


@pytest.mark.campaign
@pytest.mark.parametrize(("page", "most"), [("claims.html", 8), ("apparatus.html", 8)])
def test_claims_and_apparatus_are_short(browser: Chrome, site: Path, page: str, most: int) -> None:
    browser.get((site / page).as_uri())
    paper = {"paperWidth": 8.27, "paperHeight": 11.69}
    printed = browser.execute_cdp_cmd("Page.printToPDF", paper)["data"]
    assert len(re.findall(rb"/Type\s*/Page\b", base64.b64decode(printed))) <= most
    with screen(browser, 360):
        assert browser.execute_script("return document.documentElement.scrollHeight") < 10000


@pytest.mark.campaign
def test_the_apparatus_shows_the_entries_of_a_program_when_it_is_opened(
    browser: Chrome, site: Path
) -> None:
    page = (site / "apparatus.html").as_uri()
    shown = (
        "return [...document.querySelectorAll('.entry')]"
        ".filter((each) => each.checkVisibility()).length"
    )
    with screen(browser, 360):
        browser.get(page)
        assert browser.execute_script(shown) == 0
        assert browser.execute_script("return document.documentElement.scrollHeight") < 2500
        browser.find_element("css selector", "#of-runge-kutta > summary").click()
        assert browser.execute_script(shown) == len(ledger.apparatus()["runge-kutta"]) > 10
    # An address opens the group of its entry; without scripts the browser does.
    for entry in ("stage-base", "three-masses"):
        browser.get("about:blank")
        browser.get(f"{page}#{entry}")
        assert browser.find_element("id", entry).is_displayed()
    with without_scripts(browser):
        browser.get("about:blank")
        browser.get(f"{page}#stage-base")
        assert browser.find_element("id", "stage-base").is_displayed()
    with on_paper(browser):
        assert browser.execute_script(shown) == len(entries())
