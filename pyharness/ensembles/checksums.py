"""Checksums of the files of a sweep's store, which detect damaged and exchanged files.

A file of checksums is text that `sha256sum --check` reads. Its first line names the version
of pyharness, the sweep and the part of the store. Each further line has the SHA-256 and the path
of a file in the store. A file that was exchanged with another one, or that belongs to another
store, therefore fails the check.
"""

import errno
import hashlib
import os
import shutil
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

_PIECE = 1 << 20  # bytes read at once


class DamageError(Exception):
    """The error that a file in a sweep's folder of results differs from what was written.

    The message names the file and the damage.
    """


class Label(NamedTuple):
    """The identity of a store, which is the folder with the results of a sweep.

    The identity has the number of the store's format, the version of pyharness that made the store,
    and the SHA-256 of the sweep.
    """

    schema: object  # number of the store's format; an integer if pyharness wrote the store
    version: str  # of pyharness
    fingerprint: str  # SHA-256 of the sweep


def checksum_text(label: Label, part: str, folder: Path, names: Sequence[str], limit: int) -> bytes:
    """Return the content of a file of checksums, computed from the present files of a store.

    A store is the folder with the results of a sweep. The content is text for ``sha256sum
    --check``; its first line states `label` and `part`.

    Parameters
    ----------
    label : Label
        The identity of the store.
    part : str
        The name of the part of the store to which the files belong, as in "chunk 0/1".
    folder : Path
        The folder of the store.
    names : sequence of str
        The paths of the files in the store.
    limit : int
        The largest size that one of the files can have, in bytes.

    Raises
    ------
    DamageError
        If a file can't be read, is not a regular file, or is larger than `limit`.
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
    """Raise DamageError if files of a store differ from the checksums that were recorded for them.

    A store is the folder with the results of a sweep. `checksums` is the path of the file of
    checksums in the store. The other arguments are the same as those of `checksum_text`, which made
    this file: the store's identity, the part of the store, the folder, the paths of the files, and
    their largest size (bytes).
    """
    found = checksum_text(label, part, folder, names, limit)
    known = read_bounded(folder, checksums, 2 * len(found))
    if known != found:
        lines = known.split(b"\n")
        for name, line in zip(names, found.split(b"\n")[1:], strict=False):
            if line not in lines and any(each.endswith(b"  " + name.encode()) for each in lines):
                raise DamageError(f"'{name}' differs from its checksum")
        raise DamageError(f"'{checksums}' is not what was written for these files")


def read_bounded(folder: Path, name: str, limit: int) -> bytes:
    """Return the content of the file `name` in the folder `folder` of a store (a sweep's results).

    Raise DamageError if the file is missing, is not a regular file, or has more than `limit` bytes.
    """
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
            # The loop is limited, because the end of a file that grows might never be reached.
            for _ in range(limit // _PIECE + 2):
                piece = file.read(_PIECE)
                if not piece:
                    break
                digest.update(piece)
    except OSError as error:
        raise DamageError(f"'{name}': {error.strerror or error}") from None
    return digest.hexdigest()


def _opened(folder: Path, name: str, limit: int) -> int:
    """Open the file `name` in a store (the folder of a sweep's results), and return its descriptor.

    The file descriptor is for reading. Raise DamageError if the file is missing, is a folder, a
    device or a pipe, or has more than `limit` bytes.
    """
    try:
        # Without O_NONBLOCK, opening a pipe waits for a writer.
        handle = os.open(folder / name, os.O_RDONLY | os.O_NONBLOCK)
    except FileNotFoundError:
        raise DamageError(f"'{name}' is missing") from None
    except PermissionError:
        raise  # the user can correct the permissions, and the content need not be damaged
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
    """Return whether the path `name` exists in `folder`, the folder of a sweep's results.

    A link without a target counts as existing. Raise DamageError if an error of the file system
    prevents the test.
    """
    try:
        os.lstat(folder / name)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise DamageError(f"'{name}': {error.strerror or error}") from None
    return True


def clear(folder: Path, name: str) -> None:
    """Remove any file or folder at the path `name` in `folder`, so that a file can be written.

    `folder` is the folder of a sweep's results. If a file is in the place of one of the parent
    folders of `name`, this file is removed too. If a link is at the path, the link is removed, but
    not its target.
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


def place_checksums(
    label: Label, part: str, folder: Path, names: Sequence[str], limit: int, checksums: str
) -> None:
    """Write the file `checksums`, for files of a store that were written just now.

    The arguments are those of `check_files`. Raise OSError if one of the files is damaged.
    """
    try:
        content = checksum_text(label, part, folder, names, limit)
    except DamageError as damage:
        raise OSError(errno.EIO, f"{damage}, though it was written now") from None
    _place(folder, checksums, content)


def _place(folder: Path, name: str, content: bytes) -> None:
    """Write `content` to the file `name` in `folder`, so that the file is never incomplete.

    `folder` is the folder of a sweep's results. The content is written to a temporary file, which
    is then renamed.
    """
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f"{path.name}.{os.urandom(8).hex()}.partial")
    try:
        new.write_bytes(content)
        os.replace(new, path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise
