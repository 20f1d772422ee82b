"""One row on trial: the check that caught it before, those near to it, then everything."""

import json
import re
import sys
import tomllib
from collections.abc import Callable
from pathlib import PurePosixPath
from typing import NamedTuple

from tests.mutations.table import FOLDER, ROOT, Row
from tests.mutations.tree import Tree

# Random draws of `verify` follow a seed; the week's would give another score each week.
SEED = "mutations"
# Not these: they look whether the text still stands, or plant faults in the text themselves; and
# a browser asks for more address space than a trial has.
NOT_HERE = ("tests/mutations/test_mutations.py", "tests/browser")
OF_ONE_CHECK = 180.0  # s
OF_ALL = 2400.0  # s
NEAR: dict[str, list[str]] = tomllib.loads((FOLDER / "near.toml").read_text())
# What `verify` sees of these sooner than the whole suite would.
SEEN_BY_VERIFY = "random,methods,prepared"
JUDGES = (
    "fortran/modern/", "pyharness/verify/", "pyharness/methods/", "pyharness/truth/reference",
    "pyharness/theory/conditioning", "pyharness/compare/random_scenes",
)  # fmt: skip


class Verdict(NamedTuple):
    """What became of a row: what caught it, None where it lives."""

    row: Row
    killer: str | None
    seconds: float


def near(row: Row) -> list[str]:
    """Return the test files that are most likely to catch a change."""
    for begin, names in NEAR.items():
        if row.file.startswith(begin):
            rooms = [name.rpartition("/") for name in names]
            paths = [f"tests/{room}/test_{name}.py" for room, _, name in rooms]
            return [path for path in paths if (ROOT / path).exists()]
    module = ".".join(PurePosixPath(row.file).with_suffix("").parts)
    package, _, name = module.rpartition(".")
    uses = re.compile(rf"\b(from|import) {re.escape(module)}\b|from {re.escape(package)} import"
                      rf" [^\n]*\b{name}\b|tests\.test_{name}\b")  # fmt: skip
    own = {f"test_{name}", f"test_{package.rpartition('.')[2]}"}
    found = [path for path in sorted((ROOT / "tests").rglob("test_*.py"))
             if path.stem in own or uses.search(path.read_text())]  # fmt: skip
    found.sort(key=lambda path: path.stem not in own)
    paths = [str(path.relative_to(ROOT)) for path in found]
    return [path for path in paths if path not in NOT_HERE]


def failing(tree: Tree, names: list[str], limit: float) -> str | None:
    """Run tests until one fails; return its name, or None."""
    ignored = [f"--ignore={path}" for path in NOT_HERE]
    endless = ["-o", f"faulthandler_timeout={OF_ONE_CHECK}",
               "-o", "faulthandler_exit_on_timeout=true"]  # fmt: skip
    command = [sys.executable, "-m", "pytest", "-v", "-x", "--no-header", "--tb=no", "-p",
               "no:cacheprovider", *endless, *ignored, *names]  # fmt: skip
    code, said = tree.run(command, limit)
    if code == 0:
        return None
    late = code is None or "Timeout (" in said
    if late or (code is not None and code < 0):
        begun = re.findall(r"^(tests/\S+::.*?)(?: (?:PASSED|SKIPPED|XFAIL).*)?$", said, re.M)
        last = re.split(r" (?=Fatal|Timeout|$)", begun[-1])[0].strip() if begun else "tests"
        return f"time-out {last}" if late else last
    failed = re.search(r"^(?:FAILED|ERROR) (tests/\S.*?)(?: - .*)?$", said, re.M)
    if failed:
        return failed[1].strip()
    # A name that is no more; or, where none was given, nothing at all could be collected.
    return None if names and code in (4, 5) else "tests"


def verification(tree: Tree, name: str | None = None, limit: float = OF_ALL) -> str | None:
    """Run `verify`, one check or all; return the first that failed, or None."""
    command = [sys.executable, "-m", "pyharness", "verify", "--format", "json"]
    if name:
        command += ["--only", name]
    if not name or "random" in name:
        command += ["--seed", SEED]
    code, said = tree.run(command, limit)
    if code == 0:
        return None
    if code is None:
        return f"time-out verify {name or ''}".strip()
    try:
        found = json.loads(said[said.index("{") :])["checks"]
        first: str = next(each["id"] for each in found if not each["passed"])
        return f"verify {first}"
    except (ValueError, KeyError, StopIteration):
        # A name that is no more; or a fault that let nothing be said.
        return None if name and code == 2 else f"verify {name or ''}".strip()


def check(tree: Tree, killer: str) -> str | None:
    """Run the check of that name; return its name where it fails."""
    name = killer.removeprefix("time-out ")
    kind, _, id = name.partition(" ")
    # What never ended is given less time to.
    limit = OF_ONE_CHECK / 3.0 if name != killer else OF_ONE_CHECK
    if kind == "verify":
        found = verification(tree, id or None, limit)
    else:
        found = failing(tree, [] if name == "tests" else [name], limit)
    return killer if found else None


def attempt(tree: Tree, unchanged: Tree, row: Row, reach: str) -> str | None:
    """Return what catches a row; `reach` is "near" or "all".

    What fails in a copy that is `unchanged` too says nothing.
    """
    said = tree.change(row)
    try:
        if said is not None:
            return "build"
        if row.killer and row.killer != "build" and (found := check(tree, row.killer)):
            return found
        steps: list[Callable[[], str | None]] = []
        if names := near(row):
            steps.append(lambda: failing(tree, names, OF_ALL))
        if row.file.startswith(JUDGES):
            steps.append(lambda: verification(tree, SEEN_BY_VERIFY))
        if reach == "all":
            steps += [lambda: failing(tree, [], OF_ALL), lambda: verification(tree)]
        for step in steps:
            if found := step():
                if check(unchanged, found) is None:
                    return found
                print(f"{row.id}: {found} fails without the change too", file=sys.stderr)
        return None
    finally:
        tree.restore(row)


def false_killers(tree: Tree, killers: list[str]) -> list[str]:
    """Return the checks that fail though nothing is changed."""
    names = sorted({each.removeprefix("time-out ") for each in killers} - {"build", "tests"})
    nodes = [each for each in names if not each.startswith("verify")]
    ids = [each.partition(" ")[2] for each in names if each.startswith("verify ")]
    found = []
    while nodes and (failed := failing(tree, nodes, OF_ALL)):
        found.append(failed)
        nodes = [each for each in nodes if each != failed and not failed.startswith(f"{each}[")]
    if ids and (failed := verification(tree, ",".join(ids))):
        found.append(failed)
    return found
