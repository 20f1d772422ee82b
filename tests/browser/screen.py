"""Helpers for tests in a browser: the screen, the console's messages, pages that are too wide."""

from collections.abc import Iterator
from contextlib import contextmanager

from selenium.webdriver import Chrome

WIDTHS = (360, 800, 1440)
# Wider than any font of a reader: every letter takes one em more.
WIDEST_FONT = "* { letter-spacing: 1em !important; }"


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
