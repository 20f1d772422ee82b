"""Two tiers: `make test` leaves out tests marked `campaign`, and fails one that lacks the mark."""

import os
import sys
import time
from collections.abc import Generator

import pytest

FAST = "not campaign"
LIMIT = 1.0  # s of CPU on the machine on which the yardstick takes _USUAL
_USUAL = 0.045  # s
# A test that imports packages first is not judged, because another would do it in another order.
_MODULES = 20


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test of the fast tier that takes too long."""
    begin, modules = _spent(), len(sys.modules)
    result = yield
    seconds = _spent() - begin
    is_judged = item.config.option.markexpr == FAST and len(sys.modules) - modules < _MODULES
    if is_judged and seconds > LIMIT and seconds > LIMIT * _slowness():
        pytest.fail(
            f"took {seconds:.1f} s of CPU, allowed is {LIMIT:g} s: make it smaller, or mark it "
            "with @pytest.mark.campaign, so that make test-all alone runs it",
            pytrace=False,
        )
    return result


def _spent() -> float:
    """Return the CPU time (s) of this process and of the children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _slowness() -> float:
    """Return how many times slower a yardstick is here and now than usual, at least 1."""
    begin = time.process_time()
    sum(k * k for k in range(1_000_000))
    return max(1.0, (time.process_time() - begin) / _USUAL)
