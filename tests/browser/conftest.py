"""A browser, and the site as files: no network, no server."""

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
    # A page that is still scrolling takes no click.
    "--force-prefers-reduced-motion",
)  # fmt: skip

# On the PATH, or where GitHub's machines have them.
_BROWSERS = (
    "chromium", "google-chrome", "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
)  # fmt: skip
_DRIVERS = ("chromedriver", os.path.join(os.environ.get("CHROMEWEBDRIVER", ""), "chromedriver"))


def _first(names: tuple[str, ...]) -> str | None:
    return next((found for name in names if (found := shutil.which(name))), None)


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    """Return Chromium without a window; tests are skipped where there is none, and fail in CI."""
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
    # A named driver: none is looked for, and none is fetched.
    chrome = Chrome(options=options, service=Service(executable_path=driver))
    # axe-core takes seconds for the longest page, and a minute where other work has the processors.
    chrome.set_script_timeout(100)
    yield chrome
    chrome.quit()


@pytest.fixture(scope="session")
def site(built_site: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a built site."""
    folder = tmp_path_factory.mktemp("site") / "site"
    write_tree(str(folder), built_site, "--out")
    return folder
