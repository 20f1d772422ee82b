"""Where results go: a file is there whole or not at all."""

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from pyharness.errors import InputError
from pyharness.pipes import write_waiting


def check_writable(path: str, option: str) -> None:
    """Refuse a path that can't be written, before anything is computed for it."""
    target = Path(path)
    folder = target.parent
    try:
        if "\0" in path:
            reason = "a path has no null character"
        elif not path:
            reason = "a name is missing"
        elif target.is_dir():
            reason = "is a folder"
        elif not folder.is_dir():
            reason = f"there is no folder '{folder}'"
        elif not os.access(folder, os.W_OK) or (target.exists() and not os.access(target, os.W_OK)):
            reason = "permission denied"
        else:
            return
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
    raise InputError(f"{option} '{path}': {reason}; give a file in a folder that can be written")


def numbers_beside(picture: str) -> str:
    """Return where the numbers of a picture go."""
    return str(Path(picture).with_suffix(".csv"))


def check_apart(picture: str, out: str) -> None:
    """Refuse a result that would overwrite the picture or its numbers."""
    for path, what in ((picture, "the picture"), (numbers_beside(picture), "its numbers")):
        if os.path.realpath(path) == os.path.realpath(out):
            raise InputError(
                f"--out '{out}': there --plot '{picture}' puts {what}; give a file of another name"
            )


def write_files(contents: dict[str, bytes], option: str) -> None:
    """Write all files: each to a temporary name first, then all are renamed.

    What exists and is no ordinary file (a device, a pipe) is written to, never replaced.
    """
    written: list[tuple[str, str]] = []
    try:
        for path, content in contents.items():
            if Path(path).exists() and not Path(path).is_file():
                write_waiting(path, content)
                continue
            handle, temporary = tempfile.mkstemp(dir=Path(path).parent, prefix=".pyharness-")
            written.append((temporary, path))
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            # mkstemp is for the owner alone; a result is an ordinary file.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(temporary, 0o666 & ~mask)
        for temporary, path in written:
            # Through a link to what it names, as an ordinary write would go.
            os.replace(temporary, os.path.realpath(path))
    except OSError as error:
        for temporary, _ in written:
            Path(temporary).unlink(missing_ok=True)
        raise InputError(f"{option} '{next(iter(contents))}': {error.strerror}") from None


def check_folder(path: str, names: Iterable[str], option: str) -> None:
    """Refuse a folder in which `names` can't be written, before anything is computed for it."""
    folder = Path(path)
    if not path or "\0" in path or os.path.lexists(folder):
        if not path or "\0" in path or not folder.is_dir():
            raise InputError(f"{option} '{path}': is not a folder; give one, or a new name")
        for name in names:
            check_writable(str(folder / name), option)
    elif not folder.parent.is_dir() or not os.access(folder.parent, os.W_OK):
        raise InputError(
            f"{option} '{path}': can't be made in '{folder.parent}'; "
            "give a folder, or a new name in a folder that can be written"
        )


def write_folder(path: str, contents: dict[str, bytes], option: str) -> None:
    """Write all files into a folder, which is made if it is missing; all or nothing."""
    folder = Path(path)
    made = not folder.is_dir()
    try:
        if made:
            folder.mkdir()
        write_files({str(folder / name): content for name, content in contents.items()}, option)
    except OSError as error:
        raise InputError(f"{option} '{path}': {error.strerror}") from None
    except InputError:
        if made:
            folder.rmdir()
        raise
