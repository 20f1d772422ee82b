"""Additions to a copy, which need no other files than the table of the contributing page names.

Each addition is tried in a process of its own that imports the copy.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from pyharness.model.extension import extension

ROOT = Path(__file__).parent.parent
_, _, PAGE = (ROOT / "docs/contributing/architecture.md").read_text().partition("## Where to add")
# By kind, the files of each row.
ROWS: dict[str, str] = dict(re.findall(r"(?m)^\| ([^|]+?) \| ([^|`]*`[^|]+) \|", PAGE))
ADDITIONS = tomllib.loads((Path(__file__).parent / "additions.toml").read_text())["addition"]
_START = """import sys
sys.meta_path[:] = [each for each in sys.meta_path if isinstance(each, type)]
sys.path[:0] = [{0!r}, {0!r} + "/fortran"]
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("copy")
    for name in ("pyharness", "fortran"):
        left_out = shutil.ignore_patterns("__pycache__", "*.so")
        shutil.copytree(ROOT / name, folder / name, ignore=left_out)
    for each in Path(str(extension().__file__)).parent.glob("_*.*"):
        if each.suffix in (".py", ".so"):
            (folder / "pyharness" / each.name).symlink_to(each)
    return folder


def _edited(path: Path, edit: dict[str, str]) -> str:
    if "before" not in edit:
        return edit["add"]
    first, *rest = path.read_text().split(edit["before"])
    assert len(rest) == 1, f"{path}: {edit['before']} is there {len(rest)} times"
    return f"{first}{edit['add']}{edit['before']}{rest[0]}"


@pytest.mark.parametrize("added", ADDITIONS, ids=lambda each: str(each["kind"]))
def test_addition_needs_the_files_of_its_row_alone(
    copy: Path, tmp_path: Path, added: dict[str, Any]
) -> None:
    paths = {each["file"]: copy / each["file"] for each in added["edit"]}
    kept = {path: path.read_bytes() for path in paths.values() if path.exists()}
    try:
        for edit in added["edit"]:
            paths[edit["file"]].write_text(_edited(paths[edit["file"]], edit))
        done = subprocess.run(
            [sys.executable, "-c", _START.format(str(copy)) + added["trial"]],
            cwd=tmp_path, capture_output=True, text=True, check=False,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
    finally:
        for path in paths.values():
            path.unlink()
        for path, content in kept.items():
            path.write_bytes(content)
    for file in paths:
        short = file.removeprefix("pyharness/")
        assert (
            f"`{short}`" in ROWS[added["kind"]] or f"`{Path(short).parent}/`" in ROWS[added["kind"]]
        )


def test_rows_name_few_files_that_are_there() -> None:
    assert len(ROWS) <= 20
    for kind, files in ROWS.items():
        named = re.findall(r"`([\w*-]*[./][\w./*-]+|\w+/)`", files)
        assert len(named) <= (12 if kind.startswith("a defect") else 4), f"{kind}: {named}"
        for each in named:
            assert (ROOT / each).exists() or (ROOT / "pyharness" / each).exists(), each
