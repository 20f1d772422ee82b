"""The store of a sweep: a Zarr group with an array for each reduction.

A chunk of the grid has a file for each array, and a file of their checksums. Each file is written
under a temporary name and then renamed, the checksums last.
"""

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pyharness.model.distribution import check_package, install_command
from pyharness.model.errors import InputError
from pyharness.model.output_files import check_inside
from pyharness.model.schema import check_schema
from pyharness.sweep.reductions import REDUCTIONS
from pyharness.sweep.store_layout import (
    CHECKSUMS,
    LARGEST_METADATA,
    METADATA,
    DamageError,
    Label,
    check_files,
    clear,
    exists,
    filled,
    label,
    labels,
    largest_chunk,
    metadata_files,
    place_checksums,
)
from pyharness.sweep.sweep import Arrays, Sweep

_UNFINISHED = "*.partial"  # Zarr's name for a file that is not renamed yet
_SAME_SWEEP = "give another --out, or remove this folder"
_REPAIR = "'pyharness sweep' with --repair"


def check_zarr() -> None:
    check_package("zarr", "sweep", install_command("sweep"))


class Store:
    """The open store of one sweep, made by `opened`.

    `repaired` counts the damaged chunks that `check` removed.
    """

    def __init__(self, sweep: Sweep, folder: Path) -> None:
        import zarr

        self.sweep, self.folder, self.repaired = sweep, folder, 0
        group: Any = zarr.open_group(folder, mode="r+", zarr_format=3, use_consolidated=False)
        # Zarr would otherwise write no file for a chunk that has only the fill value.
        with zarr.config.set({"array.write_empty_chunks": True}):
            self._arrays = {asked.name: group[asked.name] for asked in sweep.reductions}
        self._limit = largest_chunk(sweep)
        self._done = [False] * sweep.n_chunks

    def check(self, repair: bool = False) -> None:
        """Compare all complete chunks with their checksums.

        Raise InputError for a damaged chunk, or with `repair` remove its files.
        """
        chunks = range(self.sweep.n_chunks)
        _check_folders(self.folder, (name for chunk in chunks for name in self._written(chunk)))
        damages = {}
        for chunk in chunks:
            try:
                self._done[chunk] = self._is_done(chunk)
            except DamageError as damage:
                damages[chunk] = str(damage)
        if damages and not repair:
            chunk, reason = next(iter(damages.items()))
            total = self.sweep.n_chunks
            which = f"chunk {chunk + 1} of {total} is damaged"
            if len(damages) > 1:
                which = f"{len(damages)} of {total} chunks are damaged, first chunk {chunk + 1}"
            them = "it" if len(damages) == 1 else "them"
            raise InputError(
                f"--out '{self.folder}': {which}: {reason}; {_REPAIR} computes {them} again"
            )
        for chunk in damages:
            for name in self._written(chunk):
                clear(self.folder, name)
        self.repaired = len(damages)

    def done(self) -> list[bool]:
        return list(self._done)

    def write(self, chunk: int, found: Arrays) -> None:
        """Write a chunk's results and checksums.

        After an OSError the chunk remains incomplete.
        """
        for name, array in self._arrays.items():
            array[self.sweep.box(chunk)] = found[name]
        place_checksums(*self._described(chunk), self._checksums(chunk))
        self._done[chunk] = True

    def read(self, name: str, chunk: int) -> Any:
        return self._arrays[name][self.sweep.box(chunk)]

    def array(self, name: str) -> Any:
        return self._arrays[name]

    def _is_done(self, chunk: int) -> bool:
        checksums = self._checksums(chunk)
        if exists(self.folder, checksums):
            check_files(*self._described(chunk), checksums)
            return True
        # Files of an incomplete chunk will be overwritten, and must therefore be regular.
        for name in self._files(chunk):
            if exists(self.folder, name) and not (self.folder / name).is_file():
                raise DamageError(f"'{name}' is no ordinary file")
        return False

    def _described(self, chunk: int) -> tuple[Label, str, Path, list[str], int]:
        part = f"chunk {'/'.join(map(str, self.sweep.position_of(chunk)))}"
        return label(self.sweep), part, self.folder, self._files(chunk), self._limit

    def _checksums(self, chunk: int) -> str:
        return "/".join([CHECKSUMS, "c", *map(str, self.sweep.position_of(chunk))])

    def _written(self, chunk: int) -> list[str]:
        return [self._checksums(chunk), *self._files(chunk)]

    def _files(self, chunk: int) -> list[str]:
        position = "/".join(map(str, self.sweep.position_of(chunk)))
        return [
            f"{asked.name}/c/{position}{'/0' if REDUCTIONS[asked.reduction].labels else ''}"
            for asked in self.sweep.reductions
        ]


@contextlib.contextmanager
def opened(sweep: Sweep, path: str, repair: bool = False) -> Iterator[Store]:
    """Make or open, lock and check a sweep's store, and yield it.

    Raise InputError if it is locked or, without `repair`, damaged.
    """
    check_zarr()
    folder = Path(path)
    if not check_store(sweep, path):
        _make(sweep, Path(os.path.realpath(folder)))
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            # Other errors are those of file systems without locks.
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                raise InputError(
                    f"--out '{path}': another sweep is writing to it; wait until it ends, or "
                    "give another --out"
                ) from None
        try:
            _check_metadata(sweep, folder, repair)
            for left in folder.rglob(_UNFINISHED):
                if left.is_file() or left.is_symlink():
                    left.unlink()
            store = Store(sweep, folder)
            store.check(repair)
        except OSError as error:
            raise InputError(f"--out '{path}': {error.strerror or error}") from None
        yield store
    finally:
        os.close(handle)


def check_store(sweep: Sweep, path: str) -> bool:
    """Return whether `path` is this sweep's store; False for a missing or empty folder."""
    folder = Path(path)
    if not path or "\0" in path:
        raise InputError(f"--out '{path}': give a folder, which is made if it is missing")
    try:
        if not os.path.lexists(folder):
            parent = folder.absolute().parent
            if not parent.is_dir() or not os.access(parent, os.W_OK):
                raise InputError(
                    f"--out '{path}': can't be made in '{parent}'; give a new name in a folder "
                    "that can be written"
                )
            return False
        if not folder.is_dir():
            raise InputError(f"--out '{path}': is not a folder; give one, or a new name")
        if not any(folder.iterdir()):
            return False
    except OSError as error:
        raise InputError(f"--out '{path}': {error.strerror or error}") from None
    ours, known = label(sweep), labels(folder)
    if not known:
        raise InputError(
            f"--out '{path}': is not empty, and is not the store of a sweep; give a new name"
        )
    # Two files state the identity; `opened` detects damage to either.
    if any(type(each.schema) is int and each == ours for each in known):
        return True
    found = known[0]
    check_schema(f"--out '{path}'", "sweep store", found.schema, _SAME_SWEEP)
    if found.fingerprint != ours.fingerprint:
        raise InputError(
            f"--out '{path}': is the store of another sweep file (SHA-256 {found.fingerprint:.12}; "
            f"this file has {ours.fingerprint:.12}); {_SAME_SWEEP}"
        )
    raise InputError(
        f"--out '{path}': was written by pyharness {found.version}, and results of this "
        f"version, {ours.version}, may differ; {_SAME_SWEEP}"
    )


def _check_folders(folder: Path, names: Iterable[str]) -> None:
    # A link in place of a file is replaced, but files in a linked folder would be written or
    # removed elsewhere.
    check_inside(folder, sorted({os.path.dirname(name) for name in names}), "--out")


def _check_metadata(sweep: Sweep, folder: Path, repair: bool) -> None:
    files = metadata_files(sweep)
    _check_folders(folder, (*files, METADATA))
    try:
        check_files(label(sweep), "metadata", folder, files, LARGEST_METADATA, METADATA)
    except DamageError as damage:
        if not repair:
            raise InputError(
                f"--out '{folder}': its metadata are damaged: {damage}; {_REPAIR} writes them again"
            ) from None
        with filled(sweep, folder) as new:
            for name in (*files, METADATA):
                clear(folder, name)
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(new / name, folder / name)


def _make(sweep: Sweep, folder: Path) -> None:
    """Make an empty store beside `folder` and rename it, so that `folder` is never incomplete."""
    with filled(sweep, folder) as new:
        try:
            os.rename(new, folder)
        except OSError as error:
            # Another process may have made the store of this sweep meanwhile.
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST) or not check_store(
                sweep, str(folder)
            ):
                raise
