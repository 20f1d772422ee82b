"""Writing of output files, each completely or not at all."""

import os
import signal
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from threading import current_thread, main_thread
from typing import Self

from pyharness.model.errors import InputError
from pyharness.model.pipes import write_waiting


def check_writable(path: str, option: str) -> None:
    try:
        # A link is followed to its target, as in an ordinary write.
        target = Path(os.path.realpath(path)) if "\0" not in path else Path()
        folder = target.parent
        if "\0" in path:
            reason = "a path has no null character"
        elif not path:
            reason = "a name is missing"
        elif target.is_dir():
            reason = "is a folder"
        elif target.is_symlink():
            reason = "is a link that leads back to itself"
        elif _is_special(path):
            if os.access(path, os.W_OK):
                return
            reason = "permission denied"
        elif not folder.is_dir():
            reason = f"there is no folder '{folder}'"
        elif not os.access(folder, os.W_OK) or (target.exists() and not os.access(target, os.W_OK)):
            reason = "permission denied"
        else:
            # Permissions alone do not show that /proc, for example, accepts no file.
            probe = _File(path)
            try:
                probe.write(b"")
            finally:
                _remove([probe.new])
            return
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
    raise InputError(f"{option} '{path}': {reason}; give a file in a folder that can be written")


def check_inside(folder: str | Path, names: Iterable[str], option: str) -> None:
    """Raise InputError if a path of `names` in `folder` leads out of it, through links or ``..``.

    The folder may come from someone else.
    """
    root = os.path.realpath(folder)
    for name in names:
        path = os.path.realpath(os.path.join(root, name))
        if os.path.commonpath([root, path]) != root:
            raise InputError(
                f"{option} '{folder}': '{name}' leads out of it, to '{path}'; remove this link, or "
                "give another folder"
            )


def write_files(contents: dict[str, bytes], option: str) -> None:
    """Write all files or, after a failure or Ctrl-C, none.

    A failure raises InputError, which names `option`.
    """
    path = ""
    try:
        for path, content in contents.items():
            # Written first, because devices and pipes cannot be restored.
            if _is_special(path):
                write_waiting(path, content)
        with DeferredInterrupt() as patience:
            files = [_File(path) for path in contents if not _is_special(path)]
            try:
                for file in files:
                    path = file.path
                    file.write(contents[path])
                    patience.check()
                # A single rename is atomic and needs no copy of the old file.
                for file in files if len(files) > 1 else ():
                    path = file.path
                    file.keep()
                for file in files:
                    path = file.path
                    os.replace(file.new, file.target)
            except BaseException:
                for file in files:
                    file.undo()
                raise
            finally:
                _remove([name for file in files for name in (file.new, file.old)])
    except OSError as error:
        raise InputError(f"{option} '{path}': {error.strerror or error}") from None


class DeferredInterrupt:
    """A context manager that defers Ctrl-C, so that no temporary files remain."""

    def __enter__(self) -> Self:
        self._came = False
        self._before = signal.getsignal(signal.SIGINT)
        # Python raises KeyboardInterrupt only in the main thread.
        self._holds = callable(self._before) and current_thread() is main_thread()
        if self._holds:
            signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        if self._holds:
            signal.signal(signal.SIGINT, self._before)
        if self._came and callable(self._before):
            self._before(signal.SIGINT, None)

    def check(self) -> None:
        if self._came:
            raise KeyboardInterrupt

    def _note(self, *_: object) -> None:
        self._came = True


class _File:
    def __init__(self, path: str) -> None:
        self.path = path
        # Temporary files are in the target's folder, because a rename works only within a file
        # system.
        self.target = os.path.realpath(path)
        beside = os.path.join(os.path.dirname(self.target), f".pyharness-{os.urandom(8).hex()}")
        self.new, self.old = f"{beside}-new", f"{beside}-old"
        self.written = False
        self.existed = os.path.lexists(self.target)

    def write(self, content: bytes) -> None:
        with open(self.new, "xb") as file:
            file.write(content)
        self.written = True

    def keep(self) -> None:
        if self.existed:
            try:
                os.link(self.target, self.old)
            except OSError:  # a file system without links
                import shutil

                shutil.copy2(self.target, self.old)

    def undo(self) -> None:
        if not self.written or os.path.lexists(self.new):
            return
        if os.path.lexists(self.old):
            try:
                os.replace(self.old, self.target)
            except OSError:
                self.old = self.new  # keep the copy rather than lose the old content
        elif not self.existed:
            _remove([self.target])


def _remove(names: list[str]) -> None:
    for name in names:
        with suppress(OSError):
            os.unlink(name)


def _is_special(path: str) -> bool:
    return Path(path).exists() and not Path(path).is_file()
