"""Folders made by someone else, with links in them: nothing outside is written or removed."""

import json
import os
import shutil
from functools import partial
from pathlib import Path

import pytest

from pyharness import InputError
from pyharness.checks import golden
from pyharness.cli import output
from pyharness.edition.report import MARK
from pyharness.model.output_files import check_inside
from tests.refused import refused

NEW = {"a": b"new a", "b": b"new b"}


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """Return a file and a folder beside the foreign folder, `foreign`."""
    (tmp_path / "foreign").mkdir()
    folder = tmp_path / "outside"
    folder.mkdir()
    (folder / "mine").write_bytes(b"mine")
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


# The targets of links, by path in the foreign folder.
LINKS: dict[str, dict[str, str]] = {
    "file": {"b": "/mine"}, "relative": {"b": "../outside/mine"}, "dangling": {"b": "/none"},
    "twice": {"b": "second", "second": "/mine"}, "through a folder": {"b": "sub/mine", "sub": "/"},
    "folder": {"b": "/"}, "loop": {"b": "b"},
}  # fmt: skip


def link(foreign: Path, outside: Path, kind: str) -> None:
    for name, target in LINKS[kind].items():
        (foreign / name).symlink_to(f"{outside}{target}" if target[0] == "/" else target)


@pytest.mark.parametrize("kind", [kind for kind in LINKS if kind != "loop"])
def test_files_in_a_folder_are_not_written_elsewhere(
    kind: str, outside: Path, tmp_path: Path
) -> None:
    foreign = tmp_path / "foreign"
    link(foreign, outside, kind)
    refused = partial(pytest.raises, InputError, match=f"^--out '{foreign}': 'b' leads out of it, ")
    with refused():
        output.check_folder(str(foreign), iter(NEW), "--out")
    with refused():
        output.write_folder(str(foreign), NEW, "--out")
    assert contents(outside) == {"mine": b"mine"}
    assert not (foreign / "a").exists()


def test_files_that_are_linked_within_the_folder_are_written(outside: Path, tmp_path: Path) -> None:
    foreign = tmp_path / "foreign"
    (foreign / "a").symlink_to("target")
    os.link(outside / "mine", foreign / "b")
    (tmp_path / "link").symlink_to(foreign)
    output.check_folder(str(tmp_path / "link"), NEW, "--out")
    output.write_folder(str(tmp_path / "link"), NEW, "--out")
    assert contents(foreign) == {**NEW, "target": NEW["a"]}
    assert contents(outside) == {"mine": b"mine"}


@pytest.mark.parametrize("name", ["../outside/mine", "sub/../../outside/none", "/etc/hosts", ".."])
def test_paths_that_lead_out_of_a_folder_are_refused(name: str, tmp_path: Path) -> None:
    check_inside(tmp_path, ["a", "sub/a", "sub/../a", "."], "--out")
    refused("leads out of it", check_inside, tmp_path / "foreign", ["a", name], "--out")


def test_a_neighbour_whose_name_begins_alike_is_outside(outside: Path, tmp_path: Path) -> None:
    (tmp_path / "foreign" / "a").symlink_to(tmp_path / "foreign-too")
    refused("leads out of it", check_inside, tmp_path / "foreign", ["a"], "--out")


@pytest.mark.parametrize("kind", [*LINKS, "hard"])
def test_a_tree_that_is_made_anew_removes_links_alone(
    kind: str, outside: Path, tmp_path: Path
) -> None:
    """A foreign list of files may name links, and paths outside."""
    foreign = tmp_path / "foreign"
    if kind == "hard":
        os.link(outside / "mine", foreign / "b")
    else:
        link(foreign, outside, kind)
    listed = ["b", "second", "sub", "b/mine", "sub/mine", "../outside/mine", str(outside / "mine")]
    (foreign / MARK).write_text(json.dumps({"schema": 1, "files": dict.fromkeys(listed, 1)}))
    output.check_tree(str(foreign), MARK, "--out")
    output.write_tree(str(foreign), NEW, "--out")
    assert contents(foreign) == NEW
    assert contents(outside) == {"mine": b"mine"}
    assert {path.name for path in tmp_path.iterdir()} == {"foreign", "outside"}


def test_a_golden_record_that_is_made_anew_removes_links_alone(
    outside: Path, tmp_path: Path
) -> None:
    foreign = tmp_path / "foreign"
    (outside / "mine").write_text("# Written by: python -m pyharness verify --update\n")
    before = contents(outside)
    (foreign / "taylor.toml").symlink_to(outside / "mine")
    output.check_replaceable(str(foreign), golden.files_made, "--record")
    output.write_tree(str(foreign), {"taylor.toml": b"new"}, "--record")
    assert contents(foreign) == {"taylor.toml": b"new"}
    assert contents(outside) == before


def test_folders_that_a_killed_process_left_do_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a container, all processes may have the same number."""
    site = tmp_path / "site"
    with monkeypatch.context() as patched:
        patched.setattr(shutil, "rmtree", lambda *_, **__: None)
        output.write_tree(str(site), NEW, "--out")
        output.write_tree(str(site), NEW, "--out")
    left = set(tmp_path.iterdir()) - {site}
    assert left
    output.check_replaceable(str(site), lambda _: {*NEW}, "--out")
    output.write_tree(str(site), {"a": b"newer"}, "--out")
    assert contents(site) == {"a": b"newer"}
    assert set(tmp_path.iterdir()) - {site} == left
