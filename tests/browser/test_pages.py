"""Every page in a browser: no error, nothing wider than the screen, no accessibility barrier."""

import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from tests.browser.screen import WIDEST_FONT, WIDTHS, add_style, errors, screen, too_wide


def addresses(site: Path) -> list[str]:
    return [each.as_uri() for each in sorted(site.rglob("*.html"))]


STYLES = Path(__file__).parents[2] / "web" / "site"
# Mark one element with text for each path of tags, classes and other attributes by which a style
# may select. Cells of a column have the same colours in every row, so that one of them suffices.
_MARK_ONE_OF_EACH = """
const [attributes, ids] = arguments;
const paths = new Map([[document.documentElement, ""]]);
const seen = new Set();
for (const each of document.querySelectorAll("body, body *")) {
  const own = attributes.map((name) => each.getAttribute(name) ?? "").join("|")
    + (ids.includes(each.id) ? each.id : "");
  const path = `${paths.get(each.parentElement) ?? ""}>${each.tagName}|${own}`;
  paths.set(each, path);
  const text = [...each.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  if (text && !seen.has(path) && each.checkVisibility()) {
    seen.add(path);
    each.dataset.sample = "";
  }
}
"""


def barriers(browser: Chrome, *only: str) -> list[dict[str, Any]]:
    """Return axe-core's findings in a page (rule, impact, place), by all rules or by `only` these.

    Contrast is measured for one element of each style, because thousands of cells take a minute.
    """
    browser.execute_script(files("axe_core_python").joinpath("axe.min.js").read_text())
    browser.execute_script(_MARK_ONE_OF_EACH, *selected_by())
    found = []
    contrast = "color-contrast"
    if contrast not in only:
        rules = {contrast: {"enabled": False}}
        found = _violations(browser, "document", {"rules": rules})
    return found + _violations(browser, "{include: [['[data-sample]']]}", {"runOnly": [contrast]})


def selected_by() -> tuple[list[str], list[str]]:
    """Return the attributes and the ids by which the style sheets select elements."""
    text = "".join(path.read_text() for path in STYLES.glob("*.css"))
    selectors = re.sub(r"\{[^{}]*\}", "{}", text)
    attributes = {"class", "style", *re.findall(r"\[([\w-]+)", selectors)} - {"href"}
    return sorted(attributes), sorted({*re.findall(r"#([\w-]+)", selectors)})


def _violations(browser: Chrome, context: str, options: dict[str, Any]) -> list[dict[str, Any]]:
    found = browser.execute_async_script(
        f"const [options, done] = arguments; axe.run({context}, options).then(done);",
        {**options, "resultTypes": ["violations"]},
    )
    return [
        {"rule": each["id"], "impact": each["impact"], "where": each["nodes"][0]["html"]}
        for each in found["violations"]
    ]


def test_no_page_has_an_error_or_is_wider_than_the_screen_whatever_the_font(
    browser: Chrome, site: Path
) -> None:
    """Load each page once, at the width of a phone, and then change the width of the screen."""
    errors(browser)
    found: dict[str, Any] = {}
    for address in addresses(site):
        with screen(browser, WIDTHS[0]):
            browser.get(address)
        for style, widths in (("", WIDTHS), (WIDEST_FONT, (320, *WIDTHS))):
            add_style(browser, style)
            for width in widths:
                with screen(browser, width):
                    if (beyond := too_wide(browser)) > 0:
                        found[f"{address} {width} {style}"] = beyond
        if said := errors(browser):
            found[address] = said
    assert found == {}


@pytest.mark.parametrize(
    "body",
    [
        "<p style='white-space: nowrap'>reproduced in part</p>",
        f"<p><math>{'<mi>F</mi>' * 12}</math></p>",
        "<p>denominator</p>",
    ],
)
def test_what_a_font_makes_too_wide_is_found(browser: Chrome, tmp_path: Path, body: str) -> None:
    page = tmp_path / "page.html"
    phone = "<meta name=viewport content='width=device-width'>"
    page.write_text(f"<!doctype html><html lang=en>{phone}<title>t</title><body>{body}")
    with screen(browser, 200):
        browser.get(page.as_uri())
        assert too_wide(browser) == 0
        add_style(browser, WIDEST_FONT)
        assert too_wide(browser) > 0


def test_no_page_has_a_barrier(browser: Chrome, site: Path) -> None:
    errors(browser)
    found: dict[str, list[Any]] = {}
    for scheme, only in (("light", ()), ("dark", ("color-contrast",))):
        with screen(browser, 1000, scheme):
            for address in addresses(site):
                browser.get(address)
                if there := barriers(browser, *only) or errors(browser):
                    found[f"{address} {scheme}"] = there
    assert found == {}, json.dumps(found, indent=1)


def test_styles_select_by_nothing_that_the_samples_leave_out() -> None:
    """A selector by position would give different colours to elements of one path."""
    attributes, ids = selected_by()
    assert {"class", "data-theme", "aria-invalid"} <= set(attributes)
    assert "theme" in ids
    for path in STYLES.glob("*.css"):
        assert not re.search("nth-|of-type", path.read_text())


def test_contrast_is_measured_of_one_element_of_each_style(browser: Chrome, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    rows = "<tr><td>first<td class=pale>second</tr>" * 20
    page.write_text(
        "<!doctype html><html lang=en><title>t</title><style>.pale { color: #ddd }</style><body>"
        f"<main><h1>t</h1><table>{rows}</table>"
    )
    browser.get(page.as_uri())
    assert [each["rule"] for each in barriers(browser, "color-contrast")] == ["color-contrast"]
    samples = browser.find_elements(By.CSS_SELECTOR, "[data-sample]")
    assert [each.text for each in samples] == ["t", "first", "second"]


def test_what_is_wrong_is_found(browser: Chrome, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(
        "<!doctype html><html><title>t</title><body><main><h1>t</h1><input>"
        "<p style='color:#ccc'>a few words</p><div style='width:3000px'>b</div>"
        "<script>nothing()</script></main>"
    )
    errors(browser)
    with screen(browser, 800):
        browser.get(page.as_uri())
        assert too_wide(browser) > 2000
        assert "nothing is not defined" in errors(browser)[0]
        rules = {each["rule"] for each in barriers(browser)}
    assert {"label", "color-contrast", "html-has-lang"} <= rules


def test_a_reader_chooses_dark_or_light(browser: Chrome, site: Path) -> None:
    def paper() -> str:
        script = "return getComputedStyle(document.body).backgroundColor"
        return str(browser.execute_script(script))

    with screen(browser, 1000, "light"):
        browser.get((site / "index.html").as_uri())
        light = paper()
        browser.find_element(By.ID, "theme").click()
        dark = paper()
        assert dark != light
        # The other pages use the chosen scheme too.
        browser.get((site / "claims.html").as_uri())
        assert paper() == dark
        browser.find_element(By.ID, "theme").click()
        assert paper() == light
    browser.execute_script("localStorage.clear()")


def test_the_search_finds_a_card_and_keeps_its_words_in_the_address(
    browser: Chrome, site: Path
) -> None:
    browser.get((site / "search.html").as_uri())
    query = browser.find_element(By.ID, "query")
    query.send_keys("stage-base")
    link = browser.find_element(By.CSS_SELECTOR, "#results a")
    assert str(link.get_dom_attribute("href")) == "apparatus.html#stage-base"
    assert browser.current_url.endswith("#q=stage-base")
    browser.get("about:blank")
    browser.get((site / "search.html").as_uri() + "#q=DT%3DDT%2B.01")
    query = browser.find_element(By.ID, "query")
    links = browser.find_elements(By.CSS_SELECTOR, "#results a")
    found = [str(each.get_dom_attribute("href")) for each in links]
    assert "listing/two-term.html#1660" in found
    # Another number shows another card.
    browser.execute_script("location.hash = '#q=two-term+1660'")
    WebDriverWait(browser, 5).until(lambda _: query.get_property("value") == "two-term 1660")
    links = browser.find_elements(By.CSS_SELECTOR, "#results a")
    cards = [each.text for each in links if each.text.startswith(("two", "four", "runge"))]
    assert cards == ["two-term 1660"]
    browser.execute_script("location.hash = '#q=Lipschitz'")
    WebDriverWait(browser, 5).until(
        lambda _: "lipschitz-tests-velocity" in browser.find_element(By.ID, "results").text
    )


def test_a_filter_leaves_the_cards_of_a_kind(browser: Chrome, site: Path) -> None:
    browser.get((site / "listing/two-term.html").as_uri())

    def shown() -> set[str]:
        cards = browser.find_elements(By.CSS_SELECTOR, ".card")
        return {str(each.get_dom_attribute("id")) for each in cards if each.is_displayed()}

    every = shown()
    browser.find_element(By.ID, "kind-defect").click()
    defects = shown()
    assert "1660" in defects < every
    assert "160" not in defects
    # The card that the address names is shown even if the filter hides it.
    browser.execute_script("location.hash = '#160'")
    assert shown() == defects | {"160"}
    browser.execute_script("document.getElementById('kind-all').click()")
    assert shown() == every


def test_without_scripts_pages_say_what_they_have(browser: Chrome, site: Path) -> None:
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        browser.get((site / "laboratory.html").as_uri())
        text = browser.find_element(By.TAG_NAME, "main").text
        assert "step 25" in text
        assert "V2" in text
        browser.get((site / "listing/two-term.html").as_uri() + "#1660")
        assert "DT=DT+.01" in browser.find_element(By.ID, "1660").text
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
