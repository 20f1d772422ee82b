"""Checksums of a store: the SHA-256 of each file, bound to its place, its sweep and its version.

A file of checksums is text as `sha256sum --check` reads it. Its first line names the sweep and what
the file is about, and each further line has the path of a file in the store. So a file that was
exchanged with another one, or that belongs to another store, does not have its checksum.
"""

import hashlib
import os
import shutil
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

_PIECE = 1 << 20  # bytes read at once


class DamageError(Exception):
    """A file of a store is not as it was written; its text says which file, and what is wrong."""


class Label(NamedTuple):
    """The identity of a store: its schema, the version of pyharness, the SHA-256 of its sweep."""

    schema: object  # a whole number, where it is a store that pyharness wrote
    version: str
    fingerprint: str


def checksum_text(label: Label, part: str, folder: Path, names: Sequence[str], limit: int) -> bytes:
    """Return the checksums of files of a store as they are now.

    Parameters
    ----------
    label : Label
        The identity of the store.
    part : str
        What the files are together, as in "chunk 0/1".
    folder : Path
        The store.
    names : sequence of str
        The paths of the files in it.
    limit : int
        The most bytes that one of them can have.

    Raises
    ------
    DamageError
        Where a file can't be read, is no ordinary file, or is larger than `limit`.
    """
    lines = [
        f"# pyharness sweep store, schema {label.schema}, version {label.version}, "
        f"sweep {label.fingerprint}, {part}"
    ]
    lines += [f"{_digest(folder, name, limit)}  {name}" for name in names]
    return "\n".join(lines).encode() + b"\n"


def check_files(
    label: Label, part: str, folder: Path, names: Sequence[str], limit: int, checksums: str
) -> None:
    """Check files of a store against the file `checksums` in it; DamageError where they differ."""
    found = checksum_text(label, part, folder, names, limit)
    known = read_bounded(folder, checksums, 2 * len(found))
    if known != found:
        lines = known.split(b"\n")
        for name, line in zip(names, found.split(b"\n")[1:], strict=False):
            if line not in lines and any(each.endswith(b"  " + name.encode()) for each in lines):
                raise DamageError(f"'{name}' differs from its checksum")
        raise DamageError(f"'{checksums}' is not what was written for these files")


def read_bounded(folder: Path, name: str, limit: int) -> bytes:
    """Return the content of a file of a store, which has `limit` bytes at the most."""
    handle = _opened(folder, name, limit)
    try:
        with open(handle, "rb") as file:
            return file.read(limit)
    except OSError as error:
        raise DamageError(f"'{name}': {error.strerror or error}") from None


def _digest(folder: Path, name: str, limit: int) -> str:
    digest = hashlib.sha256()
    try:
        with open(_opened(folder, name, limit), "rb", buffering=0) as file:
            # A file that grows meanwhile has no end to wait for.
            for _ in range(limit // _PIECE + 2):
                piece = file.read(_PIECE)
                if not piece:
                    break
                digest.update(piece)
    except OSError as error:
        raise DamageError(f"'{name}': {error.strerror or error}") from None
    return digest.hexdigest()


def _opened(folder: Path, name: str, limit: int) -> int:
    """Open an ordinary file; DamageError for a folder, a device, a pipe, or one too large."""
    try:
        # Without O_NONBLOCK, opening a pipe waits for someone who writes.
        handle = os.open(folder / name, os.O_RDONLY | os.O_NONBLOCK)
    except FileNotFoundError:
        raise DamageError(f"'{name}' is missing") from None
    except PermissionError:
        raise  # the user's to mend: nothing says that the content is wrong
    except OSError as error:
        raise DamageError(f"'{name}': {error.strerror or error}") from None
    status = os.fstat(handle)
    reason = ""
    if stat.S_ISDIR(status.st_mode):
        reason = "is a folder"
    elif not stat.S_ISREG(status.st_mode):
        reason = "is no ordinary file"
    elif status.st_size > limit:
        reason = f"has {status.st_size} bytes, and can't have more than {limit}"
    if reason:
        os.close(handle)
        raise DamageError(f"'{name}' {reason}")
    return handle


def exists(folder: Path, name: str) -> bool:
    """Return whether there is anything by a name; DamageError where that can't be said."""
    try:
        os.lstat(folder / name)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise DamageError(f"'{name}': {error.strerror or error}") from None
    return True


def clear(folder: Path, name: str) -> None:
    """Remove whatever stands in a file's place, and in the place of the folders it is in.

    A link is removed, and what it names stays.
    """
    path = folder
    for part in Path(name).parts[:-1]:
        path /= part
        if os.path.lexists(path) and not path.is_dir():
            path.unlink()
    path = folder / name
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def place(folder: Path, name: str, content: bytes) -> None:
    """Write a file of a store: it is there whole or not at all."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f"{path.name}.{os.urandom(8).hex()}.partial")
    try:
        new.write_bytes(content)
        os.replace(new, path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise
