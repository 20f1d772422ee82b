"""Pipes and devices under a file's name: read and written to, but not waited for without end."""

import errno
import os
import select
import stat
import time

PATIENCE = 10.0  # s, until the other end of a pipe must have said or taken something


def read_some(path: str, limit: int) -> bytes:
    """Return what a file holds, `limit` bytes at the most; OSError where no one writes it."""
    # Without O_NONBLOCK, opening a pipe waits for someone who writes.
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        content = b""
        while len(content) < limit:
            if not select.select([handle], [], [], PATIENCE)[0]:
                raise OSError(errno.ETIMEDOUT, f"nothing came within {PATIENCE:g} s")
            piece = os.read(handle, limit - len(content))
            if not piece:
                break
            content += piece
        return content
    finally:
        os.close(handle)


def write_waiting(path: str, content: bytes) -> None:
    """Write to a device, or to a pipe once someone reads from it; OSError where no one does."""
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
