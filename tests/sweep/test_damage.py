"""A damaged store is reported in one line, and a repair restores the same bytes."""

import itertools
import json
import os
import random
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from pyharness.model.errors import InputError
from pyharness.model.schema import SCHEMAS
from pyharness.sweep import run, store_layout
from pyharness.sweep.batches import solve_chunk
from pyharness.sweep.sweep import Sweep
from pyharness.sweep.sweep_file import read_sweep
from tests.conftest import Patch, ResultOf
from tests.refused import refused
from tests.sweep.sweeps import TILT, files, run_sweep, text, written

SWEEP = text(
    TILT.replace("count = 6", "count = 40"),
    '[[axis]]\nfield = "t_end"\nvalues = [1.0, 2.0]',
    top='chunk = 10\nreductions = ["end", "status"]',
)
CHUNK = "status/c/0/0"
OTHER = "status/c/1/0"


@pytest.fixture
def sweep(intact: Path) -> Sweep:
    return read_sweep(intact / "sweep.toml")


def flip(path: Path, at: int = -1, bit: int = 0) -> None:
    content = bytearray(path.read_bytes())
    content[at] ^= 1 << bit
    path.write_bytes(content)


def _letter(path: Path) -> None:
    path.mkdir()
    (path / "letter").write_text("dear")


def replaced(make: Callable[[Path], object]) -> Callable[[Path], None]:
    """Return a damage: something else is made in place of a file."""

    def damage(path: Path) -> None:
        path.unlink()
        make(path)

    return damage


def swap(one: Path, other: Path) -> None:
    contents = one.read_bytes(), other.read_bytes()
    one.write_bytes(contents[1])
    other.write_bytes(contents[0])


DAMAGES: dict[str, Callable[[Path], object]] = {
    "flipped bit": flip,
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "empty": lambda path: path.write_bytes(b""),
    "garbage": lambda path: path.write_bytes(os.urandom(50)),
    "longer": lambda path: path.write_bytes(path.read_bytes() + b"\0"),
    "missing": Path.unlink,
    "folder": replaced(_letter),
    "pipe": replaced(os.mkfifo),
    "/dev/zero": replaced(lambda path: path.symlink_to("/dev/zero")),
    "link to itself": replaced(lambda path: path.symlink_to(path.name)),
    "a terabyte": lambda path: os.truncate(path, 1 << 40),
}


@pytest.mark.campaign
@pytest.mark.parametrize("name", DAMAGES)
def test_damaged_chunk_is_one_line_and_is_repaired(
    name: str, sweep: Sweep, store: Path, intact: Path, monkeypatch: Patch
) -> None:
    DAMAGES[name](store / CHUNK)
    refused(f"^--out '{store}': .*'{CHUNK}'.*--repair", run_sweep, sweep, str(store))
    computed = []

    def solved(sweep: Sweep, chunk: int) -> object:
        computed.append(chunk)
        return solve_chunk(sweep, chunk)

    monkeypatch.setattr(run, "forecast", lambda *given: 0.0)
    monkeypatch.setattr("pyharness.sweep.executors.solve_chunk", solved)
    outcome = run_sweep(sweep, str(store), repair=True)
    assert (computed, outcome.computed, outcome.repaired) == ([0], 1, 1)
    assert files(store) == files(intact / "store")


def test_swapped_chunks_are_seen_with_their_checksums_too(
    sweep: Sweep, store: Path, intact: Path
) -> None:
    swap(store / CHUNK, store / OTHER)
    assert (store / CHUNK).read_bytes() == (intact / "store" / OTHER).read_bytes()
    # Two constant chunks may have the same bytes; chunks of `end` differ.
    for name in ("end/c/{}/0/0", "checksums/c/{}/0"):
        swap(store / name.format(0), store / name.format(1))
    refused(r"2 of 8 .*'checksums/c.*--repair", run_sweep, sweep, str(store))
    assert run_sweep(sweep, str(store), repair=True).repaired == 2
    assert files(store) == files(intact / "store")


def test_chunk_of_another_sweep_is_seen(intact: Path, store: Path, tmp_path: Path) -> None:
    other = read_sweep(written(tmp_path, SWEEP + "\n# another\n"))
    run_sweep(other, str(tmp_path / "other"))
    for name in ("end/c/0/0/0", "status/c/0/0", "checksums/c/0/0"):
        shutil.copy(store / name, tmp_path / "other" / name)
    refused("'checksums/c/0/0'", run_sweep, other, str(tmp_path / "other"))


METADATA = ("zarr.json", "end/zarr.json", "tilt/c/0", "component/c/0", "checksums/metadata")


# The fast third has each file and each damage.
@pytest.mark.parametrize(
    ("file", "name"),
    [
        pytest.param(*pair, marks=pytest.mark.campaign if number % 3 else ())
        for number, pair in enumerate(itertools.product(METADATA, DAMAGES))
    ],
)
def test_damaged_metadata_are_one_line_and_are_repaired(
    name: str, file: str, sweep: Sweep, store: Path, intact: Path
) -> None:
    DAMAGES[name](store / file)
    refused(f"--out '{store}'", run_sweep, sweep, str(store))
    assert run_sweep(sweep, str(store), repair=True).computed == 0
    assert files(store) == files(intact / "store")


def test_another_schema_is_refused_and_stays_as_it_was(
    sweep: Sweep, tmp_path: Path, monkeypatch: Patch
) -> None:
    with monkeypatch.context() as patched:
        patched.setitem(SCHEMAS, "sweep store", 3)
        with store_layout.filled(sweep, tmp_path / "x") as new:
            shutil.copytree(new, tmp_path / "store")
    before = files(tmp_path / "store")
    for repair in (False, True):
        refused("schema 3", run_sweep, sweep, str(tmp_path / "store"), repair=repair)
    assert files(tmp_path / "store") == before


def test_store_of_the_first_schema_is_refused(sweep: Sweep, store: Path) -> None:
    # The first schema had no checksums.
    shutil.rmtree(store / "checksums")
    described = json.loads((store / "zarr.json").read_text())
    described["attributes"]["schema"] = 1
    (store / "zarr.json").write_text(json.dumps(described))
    refused("schema 1", run_sweep, sweep, str(store))


@pytest.mark.campaign
def test_command_line_repairs(store: Path, intact: Path, result_of: ResultOf) -> None:
    command = ["sweep", str(intact / "sweep.toml"), "--out", str(store)]
    flip(store / CHUNK)
    flip(store / OTHER)
    said = result_of(command, 2).err
    assert said.count("\n") == 1
    assert f"'{CHUNK}'" in said
    assert ", 2 of them damaged before, 6 were there" in result_of([*command, "--repair"]).out
    assert "all 8 chunks were there" in result_of(command).out


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="no sha256sum")
def test_checksums_are_those_of_sha256sum(store: Path) -> None:
    given = [str(path) for path in (store / "checksums").rglob("*") if path.name != "zarr.json"]
    command = ["sha256sum", "--check", "--strict", "--quiet"]
    checked = [path for path in given if Path(path).is_file()]
    assert len(checked) == 9
    subprocess.run([*command, *checked], cwd=store, check=True)
    flip(store / CHUNK)
    assert subprocess.run([*command, *checked], cwd=store, check=False).returncode == 1


def _damaged_at_random(store: Path, draw: random.Random) -> str:
    """Damage a store in one random way, and return a description of it."""
    every = sorted(path for path in store.rglob("*") if path.is_file())
    path, other = draw.sample(every, 2)
    while path.read_bytes() == other.read_bytes():
        path, other = draw.sample(every, 2)
    size = path.stat().st_size
    kind = draw.choice([*DAMAGES, "bit", "cut", "zeros", "copy", "swap", "parent", "two"])
    if kind in DAMAGES:
        DAMAGES[kind](path)
    elif kind == "bit":
        flip(path, draw.randrange(size), draw.randrange(8))
    elif kind == "cut":
        path.write_bytes(path.read_bytes()[: draw.randrange(size)])
    elif kind == "zeros":
        path.write_bytes(bytes(size))
    elif kind == "copy":
        shutil.copy(other, path)
    elif kind == "swap":
        swap(path, other)
    elif kind == "parent" and path.parent != store:
        shutil.rmtree(path.parent)
        path.parent.write_text("no folder")
    else:
        flip(path, draw.randrange(size), draw.randrange(8))
        flip(other, 0)
    return f"{kind}: {path.relative_to(store)}, {other.relative_to(store)}"


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(seed, marks=pytest.mark.campaign if seed >= 15 else ())
        for seed in range(int(os.environ.get("PYHARNESS_DAMAGES", "60")))
    ],
)
def test_no_damage_is_believed(
    seed: int, sweep: Sweep, store: Path, intact: Path, monkeypatch: Patch
) -> None:
    monkeypatch.setattr(run, "forecast", lambda *given: 0.0)
    what = _damaged_at_random(store, random.Random(seed))
    try:
        run_sweep(sweep, str(store))
    except InputError as error:
        message = str(error)
    # Chunks are computed again without an error only if their checksums are missing.
    else:
        message = ""
        assert files(store) == files(intact / "store"), what
    if message:
        assert message.startswith(f"--out '{store}': "), what
        assert "damaged" in message, what
    run_sweep(sweep, str(store), repair=True)
    assert files(store) == files(intact / "store"), what
