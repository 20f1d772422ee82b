"""Functions that write output files and folders, each either completely or not at all."""

import json
import os
import shutil
import signal
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from threading import current_thread, main_thread
from typing import Self

from pyharness.model.errors import InputError
from pyharness.model.pipes import read_input, write_waiting
from pyharness.model.schema import check_schema
from pyharness.views.pictures import numbers_beside

_LARGEST_MARK = 1 << 24  # bytes of the file that lists the files written by a verb


def check_writable(path: str, option: str) -> None:
    """Raise InputError if no file can be written at the path `path`.

    The error message names `option`, the option that gave the path. Callers make this check before
    any computation.
    """
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
            # A temporary file is written, because permissions do not show that a file system, such
            # as /proc, accepts no file.
            probe = _File(path)
            try:
                probe.write(b"")
            finally:
                _remove([probe.new])
            return
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
    raise InputError(f"{option} '{path}': {reason}; give a file in a folder that can be written")


def check_apart(picture: str, out: str) -> None:
    """Raise InputError if the file of --out is also a file that --plot writes.

    `picture` is the path in --plot; the option also writes a CSV file in the same folder. `out` is
    the path in --out.
    """
    for path, what in ((picture, "the picture"), (numbers_beside(picture), "its numbers")):
        if os.path.realpath(path) == os.path.realpath(out):
            raise InputError(
                f"--out '{out}': --plot '{picture}' writes {what} to this file; give another name"
            )


def write_files(contents: dict[str, bytes], option: str) -> None:
    """Write several files, either all or none.

    `contents` has the content of each file by its path. The files are first written under temporary
    names, and then all are renamed. After any failure or interrupt, Ctrl-C included, the previous
    files are restored. A path that is a special file (a device, a pipe) is written to before the
    other files, and is never replaced. Raise InputError, which names `option`, the option that gave
    the paths, if a file can't be written.
    """
    path = ""
    try:
        for path, content in contents.items():
            if _is_special(path):
                write_waiting(path, content)
        with _DeferredInterrupt() as patience:
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
                    file.place()
            except BaseException:
                for file in files:
                    file.undo()
                raise
            finally:
                _remove([name for file in files for name in (file.new, file.old)])
    except OSError as error:
        raise InputError(f"{option} '{path}': {error.strerror or error}") from None


class _DeferredInterrupt:
    """A context manager that defers Ctrl-C, which could otherwise leave temporary files behind."""

    def __enter__(self) -> Self:
        """Install a signal handler that only records an interrupt by Ctrl-C."""
        self._came = False
        self._before = signal.getsignal(signal.SIGINT)
        # Python raises KeyboardInterrupt in the main thread alone.
        self._holds = callable(self._before) and current_thread() is main_thread()
        if self._holds:
            signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the previous signal handler, and call it if Ctrl-C was pressed in between."""
        if self._holds:
            signal.signal(signal.SIGINT, self._before)
        if self._came and callable(self._before):
            self._before(signal.SIGINT, None)

    def check(self) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed since the context was entered."""
        if self._came:
            raise KeyboardInterrupt

    def _note(self, *_: object) -> None:
        self._came = True


class _File:
    """A file that is being written to a temporary path and is then renamed.

    `target` is its final path, `new` the temporary path of the new content, and `old` the path of a
    copy of the previous content.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        # A link is followed to its target, as in an ordinary write. The temporary files are in the
        # target's folder, as a rename works only within a file system.
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

    def place(self) -> None:
        os.replace(self.new, self.target)

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
    """Return whether a path exists and is a device, a pipe or a folder, not an ordinary file."""
    return Path(path).exists() and not Path(path).is_file()


def check_folder(path: str, names: Iterable[str], option: str) -> None:
    """Raise InputError if the files `names` can't be written in the folder `path`.

    The folder may be missing if it can be made. The error message names `option`, the option that
    gave the path. Callers make this check before any computation.
    """
    folder = Path(path)
    if not path or "\0" in path or os.path.lexists(folder):
        if not path or "\0" in path or not folder.is_dir():
            raise InputError(f"{option} '{path}': is not a folder; give one, or a new name")
        for name in names:
            check_writable(str(folder / name), option)
    elif reason := _why_not_made(folder):
        raise InputError(
            f"{option} '{path}': can't be made in '{folder.parent}'{reason}; "
            "give a folder, or a new name in a folder that can be written"
        )


def _why_not_made(folder: Path) -> str:
    """Return the reason why a folder can't be made, or an empty text if it can be made.

    The reason begins with a colon. To find the reason, the folder is made and removed again,
    because permissions alone do not show that a name is too long, or that a file system accepts no
    folder.
    """
    if not folder.parent.is_dir():
        return ": there is no such folder"
    try:
        folder.mkdir()
        folder.rmdir()
    except OSError as error:
        return f": {error.strerror or error}"
    return ""


def write_folder(path: str, contents: dict[str, bytes], option: str) -> None:
    """Write files into a folder, either all or none; the folder is made if it is missing.

    `path` is the folder, and `contents` has the content of each file by its name. Raise InputError,
    which names `option`, the option that gave the path, if a file can't be written.
    """
    folder = Path(path)
    files = {str(folder / name): content for name, content in contents.items()}
    with _DeferredInterrupt():
        made = not folder.is_dir()
        try:
            if made:
                folder.mkdir()
            write_files(files, option)
        except BaseException as error:
            if made and folder.is_dir():
                folder.rmdir()
            if isinstance(error, OSError):
                raise InputError(f"{option} '{path}': {error.strerror or error}") from None
            raise


def check_tree(path: str, mark: str, option: str) -> None:
    """Raise InputError if `write_tree` may not replace the folder `path`.

    The folder may be new or empty. Otherwise it may contain only a JSON file with the name `mark`,
    and the files that this JSON file lists under the key `files`. The error message names `option`,
    the option that gave the path. Callers make this check before any computation.
    """
    check_folder(path, (), option)
    folder = Path(os.path.realpath(path))
    new, _ = _beside(folder)
    try:
        reason = _why_not_anew(folder, mark)
        # A temporary folder is made, because permissions do not show that a name is too long, or
        # that the file system accepts no file.
        if not reason:
            new.mkdir()
            try:
                (new / mark).touch()
            finally:
                shutil.rmtree(new, ignore_errors=True)
    except OSError as error:
        reason = error.strerror or str(error)
    if reason:
        raise InputError(f"{option} '{path}': {reason.removeprefix(': ')}; give a new name")


def _why_not_anew(folder: Path, mark: str) -> str:
    """Return the reason why a folder may not be replaced, or an empty text if it may be.

    A folder may not be replaced if, for example, it has a file that no earlier run of the command
    wrote. `mark` is the name of the JSON file that lists the files which an earlier run wrote.
    """
    if Path.cwd().is_relative_to(folder):
        return "is the folder that you are in, or one above it"
    if not os.access(folder.parent, os.W_OK) or os.path.ismount(folder):
        return f"can't be made anew in '{folder.parent}'"
    listed = {mark, *_listed(folder / mark)}
    for file in sorted(folder.rglob("*")):
        name = file.relative_to(folder).as_posix()
        if name not in listed and (file.is_symlink() or not file.is_dir()):
            return f"holds '{name}', which was not made by this verb"
    return ""


def _listed(mark: Path) -> Iterable[str]:
    try:
        described = json.loads(read_input(mark, "--out", _LARGEST_MARK, "a list of files"))
        files = described["files"]
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return ()
    if not isinstance(files, dict):
        return ()
    check_schema(f"'{mark}'", "edition", described.get("schema"), "give a new name")
    return files


def _beside(folder: Path) -> tuple[Path, Path]:
    """Return two temporary paths for the time when the folder `folder` is replaced.

    The first path is for the folder with the new content, the second path for the folder with the
    previous content. Both are in the parent folder of `folder`.
    """
    new, old = (folder.with_name(f".{folder.name}.{os.getpid()}.{what}") for what in ("new", "old"))
    return new, old


def write_tree(path: str, contents: dict[str, bytes], option: str) -> None:
    """Replace the folder `path` by a folder that has only the files in `contents`.

    `contents` has the content of each file by its path in the folder. The files are written to a
    temporary folder, which is then renamed. The previous folder is removed only after the renaming,
    so that a failure does not change it. Raise InputError, which names `option`, the option that
    gave the path, if a file can't be written.
    """
    folder = Path(os.path.realpath(path))
    new, old = _beside(folder)
    try:
        with _DeferredInterrupt() as patience:
            try:
                for name, content in contents.items():
                    file = new / name
                    file.parent.mkdir(parents=True, exist_ok=True)
                    file.write_bytes(content)
                    patience.check()
                if folder.is_dir():
                    os.rename(folder, old)
                try:
                    os.rename(new, folder)
                except BaseException:
                    if old.is_dir():
                        os.rename(old, folder)
                    raise
            finally:
                shutil.rmtree(new, ignore_errors=True)
            # The previous folder is kept until the new folder has its name.
            shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{option} '{path}': {error.strerror or error}") from None
