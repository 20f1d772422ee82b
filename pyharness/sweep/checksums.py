"""Checksums of the files of a sweep's store, which detect damaged and exchanged files.

`sha256sum --check` reads a file of checksums. Its first line names the version of pyharness, the
sweep and the part of the store, so that an exchanged file fails; the others have SHA-256 and path.
In this module, `folder` is the store's, and `name` a path in it.
"""

import contextlib
import errno
import hashlib
import os
import shutil
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

_PIECE = 1 << 20  # bytes read at once


class DamageError(Exception):
    """A file of a store is damaged; the message names the file and the damage."""


class Label(NamedTuple):
    """The identity of a store."""

    schema: object  # number of the store's format; an integer if pyharness wrote the store
    version: str  # of pyharness
    fingerprint: str  # SHA-256 of the sweep


def checksum_text(label: Label, part: str, folder: Path, names: Sequence[str], limit: int) -> bytes:
    """Return the content of a file of checksums of existing files.

    `part` is their part of the store, as in "chunk 0/1". Raise DamageError if a file is unreadable,
    not regular, or larger than `limit` (bytes).
    """
    identity = f"schema {label.schema}, version {label.version}, sweep {label.fingerprint}"
    lines = [f"# pyharness sweep store, {identity}, {part}"]
    lines += [f"{_digest(folder, name, limit)}  {name}" for name in names]
    return "\n".join(lines).encode() + b"\n"


def check_files(
    label: Label, part: str, folder: Path, names: Sequence[str], limit: int, checksums: str
) -> None:
    """Raise DamageError if files differ from the checksums in the file `checksums`."""
    found = checksum_text(label, part, folder, names, limit)
    known = read_bounded(folder, checksums, 2 * len(found))
    if known != found:
        lines = known.split(b"\n")
        for name, line in zip(names, found.split(b"\n")[1:], strict=False):
            if line not in lines and any(each.endswith(b"  " + name.encode()) for each in lines):
                raise DamageError(f"'{name}' differs from its checksum")
        raise DamageError(f"'{checksums}' is not what was written for these files")


def read_bounded(folder: Path, name: str, limit: int) -> bytes:
    """Return a file's content; raise DamageError if it is missing, large or not regular."""
    with _opened(folder, name, limit) as handle, open(handle, "rb", closefd=False) as file:
        return file.read(limit)


def _digest(folder: Path, name: str, limit: int) -> str:
    digest = hashlib.sha256()
    with _opened(folder, name, limit) as handle:
        # The end of a file that grows might never be reached.
        for _ in range(limit // _PIECE + 2):
            digest.update(os.read(handle, _PIECE))
    return digest.hexdigest()


@contextlib.contextmanager
def _opened(folder: Path, name: str, limit: int) -> Iterator[int]:
    """Yield a file's descriptor; raise DamageError if it is missing, large or not regular."""
    handle = None
    try:
        # Without O_NONBLOCK, opening a pipe waits for a writer.
        handle = os.open(folder / name, os.O_RDONLY | os.O_NONBLOCK)
        status = os.fstat(handle)
        if stat.S_ISDIR(status.st_mode):
            raise DamageError(f"'{name}' is a folder")
        if not stat.S_ISREG(status.st_mode):
            raise DamageError(f"'{name}' is no ordinary file")
        if status.st_size > limit:
            raise DamageError(
                f"'{name}' has {status.st_size} bytes, and can't have more than {limit}"
            )
        yield handle
    except FileNotFoundError:
        raise DamageError(f"'{name}' is missing") from None
    except PermissionError:
        raise  # the user can correct the permissions, and the content need not be damaged
    except OSError as error:
        raise DamageError(f"'{name}': {error.strerror or error}") from None
    finally:
        if handle is not None:
            os.close(handle)


def exists(folder: Path, name: str) -> bool:
    """Return whether a path exists, even as a link without target.

    Raise DamageError if the file system can't tell.
    """
    try:
        os.lstat(folder / name)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise DamageError(f"'{name}': {error.strerror or error}") from None
    return True


def clear(folder: Path, name: str) -> None:
    """Remove anything at a path, except a link's target, and any file in place of its parents."""
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


def place_checksums(
    label: Label, part: str, folder: Path, names: Sequence[str], limit: int, checksums: str
) -> None:
    """Write the checksums of files just written; raise OSError if one of them is damaged."""
    try:
        content = checksum_text(label, part, folder, names, limit)
    except DamageError as damage:
        raise OSError(errno.EIO, f"{damage}, though it was written now") from None
    path = folder / checksums
    path.parent.mkdir(parents=True, exist_ok=True)
    # Renaming a temporary file means that the file is never incomplete.
    new = path.with_name(f"{path.name}.{os.urandom(8).hex()}.partial")
    try:
        new.write_bytes(content)
        os.replace(new, path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise
