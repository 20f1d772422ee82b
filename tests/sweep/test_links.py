"""Links in a store, which may come from someone else: nothing outside is written or removed."""

import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from pyharness.model.errors import InputError
from pyharness.sweep import run
from pyharness.sweep.sweep import Sweep
from pyharness.sweep.sweep_file import read_sweep
from tests.conftest import ResultOf
from tests.sweep.sweeps import TILT, axis, files, run_sweep, text

SWEEP = text(
    TILT.replace("6", "4"), axis("t_end", [1.0, 2.0]), top='chunk = 1\nreductions = ["end"]'
)
FOLDERS = ("end", "end/c", "end/c/0", "end/c/0/1", "checksums", "checksums/c", "checksums/c/1",
           "component", "component/c", "tilt/c")  # fmt: skip


@pytest.fixture
def sweep(intact: Path, monkeypatch: pytest.MonkeyPatch) -> Sweep:
    monkeypatch.setattr(run, "forecast", lambda *given: 0.0)
    return read_sweep(intact / "sweep.toml")


def moved(path: Path, outside: Path) -> Path:
    """Replace a file or folder by a link to where it is moved."""
    target = outside / path.name
    shutil.move(path, target)
    path.symlink_to(target)
    return target


@pytest.mark.parametrize("repair", [False, True])
@pytest.mark.parametrize("damage", [
    "changed",
    *(pytest.param(x, marks=pytest.mark.campaign) for x in ("none", "missing", "dangling")),
])  # fmt: skip
@pytest.mark.parametrize("name", FOLDERS)
def test_a_linked_folder_is_refused(
    name: str, damage: str, repair: bool, sweep: Sweep, store: Path, tmp_path: Path
) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    target = moved(store / name, outside)
    (outside / "mine.partial").touch()
    some = min(path for path in target.rglob("*") if path.is_file())
    if damage == "changed":
        some.write_bytes(b"mine")
    elif damage == "missing":
        some.unlink()
    elif damage == "dangling":
        shutil.rmtree(target)
    before = files(outside), files(store)
    with pytest.raises(InputError, match=rf"^--out '{store}': '{name}\S*' leads out of it, to '"):
        run_sweep(sweep, str(store), repair=repair)
    assert (files(outside), files(store)) == before
    assert target.exists() == (damage != "dangling")


@pytest.mark.parametrize("kind", ["hard", "symbolic"])
@pytest.mark.parametrize("name", ["end/c/0/0/0", "end/c/1/1/0", "checksums/c/0/1", "end/zarr.json"])
def test_a_linked_file_is_replaced(
    name: str, kind: str, sweep: Sweep, store: Path, intact: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine"
    mine.write_bytes(b"mine")
    (store / name).unlink()
    if kind == "hard":
        os.link(mine, store / name)
    else:
        (store / name).symlink_to(mine)
    with pytest.raises(InputError, match="damaged"):
        run_sweep(sweep, str(store))
    run_sweep(sweep, str(store), repair=True)
    assert mine.read_bytes() == b"mine"
    assert files(store) == files(intact / "store")
    assert not any(path.is_symlink() for path in store.rglob("*"))


@pytest.mark.parametrize("kind", ["hard", "symbolic"])
def test_a_linked_file_of_an_incomplete_chunk_is_replaced(
    kind: str, sweep: Sweep, store: Path, intact: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine"
    mine.write_bytes((store / "end/c/0/0/0").read_bytes())
    before = mine.read_bytes()
    (store / "checksums/c/0/0").unlink()
    (store / "end/c/0/0/0").unlink()
    make: Callable[[Path, Path], None] = os.link if kind == "hard" else os.symlink
    make(mine, store / "end/c/0/0/0")
    inode = mine.stat().st_ino
    assert run_sweep(sweep, str(store)).computed == 1
    assert (store / "end/c/0/0/0").lstat().st_ino != inode
    assert mine.read_bytes() == before
    assert files(store) == files(intact / "store")


def test_a_link_beside_the_files_of_the_store_is_not_followed(
    sweep: Sweep, store: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "outside" / "mine.partial"
    mine.parent.mkdir()
    mine.touch()
    (store / "more").symlink_to(mine.parent)
    (store / "end" / "more.partial").symlink_to(mine)
    (store / "checksums/c/0/0").write_bytes(b"")
    run_sweep(sweep, str(store), repair=True)
    assert mine.exists()
    assert not (store / "end" / "more.partial").is_symlink()


def test_the_store_itself_may_be_a_link(sweep: Sweep, store: Path, tmp_path: Path) -> None:
    (store / "checksums/c/0/0").unlink()
    (tmp_path / "link").symlink_to(store)
    assert run_sweep(sweep, str(tmp_path / "link")).computed == 1
    (tmp_path / "new").mkdir()
    (tmp_path / "other").symlink_to("new")
    assert run_sweep(sweep, str(tmp_path / "other")).computed == 8
    assert files(tmp_path / "new") == files(store)


def test_the_command_refuses_in_one_line(
    intact: Path, store: Path, tmp_path: Path, result_of: ResultOf
) -> None:
    moved(store / "end/c", tmp_path)
    command = ["sweep", str(intact / "sweep.toml"), "--out", str(store)]
    for more in ([], ["--repair"]):
        assert result_of([*command, *more], 2).err.count("\n") == 1


@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=pytest.mark.campaign if n >= 8 else ()) for n in range(60)]
)
def test_no_link_leads_to_a_change_outside(
    seed: int, sweep: Sweep, store: Path, intact: Path, tmp_path: Path
) -> None:
    """Random links of all kinds, hard ones, loops and links without target among them."""
    draw = random.Random(seed)
    outside = Path(shutil.copytree(intact / "store", tmp_path / "outside"))
    (outside / "mine.partial").write_bytes(b"mine")
    for _ in range(draw.randint(1, 3)):
        path = draw.choice(sorted(store.rglob("*")))
        target = draw.choice([outside, outside / "none", path, *sorted(outside.rglob("*"))])
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
        if target.is_file() and draw.random() < 0.5:
            os.link(target, path)
        else:
            path.symlink_to(os.path.relpath(target, path.parent) if draw.random() < 0.5 else target)
        if outside in target.parents and target.is_file() and draw.random() < 0.5:
            target.write_bytes(b"mine")
    before = files(outside)
    for repair in (False, True):
        try:
            run_sweep(sweep, str(store), repair=repair)
        except InputError as error:
            message = str(error)
        else:
            message = f"--out '{store}': "
            assert files(store) == files(intact / "store")
        assert message.startswith(f"--out '{store}': ")
        assert files(outside) == before
        assert not (outside / "none").exists()
