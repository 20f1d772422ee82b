"""Where the pages go: a folder of their own, whole or as it was."""

import builtins
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from pyharness.cli.main import main
from pyharness.edition import site

Capture = pytest.CaptureFixture[str]
FILES = {"index.html": b"<p>", "docs/a.html": b"a", site.MARK: b"{}"}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a site of three files."""
    monkeypatch.setattr(site, "build_site", lambda progress: FILES)


def _there(folder: Path) -> dict[str, bytes]:
    files = [each for each in folder.rglob("*") if each.is_file()]
    return {each.relative_to(folder).as_posix(): each.read_bytes() for each in files}


@pytest.mark.usefixtures("quick")
def test_a_folder_is_made_and_made_anew(tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / "site"
    assert main(["edition", "--out", str(folder)]) == 0
    assert _there(folder) == FILES
    assert f"Open {folder}/index.html" in capsys.readouterr().out
    (folder / "old.html").write_bytes(b"of before")
    assert main(["edition", "--out", str(folder), "--format", "json"]) == 0
    assert _there(folder) == FILES
    assert json.loads(capsys.readouterr().out)["files"]["docs/a.html"] == 1
    assert [each.name for each in tmp_path.iterdir()] == ["site"]


@pytest.mark.usefixtures("quick")
def test_an_empty_folder_and_a_link_to_one_will_do(tmp_path: Path) -> None:
    folder, link = tmp_path / "site", tmp_path / "link"
    folder.mkdir()
    link.symlink_to(folder)
    assert main(["edition", "--out", str(link)]) == 0
    assert link.is_symlink()
    assert _there(folder) == FILES


@pytest.mark.usefixtures("quick")
def test_a_folder_of_others_is_left_alone(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "thesis.txt").write_bytes(b"mine")
    assert main(["edition", "--out", str(tmp_path)]) == 2
    assert "neither empty nor made by this verb" in capsys.readouterr().err
    assert _there(tmp_path) == {"thesis.txt": b"mine"}


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("broken", ["write_bytes", "rename"])
def test_what_fails_leaves_all_as_it_was(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    folder = tmp_path / "site"
    assert main(["edition", "--out", str(folder)]) == 0
    (folder / "index.html").write_bytes(b"of before")
    before = _there(folder)
    calls = []

    def full(*arguments: Any) -> None:
        calls.append(arguments)
        if len(calls) == 2:
            raise OSError(28, "No space left on device")
        real(*arguments)

    target: Any = Path if broken == "write_bytes" else os
    real = getattr(target, broken)
    monkeypatch.setattr(target, broken, full)
    assert main(["edition", "--out", str(folder)]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert _there(folder) == before
    assert [each.name for each in tmp_path.iterdir()] == ["site"]


def test_what_writes_pages_may_be_missing(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any) -> object:
        if name == "latex2mathml":
            raise ImportError(f"No module named {name!r}", name=name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    assert main(["edition", "--out", str(tmp_path / "site")]) == 2
    assert "'pip install pyharness[edition]'" in capsys.readouterr().err


def test_the_report_counts_files_by_kind(built_site: Mapping[str, bytes]) -> None:
    from pyharness.edition.report import edition_report
    from pyharness.views.render import render

    text = render(edition_report("site", built_site), "table")
    (html,) = (line.split() for line in text.splitlines() if line.startswith("html"))
    pages = [each for name, each in built_site.items() if name.endswith(".html")]
    assert html == ["html", str(len(pages)), f"{sum(map(len, pages)) / 1000:.0f}"]
    assert text.splitlines()[-3].split()[:2] == ["all", str(len(built_site))]
