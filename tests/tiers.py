"""Two tiers: `make test` leaves out tests marked `campaign`, and fails one that lacks the mark."""

import os
import sys
import time
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.quick import MARK, WEEKLY

FAST = "not campaign"
LIMIT = 1.0  # s of CPU on the machine on which the yardstick takes _USUAL
_USUAL = 0.045  # s
# A test that imports packages first is not judged, because another would do it in another order.
_MODULES = 20


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out of the fast tier, without importing them, files of campaigns alone."""
    if config.option.markexpr != FAST:
        return None
    is_marked = collection_path.suffix == ".py" and MARK in collection_path.read_text()
    return True if is_marked or WEEKLY in (collection_path, *collection_path.parents) else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as campaigns `tests/campaigns`, and all but the first parameters of `sampled` tests."""
    begun: set[str] = set()
    for item in items:
        if WEEKLY in item.path.parents:
            item.add_marker("campaign")
        function = item.nodeid.partition("[")[0]
        if item.get_closest_marker("sampled"):
            if function in begun:
                item.add_marker("campaign")
            begun.add(function)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test of the fast tier that takes too long."""
    begin, modules = _spent(), len(sys.modules)
    result = yield
    seconds = _spent() - begin
    # The build with run-time checks is slow.
    is_fast = item.config.option.markexpr == FAST and "PYHARNESS_TRAPS" not in os.environ
    is_judged = is_fast and len(sys.modules) - modules < _MODULES
    # Repeated twice, each beside a yardstick, because other work makes CPU times vary.
    if is_judged and seconds > LIMIT and all(_is_long(item, seconds) for _ in range(2)):
        pytest.fail(
            f"took {seconds:.1f} s of CPU, allowed is {LIMIT:g} s: make it smaller, or mark it "
            "with @pytest.mark.campaign, so that make test-all alone runs it",
            pytrace=False,
        )
    return result


def _is_long(item: pytest.Item, seconds: float) -> bool:
    """Return whether a test takes too long with filled caches or, if not repeatable, did so."""
    begin = _spent()
    with suppress(Exception):
        item.runtest()
        seconds = _spent() - begin
    return seconds > LIMIT * _slowness()


def _spent() -> float:
    """Return the CPU time (s) of this process and of the children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _slowness() -> float:
    """Return how many times slower a yardstick is here and now than usual, at least 1."""
    begin = time.process_time()
    sum(k * k for k in range(1_000_000))
    return max(1.0, (time.process_time() - begin) / _USUAL)
