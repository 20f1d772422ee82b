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

from tests.browser.screen import (
    WIDEST_FONT,
    WIDTHS,
    add_style,
    errors,
    screen,
    set_scheme,
    set_width,
    too_wide,
    without_scripts,
)


def addresses(site: Path) -> list[str]:
    return [each.as_uri() for each in sorted(site.rglob("*.html"))]


STYLES = Path(__file__).parents[2] / "web" / "site"
_CONTRAST = "color-contrast"
_MARK_ONE_OF_EACH = "\n" + Path(__file__).with_name("mark.js").read_text()
_THIN = Path(__file__).with_name("thin.js").read_text()


class Examined:
    """Searches pages for faults of accessibility with axe-core, and remembers what it has examined.

    Of a page it examines only the elements whose structure or style is new. The pages repeat few
    structures in thousands of table cells and cards, and axe-core takes a minute for all of them. A
    fault that depends on the wording, or on two equal ids far apart, is not found.
    """

    def __init__(self) -> None:
        self.paths: list[str] = []  # from the root to an element whose contrast was measured
        self.shapes: list[str] = []  # of parts to which all other rules were applied

    def contrast(self, browser: Chrome) -> list[dict[str, Any]]:
        """Return the elements whose text has too little contrast, in a light or a dark scheme."""
        return self._contrast(browser, self._mark(browser))

    def barriers(self, browser: Chrome) -> list[dict[str, Any]]:
        """Return rule, impact and place of each fault; repeated elements are removed from the page.

        Only the contrast is measured in a dark scheme too, because a scheme changes only colours.
        """
        new = self._mark(browser)
        self.shapes += browser.execute_script(_THIN, self.shapes)
        found = self._contrast(browser, new)
        return found + _violations(browser, "document", {"rules": {_CONTRAST: {"enabled": False}}})

    def _mark(self, browser: Chrome) -> bool:
        """Load axe-core, mark an element of each new style, and return whether there is any."""
        axe = files("axe_core_python").joinpath("axe.min.js").read_text()
        new = browser.execute_script(axe + _MARK_ONE_OF_EACH, *selected_by(), self.paths)
        self.paths += new
        return bool(new)

    def _contrast(self, browser: Chrome, is_new: bool) -> list[dict[str, Any]]:
        found = []
        for scheme in ("dark", "light") if is_new else ():
            set_scheme(browser, scheme)
            sampled = "{include: [['[data-sample]']]}"
            found += _violations(browser, sampled, {"runOnly": [_CONTRAST]})
        return found


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


@pytest.mark.campaign
def test_no_page_has_an_error_or_is_too_wide_whatever_the_font(browser: Chrome, site: Path) -> None:
    """Each layout is tried in the narrowest screen that has it: it fits into a wider one too."""
    text = "".join(path.read_text() for path in STYLES.glob("*.css"))
    steps = {int(16 * float(each)) for each in re.findall(r"\(min-width: ([\d.]+)rem\)", text)}
    assert steps == {640, 960, 1024}
    errors(browser)
    found: dict[str, Any] = {}
    for address in addresses(site):
        with screen(browser, WIDTHS[0]):
            browser.get(address)
            if (beyond := too_wide(browser)) > 0:
                found[address] = beyond
            add_style(browser, WIDEST_FONT)
            for width in (320, *sorted(steps)):
                set_width(browser, width)
                if (beyond := too_wide(browser)) > 0:
                    found[f"{address} {width} {WIDEST_FONT}"] = beyond
        if said := errors(browser):
            found[f"{address} says"] = said
    assert found == {}


@pytest.mark.campaign
def test_what_a_font_makes_too_wide_is_found(browser: Chrome, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    phone = "<meta name=viewport content='width=device-width'>"
    for body in (
        "<p style='white-space: nowrap'>reproduced in part</p>",
        f"<p><math>{'<mi>F</mi>' * 12}</math></p>", "<p>denominator</p>",
    ):  # fmt: skip
        page.write_text(f"<!doctype html><html lang=en>{phone}<title>t</title><body>{body}")
        with screen(browser, 200):
            browser.get(page.as_uri())
            assert too_wide(browser) == 0
            add_style(browser, WIDEST_FONT)
            assert too_wide(browser) > 0


@pytest.mark.campaign
def test_no_page_has_a_barrier(browser: Chrome, site: Path) -> None:
    errors(browser)
    found: dict[str, list[Any]] = {}
    examined = Examined()
    with screen(browser, 1000):
        for address in addresses(site):
            browser.get(address)
            if there := examined.barriers(browser) or errors(browser):
                found[address] = there
    assert found == {}, json.dumps(found, indent=1)


@pytest.mark.campaign
@pytest.mark.parametrize(("bad", "rule"), [
    ("<ul><li><a href='x'>a</a></li><li><a href='x'></a></li></ul>", "link-name"),
    ("<ul><li><a href='x'>a</a></li><p>b</p></ul>", "list"),
    ("<div><div><img src='x' alt=''><img src='x'></div></div>", "image-alt"),
    ("<table><tr><td>a<td>b</tr><tr><td>a<td><input></tr></table>", "label"),
    ("<section><p>a</p><p role='nonsense'>b</p></section>", "aria-roles"),
    ("<h2>t</h2><p>a</p><h5>u</h5>", "heading-order"),
])  # fmt: skip
def test_a_new_barrier_is_found(browser: Chrome, tmp_path: Path, bad: str, rule: str) -> None:
    examined = Examined()
    good = (
        "<ul><li><a href='x'>a</a></li></ul><section><p>a</p></section><h2>t</h2><p>a</p>"
        "<div><div><img src='x' alt='t'></div></div><table><tr><td>a</td><td>b</td></tr></table>"
    )
    page = tmp_path / "page.html"
    rules = []
    for more in ("", "", bad):
        page.write_text(
            f"<!doctype html><html lang=en><title>t</title><main><h1>t</h1>{good * 3}{more}</main>"
        )
        browser.get(page.as_uri())
        rules.append({each["rule"] for each in examined.barriers(browser)})
    assert rules == [set(), set(), {rule}]


def test_styles_select_by_nothing_that_the_samples_leave_out() -> None:
    """A selector by position would give different colours to elements of one path."""
    attributes, ids = selected_by()
    assert {"class", "data-theme", "aria-invalid"} <= set(attributes)
    assert "theme" in ids
    for path in STYLES.glob("*.css"):
        assert not re.search("nth-|of-type", path.read_text())


@pytest.mark.campaign
def test_contrast_is_measured_of_one_element_of_each_style(browser: Chrome, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    rows = "<tr><td>first<td class=pale>second</tr>" * 20
    style = (
        ":root {{ color-scheme: light dark }} body {{ background: light-dark(#fff, #000) }}"
        ".pale {{ color: light-dark({}, {}) }}"
    )

    def contrast(examined: Examined, *colours: str) -> int:
        page.write_text(
            f"<!doctype html><html lang=en><title>t</title><style>{style.format(*colours)}</style>"
            f"<body><main><h1>t</h1><table>{rows}</table>"
        )
        browser.get(page.as_uri())
        return len(examined.contrast(browser))

    with screen(browser, 800):
        assert contrast(Examined(), "#000", "#fff") == 0
        samples = browser.find_elements(By.CSS_SELECTOR, "[data-sample]")
        assert [each.text for each in samples] == ["t", "first", "second"]
        examined = Examined()
        assert contrast(examined, "#ddd", "#fff") == 1
        assert contrast(Examined(), "#000", "#222") == 1
        assert contrast(examined, "#ddd", "#fff") == 0  # each path is examined once


@pytest.mark.campaign
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
        rules = {each["rule"] for each in Examined().barriers(browser)}
    assert {"label", "color-contrast", "html-has-lang"} <= rules


def test_a_reader_chooses_dark_or_light(browser: Chrome, site: Path) -> None:
    def paper() -> str:
        return str(browser.execute_script("return getComputedStyle(document.body).backgroundColor"))

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


def test_the_search_finds_a_card_and_is_in_the_address(browser: Chrome, site: Path) -> None:
    browser.get((site / "search.html").as_uri())
    query = browser.find_element(By.ID, "query")
    query.send_keys("stage-base")
    link = browser.find_element(By.CSS_SELECTOR, "#results a")
    assert str(link.get_dom_attribute("href")) == "apparatus.html#stage-base"
    assert browser.current_url.endswith("#q=stage-base")
    browser.get("about:blank")
    browser.get((site / "search.html").as_uri() + "#q=DT%3DDT%2B.01")
    query = browser.find_element(By.ID, "query")
    assert browser.find_elements(By.CSS_SELECTOR, "#results a[href='listing/two-term.html#1660']")
    # Another number shows another card.
    browser.execute_script("location.hash = '#q=two-term+1660'")
    WebDriverWait(browser, 5).until(lambda _: query.get_property("value") == "two-term 1660")
    links = browser.find_elements(By.CSS_SELECTOR, "#results a")
    cards = [each.text for each in links if each.text.startswith(("two", "four", "runge"))]
    assert cards == ["two-term 1660"]
    browser.execute_script("location.hash = '#q=Lipschitz'")
    results = browser.find_element(By.ID, "results")
    WebDriverWait(browser, 5).until(lambda _: "lipschitz-tests-velocity" in results.text)
    # What readers look for first is found first.
    for words, href in (("cite", "about.html#cite"), ("step+25", "index.html#")):
        browser.get("about:blank")
        browser.get((site / "search.html").as_uri() + f"#q={words}")
        first = browser.find_element(By.CSS_SELECTOR, "#results a")
        assert str(first.get_dom_attribute("href")).startswith(href)


@pytest.mark.campaign
def test_a_filter_leaves_the_cards_of_a_kind(browser: Chrome, site: Path) -> None:
    browser.get((site / "listing/two-term.html").as_uri())

    def shown(click: str = "") -> set[str]:
        if click:
            browser.find_element(By.ID, click).click()
        cards = "[...document.querySelectorAll('.line')].filter((each) => each.checkVisibility())"
        return set(browser.execute_script(f"return {cards}.map((each) => each.id)"))

    every = shown()
    assert shown("view-apparatus") == every
    defects = shown("kind-defect")
    assert "1660" in defects < every
    assert "160" not in defects
    # The card that the address names is shown even if the filter hides it.
    browser.execute_script("location.hash = '#160'")
    assert shown() == defects | {"160"}
    # The program is shown whole.
    assert shown("view-witness") == every
    assert shown("view-apparatus") == defects | {"160"}
    browser.execute_script("document.getElementById('kind-all').click()")
    assert shown() == every


@pytest.mark.campaign
def test_without_scripts_pages_say_what_they_have(browser: Chrome, site: Path) -> None:
    with without_scripts(browser):
        browser.get((site / "laboratory.html").as_uri())
        text = browser.find_element(By.TAG_NAME, "main").text
        assert "step 25" in text
        assert "V2" in text
        browser.get((site / "listing/two-term.html").as_uri() + "#1660")
        assert "DT=DT+.01" in browser.find_element(By.ID, "1660").text
