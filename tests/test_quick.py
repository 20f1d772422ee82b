"""`make quick`: which tests it chooses, and that it ends in time."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.quick import ROOT, nearest, sources

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


def test_no_test_begins_when_the_time_is_up(tmp_path: Path) -> None:
    (tmp_path / "test_a.py").write_text("def test_a(): pass\n")
    (tmp_path / "test_b.py").write_text("def test_b(): pass\n")
    code = (
        "import sys, time, pytest; sys.path.insert(0, sys.argv[1]);"
        "from tests.quick import Deadline;"
        "plugin = Deadline(['test_b.py', 'test_a.py'], time.monotonic() + float(sys.argv[2]));"
        "code = pytest.main(['-q', '-p', 'no:cacheprovider'], plugins=[plugin]);"
        "print(code, plugin.left)"
    )
    for seconds, left in ((60.0, 0), (-1.0, 2)):
        done = subprocess.run(
            [sys.executable, "-c", code, str(ROOT), str(seconds)], cwd=tmp_path,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.stdout.splitlines()[-1].split()[-1] == str(left), done.stdout
