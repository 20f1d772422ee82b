"""Writing of output folders, completely or not at all.

Messages name `option`, by which the user specified the path.
"""

import os
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

from pyharness.model.errors import InputError
from pyharness.model.json_text import parse_json
from pyharness.model.output_files import (
    DeferredInterrupt,
    check_inside,
    check_writable,
    write_files,
)
from pyharness.model.pipes import read_input
from pyharness.model.schema import check_schema

_LARGEST_MARK = 1 << 24  # largest size (bytes) of the file that lists a folder's files


def check_folder(path: str, names: Iterable[str], option: str) -> None:
    """Raise InputError if files `names` cannot be written in folder `path`, which may be new."""
    folder = Path(path)
    if not path or "\0" in path or os.path.lexists(folder):
        if not path or "\0" in path or not folder.is_dir():
            raise InputError(f"{option} '{path}': is not a folder; give one, or a new name")
        names = list(names)
        check_inside(folder, names, option)
        for name in names:
            check_writable(str(folder / name), option)
    elif reason := _why_not_made(folder):
        raise InputError(
            f"{option} '{path}': can't be made in '{folder.parent}'{reason}; "
            "give a folder, or a new name in a folder that can be written"
        )


def _why_not_made(folder: Path) -> str:
    """Return ": " and the reason why a folder cannot be made, or "" if it can."""
    if not folder.parent.is_dir():
        return ": there is no such folder"
    # Try it, because permissions do not show, for example, that a name is too long.
    try:
        folder.mkdir()
        folder.rmdir()
    except OSError as error:
        return f": {error.strerror or error}"
    return ""


def write_folder(path: str, contents: dict[str, bytes], option: str) -> None:
    """Write files, by name, into a folder; on failure write none and raise InputError."""
    folder = Path(path)
    files = {str(folder / name): content for name, content in contents.items()}
    with DeferredInterrupt():
        made = not folder.is_dir()
        try:
            if made:
                folder.mkdir()
            check_inside(folder, contents, option)
            write_files(files, option)
        except BaseException as error:
            if made and folder.is_dir():
                folder.rmdir()
            if isinstance(error, OSError):
                raise InputError(f"{option} '{path}': {error.strerror or error}") from None
            raise


def check_tree(path: str, mark: str, option: str, kind: str = "edition") -> None:
    """Raise InputError if `write_tree` may not replace the folder.

    The folder may contain only the JSON file `mark` and files listed there.
    """
    check_replaceable(path, lambda folder: {mark, *_listed(folder / mark, kind)}, option)


def check_replaceable(path: str, made: Callable[[Path], set[str]], option: str) -> None:
    """Raise InputError if `write_tree` may not replace the folder.

    The folder may contain only the files named by ``made(folder)``.
    """
    check_folder(path, (), option)
    folder = Path(os.path.realpath(path))
    new, _ = _beside(folder)
    try:
        reason = _why_not_anew(folder, made)
        if not reason:
            new.mkdir()
            try:
                (new / "probe").touch()
            finally:
                shutil.rmtree(new, ignore_errors=True)
    except OSError as error:
        reason = error.strerror or str(error)
    if reason:
        raise InputError(f"{option} '{path}': {reason.removeprefix(': ')}; give a new name")


def _why_not_anew(folder: Path, made: Callable[[Path], set[str]]) -> str:
    if Path.cwd().is_relative_to(folder):
        return "is the folder that you are in, or one above it"
    if not os.access(folder.parent, os.W_OK) or os.path.ismount(folder):
        return f"can't be made anew in '{folder.parent}'"
    listed = made(folder)
    for file in sorted(folder.rglob("*")):
        name = file.relative_to(folder).as_posix()
        if name not in listed and (file.is_symlink() or not file.is_dir()):
            return f"holds '{name}', which was not made by this verb"
    return ""


def _listed(mark: Path, kind: str) -> Iterable[str]:
    try:
        described = parse_json(read_input(mark, "--out", _LARGEST_MARK, "a list of files"))
        files = described["files"]
    except (OSError, ValueError, TypeError, KeyError):
        return ()
    if not isinstance(files, dict):
        return ()
    check_schema(f"'{mark}'", kind, described.get("schema"), "give a new name")
    return files


def _beside(folder: Path) -> tuple[Path, Path]:
    # An earlier process with the same number may have left its folders.
    beside = folder.parent / f".pyharness-{os.urandom(8).hex()}"
    return Path(f"{beside}-new"), Path(f"{beside}-old")


def write_tree(path: str, contents: dict[str, bytes], option: str) -> None:
    """Replace a folder by one that has only the files in `contents`, by path.

    On failure the old folder remains.
    """
    folder = Path(os.path.realpath(path))
    new, old = _beside(folder)
    try:
        with DeferredInterrupt() as patience:
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
            shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{option} '{path}': {error.strerror or error}") from None
