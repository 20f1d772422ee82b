"""`make test-changed`: campaign tests of the packages that differ from a commit.

The commit is the argument or, by default, that of `tests/passed.txt`, at which all tests passed.
Every campaign test runs if a shared file differs, or if the repository lacks the commit. After
`make test-all` has passed, `--passed` writes the last commit to the file.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).parent.parent
PASSED = ROOT / "tests" / "passed.txt"
# Folders of tests by the beginning of a path; the rest of `pyharness` has those of its name.
TESTS = {
    "docs/article/": ("edition",), "docs/": ("test_docs.py", "test_gallery.py"),
    "README.md": ("test_docs.py",), "CHANGELOG.md": (), "CONTRIBUTING.md": (), ".github/": (),
    ".ci/": (), "verify-port/": ("test_verify_port.py",), "tests/messages.txt": (),
    "tests/passed.txt": (), "web/": ("edition", "browser"),
    "pyharness/edition/": ("edition", "browser"),
    "tests/changed.py": ("test_quick.py",), "tests/quick.py": ("test_quick.py",),
    "tests/tiers.py": ("test_tiers.py",),
    "pyharness/data/": ("history", "thesis", "edition"), "fortran/original/": ("thesis",),
}  # fmt: skip
# Packages on which nearly all others depend.
SHARED = ("pyharness/model/", "pyharness/engine/")


def main(arguments: Sequence[str]) -> int:
    """Run the tests, and return the exit status of pytest."""
    if "--passed" in arguments:
        PASSED.write_text(_git("rev-parse", "HEAD"))
        return 0
    folders = campaigns_of(changed(arguments[0] if arguments else PASSED.read_text().strip()))
    if not folders:
        print("test-changed: no package with campaign tests differs")
        return 0
    print(f"test-changed: {', '.join(folders)}", flush=True)
    code = pytest.main(["-q", "-n", "auto", "--dist", "worksteal", "-m", "campaign", *folders])
    return 0 if code == pytest.ExitCode.NO_TESTS_COLLECTED else int(code)


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout


def changed(base: str) -> list[str] | None:
    """Return the paths of the files that differ from a commit, or None if it is not here."""
    try:
        return _git("diff", "--name-only", base).splitlines()
    except subprocess.CalledProcessError:
        return None


def campaigns_of(paths: Sequence[str] | None) -> list[str]:
    """Return the folders and files of tests that belong to changed files; for None, return all."""
    found: set[str] = set()
    for path in ["meson.build"] if paths is None else paths:
        begin = next((each for each in TESTS if path.startswith(each)), None)
        parts = PurePosixPath(path).parts
        if begin is not None:
            found.update(f"tests/{name}" for name in TESTS[begin])
        elif parts[0] == "tests" and parts[-1].startswith("test_"):
            found.add(path)
        elif parts[0] == "tests" and len(parts) > 2:
            found.add("/".join(parts[:-1]))
        elif parts[0] == "pyharness" and len(parts) > 2 and not path.startswith(SHARED):
            found.add(f"tests/{parts[1]}")
        else:
            return ["tests"]
    return sorted(each for each in found if (ROOT / each).exists())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
