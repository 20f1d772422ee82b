"""Reading and writing of pipes, devices and files, with limited waiting."""

import errno
import os
import select
import stat
import time

from pyharness.model.errors import InputError

PATIENCE = 10.0  # s, the longest wait for the other end of a pipe
_PIECE = 1 << 20


def read_input(path: str | os.PathLike[str], where: str, limit: int, what: str) -> bytes:
    """Return a file's or pipe's content; raise InputError if unreadable or above `limit` bytes."""
    try:
        content = _read(os.fspath(path), limit)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{where}: {reason}; give {what} that can be read") from None
    if content is None:
        raise InputError(f"{where}: larger than {limit} bytes; give {what} of at most that size")
    return content


def _read(path: str, limit: int) -> bytes | None:
    # Without O_NONBLOCK, opening a pipe waits for a writer.
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        status = os.fstat(handle)
        mode = status.st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, "Is a directory")
        if stat.S_ISBLK(mode) or (stat.S_ISCHR(mode) and not _is_quiet(handle)):
            raise OSError(errno.EINVAL, "is a device")
        if stat.S_ISREG(mode) and status.st_size > limit:
            return None
        content = bytearray()
        while len(content) <= limit:
            if not select.select([handle], [], [], PATIENCE)[0]:
                raise OSError(errno.ETIMEDOUT, f"nothing came within {PATIENCE:g} s")
            piece = os.read(handle, min(_PIECE, limit + 1 - len(content)))
            if not piece:
                break
            content += piece
        return bytes(content) if len(content) <= limit else None
    finally:
        os.close(handle)


def _is_quiet(handle: int) -> bool:
    return os.isatty(handle) or os.fstat(handle).st_rdev == os.stat(os.devnull).st_rdev


def write_waiting(path: str, content: bytes) -> None:
    """Write to a device or pipe; raise OSError if a pipe has no reader within 10 s."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            handle = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
            break
        except OSError as error:
            if error.errno != errno.ENXIO or not stat.S_ISFIFO(os.stat(path).st_mode):
                raise
            if time.monotonic() > end:
                raise OSError(errno.ETIMEDOUT, f"no one read it within {PATIENCE:g} s") from None
        time.sleep(0.01)
    os.set_blocking(handle, True)
    with open(handle, "wb") as file:
        file.write(content)
