"""Fixtures that several files use."""

import os
import shlex
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from pyharness.cli.main import main
from pyharness.model.extension import extension
from tests.instruction_sets import BEST, CHOSEN, LEVELS, levels_here
from tests.traps import guard

# `make cross-check` sets this variable; each call of a kernel then takes some microseconds longer.
if os.environ.get("PYHARNESS_TRAPS"):
    assert guard(extension()) > 0

if extension().choose_instructions(CHOSEN) > CHOSEN:
    raise pytest.UsageError(f"this build has no {LEVELS[CHOSEN]}; try: make wheel, nox -s levels")

pytest_plugins = ["tests.order", "tests.tiers"]
Printed = Callable[[str], str]
Patch = pytest.MonkeyPatch
Capture = pytest.CaptureFixture[str]
ResultOf = Callable[..., Any]
# Tests that share the built site and the judgements of all claims, half a minute of work; and
# tests that take long, at the end of which no process should wait for another.
_FIRST = (
    "tests/browser/", "tests/edition/", "tests/cli/test_edition.py", "tests/history/",
    "tests/test_",
)  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """If several processes run tests, begin with the tests that share most work.

    With `--dist worksteal` each process begins with a part of the list, so that the first process
    has all these tests. A single process runs the tests in the order of its command line.
    """
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=lambda item: not item.nodeid.startswith(_FIRST))


@pytest.fixture
def result_of(capsys: Capture) -> ResultOf:
    """Return a function that runs a command, checks its exit status, and returns the output."""

    def run(words: Sequence[str], status: int = 0) -> Any:
        assert main(words) == status
        return capsys.readouterr()

    return run


@pytest.fixture
def printed(result_of: ResultOf) -> Printed:
    """Return a function that runs a command line, expects exit status 0, and returns the output."""
    return lambda command: str(result_of(shlex.split(command)).out)


@pytest.fixture(scope="session")
def built_site() -> dict[str, bytes]:
    """Return the files of the edition's pages by path."""
    from pyharness.edition.site import build_site

    return build_site()


@pytest.fixture
def best_level() -> Iterator[None]:
    """Run the test with this processor's registers, as compilers use them."""
    extension().choose_instructions(BEST)
    yield
    extension().choose_instructions(CHOSEN)


@pytest.fixture(params=range(len(LEVELS)), ids=LEVELS)
def level(request: pytest.FixtureRequest) -> Iterator[int]:
    """Run the test with the kernels of one instruction set, if this machine has it."""
    wanted: int = request.param
    if wanted not in levels_here():
        pytest.skip(f"no {LEVELS[wanted]} in this build, or in this processor")
    assert extension().choose_instructions(wanted) == wanted
    yield wanted
    extension().choose_instructions(CHOSEN)
