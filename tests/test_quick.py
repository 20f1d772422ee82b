"""`make quick`: the tests that it chooses, and its end in time."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.quick import ROOT, main, nearest, sources

TESTS = {
    "tests/methods/test_taylor.py": "from pyharness import solve",
    "tests/methods/test_plan.py": "from pyharness.methods import taylor\n",
    "tests/truth/test_other.py": "import numpy\nTEXT = 'taylor_march.f90'",
}


@pytest.mark.parametrize(
    ("path", "wanted"),
    [
        ("pyharness/methods/taylor.py", ["test_taylor", "test_plan"]),
        ("fortran/modern/taylor_march.f90", ["test_other"]),
        ("tests/truth/test_other.py", ["test_other"]),
        ("docs/index.md", []),
    ],
)
def test_nearest_tests_come_first(path: str, wanted: list[str]) -> None:
    assert [Path(each).stem for each in nearest([path], TESTS)] == wanted


def test_a_module_has_the_tests_that_import_it() -> None:
    found = nearest(["pyharness/scenes/rescaled.py"], sources())
    assert found[0] == "tests/scenes/test_rescaled.py"
    assert nearest(["fortran/modern/taylor_march.f90"], sources())


@pytest.mark.parametrize(
    ("seconds", "body", "code", "said"),
    [
        (60.0, "pass", 0, "2 tests passed, of 2"),
        (60.0, "assert False", 1, "1 tests passed, of 2"),
        (5.0, "time.sleep(90)", 0, "1 tests passed, of 2"),
    ],
)
def test_it_ends_when_the_time_is_up(
    tmp_path: Path, seconds: float, body: str, code: int, said: str
) -> None:
    (tmp_path / "test_b.py").write_text("def test_b(): pass\n")
    (tmp_path / "test_a.py").write_text(f"import time\ndef test_a(): {body}\n")
    command = f"import sys; from tests.quick import run; sys.exit(run(FILES, {seconds}))"
    done = subprocess.run(
        [sys.executable, "-c", command.replace("FILES", "['test_b.py', 'test_a.py']")],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, said in done.stdout) == (code, True), done.stdout + done.stderr


def test_a_commit_that_is_none_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["no-such-commit"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
