"""The output folder of `edition`: it contains only pages, all of them or none."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from pyharness.cli.main import main
from pyharness.edition import site
from pyharness.edition.documents import documents_folder
from pyharness.edition.report import LIBRARIES, MARK
from pyharness.model.facts import shipped
from tests.sweep.sweeps import files

Capture = pytest.CaptureFixture[str]
LISTED = {"schema": 1, "files": {"index.html": 3, "docs/a.html": 1, "docs/old.html": 2}}
FILES = {"index.html": b"<p>", "docs/a.html": b"a", MARK: json.dumps(LISTED).encode()}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the site by one of three files."""
    monkeypatch.setattr(site, "build_site", lambda progress, docs: FILES)


def edition(folder: Path | str, *more: str) -> int:
    return main(["edition", "--out", str(folder), *more])


@pytest.mark.usefixtures("quick")
def test_a_folder_is_made_and_made_anew(tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / "site"
    assert edition(folder) == 0
    assert files(folder) == FILES
    assert f"Open {folder}/index.html" in capsys.readouterr().out
    (folder / "docs/old.html").write_bytes(b"of before")  # listed, but no longer part of the site
    assert edition(folder, "--format", "json") == 0
    assert files(folder) == FILES
    assert json.loads(capsys.readouterr().out)["files"]["docs/a.html"] == 1
    assert [each.name for each in tmp_path.iterdir()] == ["site"]


@pytest.mark.usefixtures("quick")
def test_an_empty_folder_and_a_link_to_one_will_do(tmp_path: Path) -> None:
    folder, link = tmp_path / "site", tmp_path / "link"
    folder.mkdir()
    link.symlink_to(folder)
    assert edition(link) == 0
    assert link.is_symlink()
    assert files(folder) == FILES


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("mark", [None, b"", b"[]", b'{"mine": 1}', b'{"files": 3}', b"{}"])
def test_a_folder_of_others_is_left_alone(
    tmp_path: Path, capsys: Capture, mark: bytes | None
) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/thesis.txt").write_bytes(b"mine")
    if mark is not None:
        (tmp_path / MARK).write_bytes(mark)
    before = files(tmp_path)
    assert edition(tmp_path) == 2
    assert "'docs/thesis.txt'" in capsys.readouterr().err
    assert files(tmp_path) == before


@pytest.mark.usefixtures("quick")
def test_what_was_added_to_the_pages_is_left_alone(tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / "site"
    assert edition(folder) == 0
    (folder / "CNAME").symlink_to("nowhere")
    assert edition(folder) == 2
    assert "'CNAME'" in capsys.readouterr().err
    assert (folder / "CNAME").is_symlink()


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("where", [".", ".."])
def test_the_folder_that_one_is_in_stays(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert edition(where) == 2
    assert f"'{where}'" in capsys.readouterr().err


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("broken", ["write_bytes", "rename"])
def test_what_fails_leaves_all_as_it_was(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    folder = tmp_path / "site"
    assert edition(folder) == 0
    (folder / "index.html").write_bytes(b"of before")
    before = files(folder)
    calls = []

    def full(*arguments: Any) -> None:
        calls.append(arguments)
        if len(calls) == 2:
            raise OSError(28, "No space left on device")
        real(*arguments)

    target: Any = Path if broken == "write_bytes" else os
    real = getattr(target, broken)
    monkeypatch.setattr(target, broken, full)
    assert edition(folder) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert files(folder) == before
    assert [each.name for each in tmp_path.iterdir()] == ["site"]


def test_without_the_documents_it_says_where_they_are(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An installed package has no documents, and the files beside it belong to other packages."""
    checkout = shipped("docs").parent
    monkeypatch.setattr("pyharness.edition.documents.shipped", lambda _: tmp_path)
    monkeypatch.chdir(tmp_path)
    assert edition(tmp_path / "site") == 2
    assert "--docs" in capsys.readouterr().err
    assert not (tmp_path / "site").exists()
    monkeypatch.chdir(checkout)
    assert documents_folder() == Path("docs")


@pytest.mark.parametrize("name", LIBRARIES)
def test_what_writes_pages_may_be_missing(tmp_path: Path, name: str) -> None:
    """In a process of its own, because modules that are imported twice are not the same."""
    words = ["edition", "--out", str(tmp_path / "site")]
    code = f"import sys; sys.modules[{name!r}] = None; from pyharness.cli.main import main; "
    command = [sys.executable, "-c", f"{code}sys.exit(main({words}))"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    # Without markupsafe jinja2 can't be imported.
    assert {"markupsafe": "jinja2"}.get(name, name) in done.stderr


def test_the_report_counts_files_by_kind(built_site: Mapping[str, bytes]) -> None:
    from pyharness.edition.report import edition_report
    from pyharness.views.render import render

    text = render(edition_report("site", built_site), "table")
    (html,) = (line.split() for line in text.splitlines() if line.startswith("html"))
    pages = [each for name, each in built_site.items() if name.endswith(".html")]
    assert html == ["html", str(len(pages)), f"{sum(map(len, pages)) / 1000:.0f}"]
    assert text.splitlines()[-3].split()[:2] == ["all", str(len(built_site))]
