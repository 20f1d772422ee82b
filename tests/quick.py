"""`make quick`: tests that belong to the changed files, the nearest first, for half a minute.

Changed files are those that differ from the last commit, or from another: `make quick ARGS=main`.
Exit status 0 if no test failed in that time, 1 if one did, 2 if there is no such commit.
"""

import ast
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# What the fast tier leaves out: a folder, and files with this line. The plugin `tests.tiers` can't
# have them, because pytest must be the first to import a plugin.
WEEKLY = ROOT / "tests/campaigns"
MARK = "\npytestmark = pytest.mark.campaign\n"
SECONDS = 23.0
# A chunk may have campaigns only. Failures are counted one by one.
_WELL = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED, pytest.ExitCode.TESTS_FAILED)
# Tests of a file that no test names, by the beginning of its path. Those of a package follow.
USERS = {
    "fortran/original": "tests/thesis", "fortran/many/lanes": "tests/thesis",
    "fortran": "tests/engine", "web": "tests/edition", "pyharness/edition": "tests/edition",
    "pyharness/data": "tests/history", "pyharness/__main__": "tests/cli",
}  # fmt: skip


def main(arguments: Sequence[str]) -> int:
    """Run the tests of the files that differ from a commit, and return the exit status."""
    base = arguments[0] if arguments else "HEAD"
    try:
        near = nearest(changed(base), sources())
    except subprocess.CalledProcessError as failure:
        print(f"quick: {failure.stderr.splitlines()[0]}", file=sys.stderr)
        return 2
    if not near:
        print(f"quick: no test reads what differs from {base}")
        return 0
    return run(near, SECONDS)


def run(files: Sequence[str], seconds: float) -> int:
    """Run test files in this order, and end after `seconds`, even in the middle of a test."""
    counter = Counter(time.monotonic() + seconds)
    signal.signal(signal.SIGALRM, lambda *_: counter.ring())
    # An alarm in a finalizer is ignored; the next test finds that the time is up.
    options = ["-q", "--no-header", "-p", "no:cacheprovider", "-p", "no:unraisableexception"]
    codes = []
    # In chunks, because all files may take longer to collect than the time that there is.
    for chunk in _chunks(files):
        if counter.left() > 0.0:
            codes.append(pytest.main([*options, "-m", "not campaign", *chunk], plugins=[counter]))
    print(f"quick: {counter.passed} tests passed of {len(files)} files; make test runs all")
    return int(any(code not in _WELL for code in codes) or counter.failed > 0)


def _chunks(files: Sequence[str]) -> Iterator[Sequence[str]]:
    done, size = 0, 4
    while done < len(files):
        yield files[done : done + size]
        done, size = done + size, 2 * size


def changed(base: str) -> list[str]:
    """Return the paths of files that differ from a commit, and of those that git does not know."""
    commands = (["diff", "--name-only", base], ["ls-files", "--others", "--exclude-standard"])
    said = [
        subprocess.run(["git", *each], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for each in commands
    ]
    return sorted({line for each in said for line in each.splitlines() if (ROOT / line).exists()})


def sources() -> dict[str, str]:
    """Return the text of every test file of the fast tier by its path."""
    found = {path: path.read_text() for path in sorted((ROOT / "tests").rglob("test_*.py"))}
    return {
        str(path.relative_to(ROOT)): text
        for path, text in found.items() if WEEKLY not in path.parents and MARK not in text
    }  # fmt: skip


def nearest(paths: Sequence[str], tests: dict[str, str]) -> list[str]:
    """Return the test files to run, the nearest first.

    The first are changed test files, then test files with the name of a changed file. The next are,
    for a Python module, the test files that import it, by the number of imports in between, and
    for any other file the test files that contain its name. If there are none, or if the file is
    no Python module, the folder of `user_of` follows, first its files with the first word of the
    changed file's name.
    """
    ranks: dict[str, tuple[int, bool]] = {}
    for path in paths:
        stem = Path(path).stem
        is_python = path.endswith(".py")
        near = importers(path) if is_python else {}
        found = {}
        for test, text in tests.items():
            if path == test:
                found[test] = 0
            elif Path(test).stem == f"test_{stem}":
                found[test] = 1
            elif between := [near[name] for name in imported(text) if name in near]:
                found[test] = 2 + min(between)
            elif not is_python and re.search(rf"\b{re.escape(stem)}\b", text):
                found[test] = 2
        if not found or not is_python:
            user, word = user_of(path), stem.partition("_")[0]
            of_folder = {test: text for test, text in tests.items() if test.startswith(user)}
            found = {test: 3 + (word not in text) for test, text in of_folder.items()} | found
        for test, steps in found.items():
            rank = (steps, Path(test).parent.name != Path(path).parent.name)
            ranks[test] = min(rank, ranks.get(test, rank))
    return sorted(ranks, key=lambda test: (ranks[test], test))


def user_of(path: str) -> str:
    """Return the folder of tests that use a file, or the file itself if there is none."""
    every = [*USERS.items(), *((f"pyharness/{each}", f"tests/{each}") for each in Path(path).parts)]
    return next((user for begin, user in every if path.startswith(begin)), path)


def importers(path: str) -> dict[str, int]:
    """Return the modules that import a module, by the number of imports between them."""
    found = {_module(path): 0}
    last = list(found)
    while last:
        distance = found[last[0]] + 1
        last = sorted({user for name in last for user in users_of().get(name, ())} - set(found))
        found |= dict.fromkeys(last, distance)
    return found


@cache
def users_of() -> dict[str, set[str]]:
    """Return the modules of the package and of the tests that import a module, by its name."""
    found: dict[str, set[str]] = {}
    stub = ROOT / "pyharness/__init__.pyi"
    for path in [stub, *(ROOT / "pyharness").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]:
        for name in imported(path.read_text()):
            found.setdefault(name, set()).add(_module(str(path.relative_to(ROOT))))
    return found


def _module(path: str) -> str:
    return path.removesuffix("i").removesuffix(".py").removesuffix("/__init__").replace("/", ".")


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


class Counter:
    """A plugin that counts tests, and ends them when the time is up."""

    passed = failed = 0
    _is_running = False

    def __init__(self, end: float) -> None:
        """Store the time (s) of `time.monotonic` at which the tests end."""
        self._end = end

    def left(self) -> float:
        """Return the time that is left (s)."""
        return self._end - time.monotonic()

    def ring(self) -> None:
        """End pytest if a test is running: elsewhere the exception would be an error of pytest."""
        if self._is_running:
            self._stop()

    def _stop(self) -> None:
        self._is_running = False
        pytest.exit("the time is up", returncode=0)

    def pytest_collection_finish(self) -> None:
        """Set the alarm."""
        signal.setitimer(signal.ITIMER_REAL, max(self.left(), 0.001))

    def pytest_runtest_logstart(self) -> None:
        """End pytest if a test caught the exception, or the alarm rang between two tests."""
        self._is_running = True
        if self.left() <= 0.0:
            self.ring()

    def pytest_runtest_logfinish(self) -> None:
        """Let the alarm have no effect until the next test begins."""
        self._is_running = False

    def pytest_sessionfinish(self) -> None:
        """Stop the alarm."""
        signal.setitimer(signal.ITIMER_REAL, 0.0)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count each test that passed, and every failed part of a test."""
        # A test that caught the exception failed by it, which is not reported.
        if report.failed and self.left() <= 0.0:
            self._stop()
        self.failed += report.failed
        self.passed += report.when == "call" and report.passed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
