"""Functions that each test, and each kind of `verify`, enters: recorded once, file by file.

The records are in `build/mutations/reach/`; a record is made anew if its test file changed.
"""

import hashlib
import json
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from pyharness.checks.kinds import KINDS
from tests.campaigns.mutations.tree import PLACE, ROOT, Processes, Tree

# Random draws of `verify` follow a seed; with the seed of the week the score would change weekly.
SEED = "mutations"
# Excluded are tests of this very tool, of pages, which are not changed and take long, of a browser,
# which takes more address space than a trial has, and of run times, which say nothing under load.
NOT_HERE = ("tests/campaigns/mutations/", "tests/edition/", "tests/browser/", "tests/bench/")
# The files that most mutations need are recorded first, so that an interrupted recording is useful.
FIRST = ("engine", "model", "thesis", "truth", "checks", "sweep")
# Arguments of pytest for every test.
PYTEST = ("--no-header", "--tb=no", "-p", "no:cacheprovider")
OF_ONE_FILE, UNKNOWN = 3000.0, 20.0  # s
# A build for debuggers keeps the names of its functions.
INSTRUMENTED = (
    "-Ddebug=true",
    *(f"-D{language}_args=-finstrument-functions" for language in ("c", "fortran")),
)


@dataclass(frozen=True)
class Check:
    """A test by pytest's name, or `verify KIND`; `make test` runs none that is a campaign."""

    name: str
    seconds: float
    functions: frozenset[str]
    is_campaign: bool = False


def command_of(kind: str) -> list[str]:
    seed = ["--seed", SEED] if kind == "random" else []
    return ["verify", "--only", kind, "--format", "json", *seed]


def files_of_tests() -> list[str]:
    """Return the test files, the most needed ones first."""
    paths = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("test_*.py"))
    order = {f"tests/{name}": i for i, name in enumerate(FIRST)}
    paths.sort(key=lambda path: order.get(str(Path(path).parent), len(order)))
    return [path for path in paths if not path.startswith(NOT_HERE)]


def reach(processes: Processes, jobs: int) -> list[Check]:
    """Return all checks that pass without a mutation; record those that are new or changed."""
    folder = PLACE / "reach"
    folder.mkdir(parents=True, exist_ok=True)
    names = [*files_of_tests(), *(f"verify {kind}" for kind in KINDS)]
    old = [name for name in names if not _up_to_date(name)]
    if old:
        print(f"recording which functions {len(old)} files of tests enter", flush=True)
        hooks = PLACE / "hooks.so"
        source = Path(__file__).parent / "hooks.c"
        subprocess.run(
            ["gcc", "-O1", "-shared", "-fPIC", "-o", str(hooks), str(source)], check=True
        )
        traced, plain = Tree("traced", processes, *INSTRUMENTED), Tree("unchanged", processes)
        with ThreadPoolExecutor(jobs) as pool:
            for name, said in pool.map(lambda each: _record(each, traced, plain, hooks), old):
                print(f"  {name}: {said}", flush=True)
    return [check for name in names for check in _read(name)]


def _path(name: str) -> Path:
    return PLACE / "reach" / f"{name.replace('/', '.').replace(' ', '.')}.json"


def _digest(name: str) -> str:
    source = ROOT / name
    return hashlib.sha256(source.read_bytes() if source.exists() else name.encode()).hexdigest()


def _up_to_date(name: str) -> bool:
    path = _path(name)
    return path.exists() and json.loads(path.read_text())["digest"] == _digest(name)


def _read(name: str) -> Iterable[Check]:
    path = _path(name)
    if not path.exists():
        # A file without a record is run as a whole for mutations of files that it names.
        yield Check(name, UNKNOWN, frozenset())
        return
    record = json.loads(path.read_text())
    functions = record["functions"]
    for test, (seconds, entered, is_campaign) in record["tests"].items():
        yield Check(test, seconds, frozenset(functions[i] for i in entered), is_campaign)


def _record(name: str, traced: Tree, plain: Tree, hooks: Path) -> tuple[str, str]:
    digest = _digest(name)
    place = _path(name).with_suffix(".new")
    place.unlink(missing_ok=True)
    environment = {"MUTATIONS_RECORD": str(place), "LD_PRELOAD": str(hooks)}
    kind = name.removeprefix("verify ")
    if kind != name:
        command = [sys.executable, "-m", "tests.campaigns.mutations.recorder", *command_of(kind)]
    else:
        command = [sys.executable, "-m", "pytest", "-q", *PYTEST]
        command += ["-p", "tests.campaigns.mutations.recorder", name]
    _, said = traced.run(command, OF_ONE_FILE, environment)
    if not place.exists():
        return name, f"not recorded: {said[-300:]}"
    found = json.loads(place.read_text())
    if kind != name:
        found = {name: found["verify"]}
    # Tests that fail under the recording are tried again without it; skipped tests catch nothing.
    failed = [test for test, (_, _, passed, _) in found.items() if not passed]
    if failed and kind == name:
        _, said = plain.test([*PYTEST, "-v", *failed], OF_ONE_FILE)
        failed = [test for test in failed if f"{test} PASSED" not in said]
    for test in failed:
        del found[test]
    functions = sorted({each for _, names, *_ in found.values() for each in names})
    index = {each: i for i, each in enumerate(functions)}
    tests = {
        test: [seconds, [index[each] for each in names], is_campaign]
        for test, (seconds, names, _, is_campaign) in found.items()
    }
    record = {"digest": digest, "functions": functions, "tests": tests}
    _path(name).write_text(json.dumps(record))
    place.unlink()
    said = f"{sum(s for s, *_ in tests.values()):.1f} s, {len(tests)} tests"
    return name, said + (f", not {', '.join(failed)}" if failed else "")
