"""Fixtures for a browser and the site as files, without network or server."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium.webdriver import Chrome, ChromeOptions
from selenium.webdriver.chrome.service import Service

from pyharness.cli.output import write_tree

_SWITCHES = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    # A page that is still scrolling does not accept a click.
    "--force-prefers-reduced-motion",
)  # fmt: skip

# Names on the PATH, and paths on GitHub's machines.
_BROWSERS = (
    "chromium", "google-chrome", "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
)  # fmt: skip
_DRIVERS = ("chromedriver", os.path.join(os.environ.get("CHROMEWEBDRIVER", ""), "chromedriver"))


def _first(names: tuple[str, ...]) -> str | None:
    return next((found for name in names if (found := shutil.which(name))), None)


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    """Yield headless Chromium; without a browser, skip the tests, or fail them in CI."""
    chromium, driver = _first(_BROWSERS), _first(_DRIVERS)
    if chromium is None or driver is None:
        told = "no chromium and chromedriver on the PATH: the pages are not tried in a browser"
        if os.environ.get("PYHARNESS_BROWSER") == "required":
            pytest.fail(told)
        pytest.skip(told)
    options = ChromeOptions()
    options.binary_location = chromium
    profile = tmp_path_factory.mktemp("profile")
    for switch in (*_SWITCHES, f"--user-data-dir={profile}", "--window-size=1280,1000"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    # With a named driver, Selenium neither searches for one nor downloads one.
    chrome = Chrome(options=options, service=Service(executable_path=driver))
    # axe-core takes seconds for the longest page, and a minute if other work uses the processors.
    chrome.set_script_timeout(100)
    yield chrome
    chrome.quit()


@pytest.fixture(scope="session")
def site(built_site: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a built site."""
    folder = tmp_path_factory.mktemp("site") / "site"
    write_tree(str(folder), built_site, "--out")
    return folder
