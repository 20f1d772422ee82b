"""Helpers for tests in a browser: the screen, the console's messages, pages that are too wide."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By

WIDTHS = (360, 800, 1440)
# Wider than any font of a reader: every letter takes one em more.
WIDEST_FONT = "* { letter-spacing: 1em !important; }"
# Returns the controls without a label, hidden ones too.
UNNAMED = (
    "return [...document.querySelectorAll('.controls :is(input, select)')]"
    ".filter((each) => !each.labels.length).map((each) => each.id)"
)


def set_width(browser: Chrome, width: int) -> None:
    """Set the width of the browser's screen (pixels)."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def set_scheme(browser: Chrome, scheme: str) -> None:
    """Set the browser's preferred colour scheme, light or dark."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


@contextmanager
def screen(browser: Chrome, width: int, scheme: str = "light") -> Iterator[None]:
    """Set the browser's width (pixels) and its preferred colour scheme."""
    set_width(browser, width)
    set_scheme(browser, scheme)
    try:
        yield
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def errors(browser: Chrome) -> list[str]:
    """Return the console's messages and clear them."""
    return [each["message"] for each in browser.get_log("browser")]  # type: ignore[no-untyped-call]


def add_style(browser: Chrome, style: str) -> None:
    """Add a style sheet to the page that the browser shows."""
    script = (
        "const style = document.createElement('style');"
        "style.textContent = arguments[0]; document.head.append(style);"
    )
    browser.execute_script(script, style)


def too_wide(browser: Chrome) -> int:
    """Return the number of pixels by which a page is wider than the screen."""
    script = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    found: int = browser.execute_script(script)
    return found


def click(browser: Chrome, selector: str) -> None:
    """Click as a mouse does, where the element can be seen."""
    element = browser.find_element(By.CSS_SELECTOR, selector)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)
    element.click()


def text_of(browser: Chrome, id: str) -> str:
    """Return the text of an element, hidden parts included."""
    script = "return document.getElementById(arguments[0]).textContent"
    return str(browser.execute_script(script, id))


def fragment(browser: Chrome) -> str:
    """Return the fragment of the page's address."""
    return browser.current_url.partition("#")[2]


@contextmanager
def without_scripts(browser: Chrome) -> Iterator[None]:
    """Switch scripts off."""
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        yield
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


@contextmanager
def on_paper(browser: Chrome) -> Iterator[None]:
    """Show the page as it is printed."""
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        yield
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


@contextmanager
def opening(browser: Chrome, page: Path) -> Iterator[Callable[[str], None]]:
    """Yield a function that loads a page with a fragment; its console must stay empty."""

    def opened(fragment: str = "") -> None:
        # Changing only the fragment would not reload the page.
        browser.get("about:blank")
        browser.get(f"{page.as_uri()}{fragment}")

    errors(browser)
    yield opened
    assert errors(browser) == []
