"""`make quick`: the tests that the changed files can break, the nearest first, for half a minute.

Changed is what differs from the last commit, or from another one: `make quick ARGS=main`. Exit
status 0 if all that ran passed, and 1 if not. What there was no time for is counted.
"""

import ast
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SECONDS = 28.0


def main(arguments: Sequence[str]) -> int:
    """Run them."""
    base = arguments[0] if arguments else "HEAD"
    near = nearest(changed(base), sources())
    if not near:
        print(f"quick: no test reads what differs from {base}")
        return 0
    plugin = Deadline(near, time.monotonic() + SECONDS)
    options = ["-q", "--no-header", "-p", "no:cacheprovider"]
    # A test that takes longer is left unfinished.
    signal.signal(signal.SIGALRM, lambda *_: pytest.exit("the time is up", returncode=0))
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    code = pytest.main([*options, *near], plugins=[plugin])
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    print(f"quick: {plugin.left} tests were not run; make test runs all")
    return int(code != 0 or plugin.failed)


def changed(base: str) -> list[str]:
    """Return the paths of files that differ from a commit, and of those that git does not know."""
    commands = (["diff", "--name-only", base], ["ls-files", "--others", "--exclude-standard"])
    said = [
        subprocess.run(["git", *each], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for each in commands
    ]
    return sorted({line for each in said for line in each.splitlines() if (ROOT / line).exists()})


def sources() -> dict[str, str]:
    """Return the files of tests by path."""
    found = sorted((ROOT / "tests").rglob("test_*.py"))
    return {str(path.relative_to(ROOT)): path.read_text() for path in found}


def nearest(paths: Sequence[str], tests: dict[str, str]) -> list[str]:
    """Return the files of tests to run: changed ones, of a changed file's name, that name it.

    A test names a module of Python that it imports, and any other file by its name.
    """
    ranks: dict[str, int] = {}
    for path in paths:
        stem = Path(path).stem
        module = path.removesuffix(".py").replace("/", ".") if path.endswith(".py") else None
        for test, text in tests.items():
            if path == test:
                rank = 0
            elif Path(test).stem == f"test_{stem}":
                rank = 1
            elif module and module in imported(text):
                rank = 2
            elif module is None and re.search(rf"\b{re.escape(stem)}\b", text):
                rank = 3
            else:
                continue
            ranks[test] = min(rank, ranks.get(test, rank))
    return sorted(ranks, key=lambda test: (ranks[test], test))


@cache
def imported(text: str) -> set[str]:
    """Return the modules that a source imports, and the names it takes from them as modules."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found.update(each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found.update(f"{node.module}.{each.name}" for each in node.names)
    return found


class Deadline:
    """A plugin that keeps the order of the files, and begins no test once the time is up."""

    def __init__(self, files: Sequence[str], deadline: float) -> None:
        self._order = {file: i for i, file in enumerate(files)}
        self._deadline = deadline
        self.left = 0
        self.failed = False

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Sort them."""
        items.sort(key=lambda item: self._order[item.nodeid.partition("::")[0]])
        self.left = len(items)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count those that end."""
        self.failed |= report.failed
        self.left -= report.when == "teardown"

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> bool | None:
        """Pass over a test that would begin too late."""
        return None if time.monotonic() < self._deadline else True


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
