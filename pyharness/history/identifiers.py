"""Software Heritage identifiers (SWHIDs) and a digest of the edition.

A SWHID (ISO/IEC 18670) has git's SHA-1 hash of a file or folder, by which the archive Software
Heritage finds copies.
"""

import json
from collections.abc import Callable, Mapping
from functools import cache
from hashlib import sha1, sha256
from typing import Any

from pyharness.model.facts import SHIPPED, facts, facts_folder, shipped
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import PORT, Card, port_file

DATA = "pyharness/data"
"""Path of the edition's data in the source repository."""
TABLES = (*(f"cards/{program}" for program in PROGRAMS), "apparatus")
"""Tables in `data` that make up the edition's text, without the suffix `.toml`."""


def content_identifier(content: bytes) -> str:
    return f"swh:1:cnt:{_hash('blob', content).hex()}"


def directory_identifier(files: Mapping[str, bytes]) -> str:
    """Return the SWHID of a folder that has no links, empty folders or executable files."""
    return f"swh:1:dir:{_tree(files).hex()}"


@cache
def source_files() -> dict[str, bytes]:
    """Return the contents of the edition's data files and the Fortran port, by repository path."""
    folder = facts_folder()
    found = {
        f"{DATA}/{file.relative_to(folder).as_posix()}": file.read_bytes()
        for file in folder.rglob("*")
        if file.is_file() and file.relative_to(folder).parts[0] not in SHIPPED
    }
    for program in PROGRAMS:
        found[f"{PORT}/{port_file(program)}"] = (shipped(PORT) / port_file(program)).read_bytes()
    return dict(sorted(found.items()))


def data_identifier() -> str:
    found, within = source_files(), f"{DATA}/"
    names = [name for name in found if name.startswith(within)]
    return directory_identifier({name.removeprefix(within): found[name] for name in names})


def card_identifier(card: Card) -> str:
    """Return a card's SWHID: its deck's file, qualified by the card's line."""
    content = source_files()[f"{DATA}/cards/{card.program}.toml"]
    return f"{content_identifier(content)};lines={card_lines(content)[card.number]}"


@cache
def card_lines(content: bytes) -> dict[int, int]:
    """Return the line number (from 1) of each card in a deck's file, by card number."""
    lines = enumerate(content.decode().splitlines(), 1)
    keys = ((line.partition(" = ")[0], number) for number, line in lines)
    return {int(key): number for key, number in keys if key.isdigit()}


def _hash(kind: str, content: bytes) -> bytes:
    # The standard prescribes SHA-1; resistance to attacks does not matter here.
    return sha1(f"{kind} {len(content)}\0".encode() + content, usedforsecurity=False).digest()


def _tree(files: Mapping[str, bytes]) -> bytes:
    folders: dict[str, dict[str, bytes]] = {}
    entries = []
    for path, content in files.items():
        name, slash, rest = path.partition("/")
        if slash:
            folders.setdefault(name, {})[rest] = content
        else:
            entries.append((name, "100644", name, _hash("blob", content)))
    for name, within in folders.items():
        # git sorts folders as if their names ended with a slash.
        entries.append((f"{name}/", "40000", name, _tree(within)))
    entries.sort(key=lambda entry: entry[0].encode())
    body = b"".join(f"{mode} {name}\0".encode() + hashed for _, mode, name, hashed in entries)
    return _hash("tree", body)


def text_digest(table: Callable[[str], Mapping[str, Any]] = facts) -> str:
    """Return the edition's digest: 12 hexadecimal digits of the SHA-256 of `TABLES`."""
    told = {name: table(name) for name in TABLES}
    text = json.dumps(told, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:12]
