"""The trial of one mutation: tests that enter its function, nearest first, then `verify`."""

import re
import sys
from collections.abc import Set
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from tests.campaigns.mutations.reach import PYTEST, Check, command_of, files_of_tests
from tests.campaigns.mutations.sample import Mutation, functions_in
from tests.campaigns.mutations.tree import ROOT, Tree

# Recorded time of the tests of the changed file that are run first; of the first tier of other
# tests; of the second tier; and of all kinds of `verify`. Slower checks are not tried, so that a
# mutation lives that only they would catch.
OWN, FIRST, SECOND, VERIFY = 10.0, 20.0, 60.0, 60.0  # s
# Tests that passed without a mutation since the run began.
_PASS: set[str] = set()
_LEVEL = re.compile("_(plain|avx2|avx512)$")
# A trial may take this many times its recorded time, and some seconds to start.
SLOWER, START = 6.0, 60.0  # s


@dataclass(frozen=True)
class Verdict:
    """The outcome of a mutation: caught, lives, or the reason why it does not count."""

    mutation: Mutation
    outcome: str
    by: str | None
    seconds: float = 0.0
    is_fast: bool = False  # whether a test of `make test` caught it


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
                return Verdict(mutation, "caught", by.name, is_fast=not by.is_campaign)
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


def _import(mutation: Mutation, tree: Tree) -> tuple[str, str, float, bool]:
    """Return the outcome if no test began: whether the mutation can be imported at all."""
    module = ".".join(PurePosixPath(mutation.file).with_suffix("").parts)
    code, _ = tree.run([sys.executable, "-c", f"import pyharness, {module}"], START)
    return (
        ("caught", "collection", 0.0, True)
        if code == 0
        else ("cannot be imported", "import", 0.0, False)
    )


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
        libraries = ("", "_bodies", "_hot", "_many", "_tapes")
        modules = {f"{found[1].lower()}{of}" for of in libraries} if found else set()
        entered = _entering({function}, modules, checks)
        if not entered:
            entered = _entering(functions_in(mutation.file), modules, checks)
        mention = re.compile(rf"\btest_{stem}\b")
    named = {path for path in files_of_tests() if mention.search(path + (ROOT / path).read_text())}
    chosen = {each.name for each in entered}
    more = [e for e in checks if e.name.partition("::")[0] in named and e.name not in chosen]
    return [each for group in (entered, more) for each in sorted(group, key=lambda e: e.seconds)]


def _entering(functions: Set[str | None], modules: set[str], checks: list[Check]) -> list[Check]:
    """Return the checks that enter one of some compiled functions."""
    ends = {f"{module}:{function}" for module in (*modules, "") for function in functions}
    # A function that C calls has the name of its instruction set after its own.
    return [e for e in checks if not ends.isdisjoint(_LEVEL.sub("", n) for n in e.functions)]


def _tiers(mutation: Mutation, checks: list[Check]) -> list[list[Check]]:
    """Return lists of checks; each list is run only if no check before it failed."""
    found = near(mutation, checks)
    kinds = sorted((e for e in found if e.name.startswith("verify")), key=lambda e: e.seconds)
    tests = [each for each in found if not each.is_campaign]
    # A test run with few files begins soonest.
    own = _within([each for each in tests if _own(mutation) in each.name], OWN)
    first = _within(_without(tests, own), FIRST)
    # Start again from the quickest, so that most of them fit.
    rest, campaigns = (
        sorted(each, key=lambda each: each.seconds)
        for each in (_without(tests, [*own, *first]), _without(found, [*tests, *kinds]))
    )
    more = _within(rest, SECOND), _within(campaigns, SECOND)
    return [own, first, *more, *([kind] for kind in _within(kinds, VERIFY))]


def _without(checks: list[Check], tried: list[Check]) -> list[Check]:
    names = {each.name for each in tried}
    return [each for each in checks if each.name not in names]


def _own(mutation: Mutation) -> str:
    """Return how the name of the changed file's test file ends."""
    return f"/test_{PurePosixPath(mutation.file).stem}.py"


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
    code, said = tree.test([*PYTEST, "-v", "-x", *(each.name for each in checks)], limit)
    if code == 0:
        return None
    by_name = {each.name: each for each in checks}
    failed = re.findall(r"^(?:FAILED|ERROR) (tests/\S.*?)(?: - .*)?$", said, re.M)
    for name in failed[:1]:
        # The check may be a file, or a test with all its parameters.
        wider = (name, name.partition("[")[0], name.partition("::")[0])
        if found := next((by_name[each] for each in wider if each in by_name), None):
            return replace(found, name=name)
    if failed or code in (2, 3, 4):
        raise NotCollected
    # A test crashed, or never ended.
    begun = re.findall(r"^(tests/\S+::.*?)(?: (?:PASSED|FAILED|ERROR|SKIPPED).*)?$", said, re.M)
    known = [by_name[name.strip()] for name in begun if name.strip() in by_name]
    return known[-1] if known else checks[0]
