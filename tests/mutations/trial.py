"""The trial of one mutation: tests that enter its function, nearest first, then `verify`."""

import re
import sys
from dataclasses import dataclass
from pathlib import PurePosixPath

from tests.mutations.reach import Check, command_of, files_of_tests, pytest_command
from tests.mutations.sample import Mutation
from tests.mutations.tree import ROOT, Tree

# Recorded time of all tests of the first tier; of the second tier; and of each kind of `verify`.
# Slower checks are not tried, so that a mutation lives that only they would catch.
FIRST, SECOND = 20.0, 60.0  # s
# Tests that passed without a mutation since the run began.
_PASS: set[str] = set()
# A trial may take this many times its recorded time, and some seconds to start.
SLOWER, START = 6.0, 60.0  # s


@dataclass(frozen=True)
class Verdict:
    """The outcome of a mutation: caught, lives, or the reason why it does not count."""

    mutation: Mutation
    outcome: str
    by: str | None
    seconds: float = 0.0


class NotCollected(Exception):
    """Raised if no test began: perhaps the mutation cannot be imported."""


def attempt(mutation: Mutation, tree: Tree, unchanged: Tree, checks: list[Check]) -> Verdict:
    """Put a mutation into the tree, run the checks that may catch it, and restore the tree."""
    try:
        if why := put_in(mutation, tree):
            return Verdict(mutation, why, None)
        if mutation.is_compiled and tree.binary() == unchanged.binary():
            return Verdict(mutation, "same binary", None)
        for tier in _tiers(mutation, checks):
            by = first_failure(tree, tier)
            if by and (by.name in _PASS or not first_failure(unchanged, [by])):
                _PASS.add(by.name)
                return Verdict(mutation, "caught", by.name)
        return Verdict(mutation, "lives", None)
    except NotCollected:
        return Verdict(mutation, *_import(mutation, tree))
    finally:
        take_out(mutation, tree)


def take_out(mutation: Mutation, tree: Tree) -> None:
    """Restore the file from the checkout; the next compiled mutation will build it."""
    tree.write(mutation.file, (ROOT / mutation.file).read_text())


def put_in(mutation: Mutation, tree: Tree) -> str | None:
    """Write the mutation and build; return the reason if it does not count."""
    text = mutation.changed()
    if mutation.language == "Python":
        try:
            compile(text, mutation.file, "exec")
        except SyntaxError:
            return "does not compile"
    tree.write(mutation.file, text)
    if tree.is_stale and tree.compile() is not None:
        return "does not compile"
    return None


def _import(mutation: Mutation, tree: Tree) -> tuple[str, str]:
    """Return the outcome if no test began: whether the mutation can be imported at all."""
    module = ".".join(PurePosixPath(mutation.file).with_suffix("").parts)
    code, _ = tree.run([sys.executable, "-c", f"import pyharness, {module}"], START)
    return ("caught", "collection") if code == 0 else ("cannot be imported", "import")


def near(mutation: Mutation, checks: list[Check]) -> list[Check]:
    """Return the checks that enter the function around a mutation, or else use its file."""
    function = mutation.function()
    stem = PurePosixPath(mutation.file).stem
    if mutation.language == "JavaScript":
        return [each for each in checks if re.search("javascript|_port.py|laboratory", each.name)]
    if mutation.language == "Python":
        begin = f"{mutation.file}:"
        entered = [each for each in checks if f"{begin}{function}" in each.functions]
        if not entered:
            entered = [e for e in checks if any(name.startswith(begin) for name in e.functions)]
        mention = re.compile(rf"\b{stem}\b")
    else:
        # A module that is expanded for each instruction set has its library's name after its own.
        found = re.search(r"^\s*module (\w+?)_?(?:\$|$)", (ROOT / mutation.file).read_text(), re.M)
        modules = (
            {f"{found[1].lower()}{of}" for of in ("", "_bodies", "_hot", "_many", "_tapes")}
            if found
            else set()
        )
        ends = {f"{module}:{function}" for module in (*modules, "")}
        entered = [each for each in checks if not ends.isdisjoint(each.functions)]
        if not entered:
            entered = [e for e in checks if modules & {n.partition(":")[0] for n in e.functions}]
        mention = re.compile(rf"\btest_{stem}\b")
    named = {path for path in files_of_tests() if mention.search(path + (ROOT / path).read_text())}
    chosen = {each.name for each in entered}
    more = [e for e in checks if e.name.partition("::")[0] in named and e.name not in chosen]
    # Tests of the module's own name come first, then the quickest.
    own = f"/test_{stem}.py"
    entered.sort(key=lambda each: (own not in each.name, each.seconds))
    return [*entered, *sorted(more, key=lambda each: each.seconds)]


def _tiers(mutation: Mutation, checks: list[Check]) -> list[list[Check]]:
    """Return lists of checks, each to be run if nothing failed in the lists before."""
    found = near(mutation, checks)
    tests = [each for each in found if not each.name.startswith("verify")]
    first = _within(tests, FIRST)
    tried = {each.name for each in first}
    # Start again from the quickest, so that most of them fit.
    rest = sorted((each for each in tests if each.name not in tried), key=lambda e: e.seconds)
    kinds = [e for e in found if e.name.startswith("verify") and e.seconds <= SECOND]
    kinds.sort(key=lambda each: each.seconds)
    return [first, _within(rest, SECOND), *([kind] for kind in kinds)]


def _within(checks: list[Check], limit: float) -> list[Check]:
    found, total = [], 0.0
    for each in checks:
        if total + each.seconds <= limit:
            found.append(each)
            total += each.seconds
    return found


def first_failure(tree: Tree, checks: list[Check]) -> Check | None:
    """Return the first check that fails, or None."""
    if not checks:
        return None
    limit = START + SLOWER * sum(each.seconds for each in checks)
    if checks[0].name.startswith("verify "):
        kind = checks[0].name.removeprefix("verify ")
        code, _ = tree.run([sys.executable, "-m", "pyharness", *command_of(kind)], limit)
        return checks[0] if code != 0 else None
    names = tree.folder / "build" / "tests"
    names.write_text("\n".join(each.name for each in checks))
    code, said = tree.run([*pytest_command("-v"), "-x", f"@{names}"], limit)
    if code == 0:
        return None
    by_name = {each.name: each for each in checks}
    failed = re.findall(r"^(?:FAILED|ERROR) (tests/\S.*?)(?: - .*)?$", said, re.M)
    for name in failed[:1]:
        # The check may be a file, or a test with all its parameters.
        wider = (name, name.partition("[")[0], name.partition("::")[0])
        if found := next((by_name[each] for each in wider if each in by_name), None):
            return Check(name, found.seconds, found.functions)
    if failed or code in (2, 3, 4):
        raise NotCollected
    # A test crashed, or never ended.
    begun = re.findall(r"^(tests/\S+::.*?)(?: (?:PASSED|FAILED|ERROR|SKIPPED).*)?$", said, re.M)
    known = [by_name[name.strip()] for name in begun if name.strip() in by_name]
    return known[-1] if known else checks[0]
