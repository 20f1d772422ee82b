"""`make quick` chooses the right tests, and ends in time."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.changed import campaigns_of
from tests.changed import changed as changed_since
from tests.quick import ROOT, Counter, main, nearest, sources
from tests.tables import tables

TESTS = {
    "tests/engine/test_taylor.py": "from pyharness import solve",
    "tests/engine/test_plan.py": "from pyharness.engine.methods import taylor\n",
    "tests/truth/test_other.py": "import numpy\nTEXT = 'taylor_march.f90'",
}


@pytest.mark.campaign
@pytest.mark.parametrize(("path", "wanted"), [
    ("pyharness/engine/methods/taylor.py", ["test_taylor", "test_plan"]),
    ("fortran/modern/taylor_march.f90", ["test_other", "test_plan", "test_taylor"]),
    ("tests/truth/test_other.py", ["test_other"]),
    ("docs/index.md", []),
    ("pyharness/engine/plan/registry.py", ["test_taylor", "test_plan"]),
    ("fortran/modern/solve_all.c", ["test_taylor", "test_plan"]),
])  # fmt: skip
def test_nearest_tests_come_first(path: str, wanted: list[str]) -> None:
    assert [Path(each).stem for each in nearest([path], TESTS)] == wanted


@pytest.mark.campaign
def test_a_module_has_the_tests_that_import_it() -> None:
    found = nearest(["pyharness/engine/problem/rescaled.py"], sources())
    assert found[0] == "tests/checks/scenes/test_rescaled.py"
    assert "tests/engine/test_sums.py" in nearest(["fortran/modern/tape_terms.c"], sources())[:12]


@pytest.mark.campaign
def test_every_source_has_tests() -> None:
    kept = (".py", ".f90", ".fypp", ".c")
    paths = [path for folder in ("pyharness", "fortran") for path in (ROOT / folder).rglob("*")]
    names = [str(path.relative_to(ROOT)) for path in paths if path.suffix in kept]
    tests = sources()
    assert [name for name in names if not nearest([name], tests)] == []


@pytest.mark.campaign
def test_it_ends_when_the_time_is_up(tmp_path: Path) -> None:
    cases = tables(__file__)["cases"]
    (tmp_path / "test_z.py").write_text("def test_z(): pass\n")
    runs = []
    for number, (seconds, body, _, _) in enumerate(cases):
        (tmp_path / f"test_{number}.py").write_text(f"import time\ndef test_a(): {body}\n")
        runs.append((["test_z.py", f"test_{number}.py"], seconds))
    command = f"from tests.quick import run; print([run(*each) for each in {runs}])"
    done = subprocess.run(
        [sys.executable, "-c", command],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    *_, codes = done.stdout.splitlines()
    assert done.stdout.count("FAILED") == 1
    assert codes == str([code for _, _, code, _ in cases]), done.stdout + done.stderr
    said = [line for line in done.stdout.splitlines() if line.startswith("quick: ")]
    for line, (_, _, _, wanted) in zip(said, cases, strict=True):
        assert line.startswith(f"quick: {wanted} files;")


def test_the_alarm_ends_only_a_test() -> None:
    counter = Counter(time.monotonic())
    counter.ring()
    with pytest.raises(pytest.exit.Exception):
        counter.pytest_runtest_logstart()
    counter.ring()
    counter = Counter(time.monotonic() + 1e3)
    counter.pytest_runtest_logstart()
    with pytest.raises(pytest.exit.Exception):
        counter.ring()
    counter.pytest_runtest_logstart()
    counter.pytest_runtest_logfinish()
    counter.ring()


@pytest.mark.campaign
def test_it_runs_tests_of_the_project() -> None:
    command = "from tests.quick import run; print(run(['tests/test_style.py'], 60.0))"
    done = subprocess.run(
        [sys.executable, "-c", command], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.stdout.endswith("of 1 files; make test runs all\n0\n"), done.stdout + done.stderr


def test_a_commit_that_is_none_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["no-such-commit"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(("paths", "wanted"), [
    ([], []),
    (["CHANGELOG.md", "tests/messages.txt"], []),
    (["pyharness/history/account.py", "web/story/story.js"],
     ["tests/browser", "tests/edition", "tests/history"]),
    (["tests/bench/test_terms.py", "tests/browser/screen.py"],
     ["tests/bench/test_terms.py", "tests/browser"]),
    (["tests/history/test_gone.py"], []),
    (["tests/test_words.py", "tests/changed.py"],
     ["tests/test_quick.py", "tests/test_words.py"]),
    (["tests/within.py"], ["tests"]),
    (["pyharness/model/scene.py"], ["tests"]),
    (["fortran/modern/problem.f90"], ["tests"]),
    (None, ["tests"]),
])  # fmt: skip
def test_campaigns_of_what_differs(paths: list[str] | None, wanted: list[str]) -> None:
    assert campaigns_of(paths) == wanted
    assert changed_since("no-such-commit") is None
