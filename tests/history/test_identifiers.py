"""Software Heritage identifiers: known values, agreement with git, and the lines of cards."""

import os
import random
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from pyharness.history import identifiers
from pyharness.history.identifiers import DATA, content_identifier, directory_identifier
from pyharness.model import facts as tables
from pyharness.model.facts import SHIPPED
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import deck
from tests.test_packaging import ROOT

EMPTY = "e69de29bb2d1d6434b8b29ae775ad8c2e48c5391"


def _git(folder: Path, *arguments: str, content: bytes = b"") -> str:
    if shutil.which("git") is None:
        pytest.skip("no git here")
    # Settings of the user, such as the conversion of line ends, have no effect.
    environment = {
        **os.environ, "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull,
        "GIT_CONFIG_COUNT": "1", "GIT_CONFIG_KEY_0": "safe.directory", "GIT_CONFIG_VALUE_0": "*",
        "GIT_CEILING_DIRECTORIES": str(folder.parent),
    }  # fmt: skip
    for name in ("GIT_DIR", "GIT_INDEX_FILE"):
        environment.pop(name, None)
    done = subprocess.run(
        ["git", *arguments],
        cwd=folder, env=environment, input=content, capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout.decode().strip()


def test_known_identifiers() -> None:
    assert content_identifier(b"") == f"swh:1:cnt:{EMPTY}"
    assert content_identifier(b"hello\n") == "swh:1:cnt:ce013625030ba8dba906f756967f9e9ca394464a"
    assert directory_identifier({}) == "swh:1:dir:4b825dc642cb6eb9a060e54bf8d69288fbee4904"
    # A folder with one empty file, from the documentation of git.
    assert directory_identifier({"a": b""}) == "swh:1:dir:496d6428b9cf92981dc9495211e6e1120fb6f2ba"


@pytest.mark.external
@pytest.mark.parametrize("content", [b"", b"\0\r\n\xff", "ω\n".encode(), bytes(range(256)) * 300])
def test_git_has_the_same_identifier_of_a_file(tmp_path: Path, content: bytes) -> None:
    found = _git(tmp_path, "hash-object", "--stdin", content=content)
    assert content_identifier(content) == f"swh:1:cnt:{found}"


@pytest.mark.external
@pytest.mark.parametrize("seed", range(5))
def test_git_has_the_same_identifier_of_a_folder(tmp_path: Path, seed: int) -> None:
    """Random names include those whose order depends on whether they name a folder."""
    draw = random.Random(seed)
    files: dict[str, bytes] = {"a.b/x": b"1", "a-b": b"2", "a/b/c": b"3", "a0": b"4", "ü": b"5"}
    for _ in range(20):
        parts = ["".join(draw.choices("ab.-0_é", k=draw.randint(1, 3))) for _ in range(3)]
        path = "/".join(parts[: draw.randint(1, 3)])
        others = (f"{name}/" for name in files)
        clash = any(f"{path}/".startswith(each) or each.startswith(f"{path}/") for each in others)
        if not clash and not {".", ".."} & set(parts):
            files[path] = draw.randbytes(draw.randint(0, 40))
    _git(tmp_path, "init", "--quiet")
    for path, content in files.items():
        file = tmp_path / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
        file.chmod(0o644)
    _git(tmp_path, "add", "--all", "--force")
    assert directory_identifier(files) == f"swh:1:dir:{_git(tmp_path, 'write-tree')}"


@pytest.mark.external
def test_git_has_the_same_identifiers_of_the_data_and_the_port() -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("not a clone")
    if _git(ROOT, "status", "--porcelain", "--", DATA):
        pytest.skip("the data differ from those of the last commit")
    assert identifiers.data_identifier() == f"swh:1:dir:{_git(ROOT, 'rev-parse', f'HEAD:{DATA}')}"
    for path, content in identifiers.source_files().items():
        assert content_identifier(content) == f"swh:1:cnt:{_git(ROOT, 'hash-object', path)}"


def test_an_installation_has_the_same_ids(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of the data of an installed package has more files, and those of the port."""
    before = identifiers.data_identifier(), [*identifiers.source_files().items()]
    folder = Path(shutil.copytree(ROOT / DATA, tmp_path / "data"))
    shutil.copytree(ROOT / "fortran/original", folder / "fortran/original")
    for name in SHIPPED:
        if (ROOT / name).is_file():
            shutil.copy(ROOT / name, folder)
    (folder / "web").mkdir()
    (folder / "web/page.js").write_text("0;")
    monkeypatch.setattr(tables, "_FOLDER", folder)
    identifiers.source_files.cache_clear()
    try:
        assert (identifiers.data_identifier(), [*identifiers.source_files().items()]) == before
    finally:
        identifiers.source_files.cache_clear()


@pytest.mark.parametrize("program", PROGRAMS)
def test_identifier_of_a_card_leads_to_its_line(program: str) -> None:
    path = ROOT / DATA / f"cards/{program}.toml"
    lines = path.read_text().splitlines()
    found = deck(program)
    assert list(identifiers.card_lines(path.read_bytes())) == list(found.cards)
    for number, card in found.cards.items():
        identifier, _, line = identifiers.card_identifier(card).partition(";lines=")
        assert identifier == content_identifier(path.read_bytes())
        assert tomllib.loads(lines[int(line) - 1])[str(number)]["text"] == card.text
