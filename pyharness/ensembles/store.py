"""The store of a sweep: a Zarr group in a folder, one array for each reduction.

A chunk of the grid is one file of each array. Zarr writes a file under another name and renames it,
so that a chunk whose files are all there is done, whenever and however the writing ended.
"""

import contextlib
import errno
import fcntl
import os
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pyharness.ensembles.fields import units_of
from pyharness.ensembles.reductions import REDUCTIONS
from pyharness.ensembles.sweep import Arrays, Sweep
from pyharness.model.distribution import install_command, version
from pyharness.model.errors import InputError

_SCHEMA = 1
_UNFINISHED = "*.partial"  # what Zarr calls a file that it has not renamed yet
_SAME_SWEEP = "give another --out, or remove it"


def check_zarr() -> None:
    """Refuse to keep anything where Zarr is missing."""
    try:
        import zarr  # noqa: F401
    except ImportError:
        raise InputError(f"sweep needs zarr: {install_command('sweep')}") from None


class Store:
    """The store of one sweep, opened by `opened`."""

    def __init__(self, sweep: Sweep, folder: Path) -> None:
        """Open what is there."""
        import zarr

        self.sweep, self.folder = sweep, folder
        group = zarr.open_group(folder, mode="r+", zarr_format=3, use_consolidated=False)
        # A chunk may hold nothing but what stands for nothing, and is kept all the same.
        with zarr.config.set({"array.write_empty_chunks": True}):
            self._arrays: dict[str, Any] = {
                asked.name: group[asked.name] for asked in sweep.reductions
            }

    def done(self) -> list[bool]:
        """Return for each chunk whether it is whole."""
        return [
            all(file.exists() for file in self._files(chunk))
            for chunk in range(self.sweep.n_chunks)
        ]

    def write(self, chunk: int, found: Arrays) -> None:
        """Keep a chunk; OSError where the disk does not take it, and then it is not done."""
        for name, array in self._arrays.items():
            array[self.sweep.box(chunk)] = found[name]

    def read(self, name: str, chunk: int) -> Any:
        """Return a chunk of a reduction."""
        return self._arrays[name][self.sweep.box(chunk)]

    def array(self, name: str) -> Any:
        """Return the array of a reduction, of which what is asked for is read."""
        return self._arrays[name]

    def _files(self, chunk: int) -> Iterator[Path]:
        place = self.sweep.place(chunk)
        for asked in self.sweep.reductions:
            more = (0,) if REDUCTIONS[asked.reduction].labels else ()
            yield self.folder.joinpath(asked.name, "c", *map(str, (*place, *more)))


@contextlib.contextmanager
def opened(sweep: Sweep, path: str) -> Iterator[Store]:
    """Make or open the store of a sweep; no other process has it meanwhile.

    InputError for a store of another sweep, or a folder that is none; both stay as they were.
    """
    check_zarr()
    folder = Path(path)
    if not check_store(sweep, path):
        _make(sweep, folder)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            # A file system that knows no locks has none to respect.
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                raise InputError(f"--out '{path}': another sweep is writing to it") from None
        for left in folder.rglob(_UNFINISHED):
            left.unlink()
        yield Store(sweep, folder)
    finally:
        os.close(handle)


def check_store(sweep: Sweep, path: str) -> bool:
    """Return whether a store is there; InputError where something is that is not this sweep's."""
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
    try:
        import json

        attributes = json.loads((folder / "zarr.json").read_text())["attributes"]
        made_by = attributes["sweep_sha256"], attributes["pyharness_version"]
    except (OSError, ValueError, LookupError, TypeError):
        raise InputError(
            f"--out '{path}': is not empty, and no store of a sweep; give a new name"
        ) from None
    if made_by[0] != sweep.fingerprint:
        raise InputError(
            f"--out '{path}': is the store of another sweep file (SHA-256 {made_by[0]:.12}, and "
            f"this one's is {sweep.fingerprint:.12}); {_SAME_SWEEP}"
        )
    if made_by[1] != version():
        raise InputError(
            f"--out '{path}': was made by pyharness {made_by[1]}, and this is "
            f"{version()}, whose results may differ; {_SAME_SWEEP}"
        )
    return True


def _make(sweep: Sweep, folder: Path) -> None:
    """Make the store beside its place, and rename it: it is there whole or not at all."""
    new = folder.absolute().with_name(f".pyharness-{os.urandom(8).hex()}-new")
    try:
        _fill(sweep, new)
        os.rename(new, folder)
    finally:
        shutil.rmtree(new, ignore_errors=True)


def _fill(sweep: Sweep, folder: Path) -> None:
    import zarr

    fields = [axis.field for axis in sweep.axes if axis.field != axis.dimension]
    attributes: dict[str, Any] = {
        "schema": _SCHEMA,
        "title": sweep.name,
        "pyharness_version": version(),
        "sweep": sweep.text,
        "sweep_sha256": sweep.fingerprint,
    }
    if fields:
        attributes["coordinates"] = " ".join(fields)
    group = zarr.create_group(folder, zarr_format=3, attributes=attributes)
    for axis in sweep.axes:
        values = axis.coordinates()
        array = group.create_array(
            axis.field,
            shape=values.shape,
            dtype=str if axis.is_choice else values.dtype,
            dimension_names=[axis.dimension],
            attributes={"units": units_of(axis.field)} if units_of(axis.field) else {},
        )
        array[:] = values
    for asked in sweep.reductions:
        _make_array(group, sweep, asked.name, asked.reduction)
    with warnings.catch_warnings():
        # xarray looks for it, and warns where it is missing; Zarr warns where it is made.
        warnings.filterwarnings("ignore", "Consolidated metadata", UserWarning)
        zarr.consolidate_metadata(group.store)


def _make_array(group: Any, sweep: Sweep, name: str, reduction_name: str) -> None:
    reduction = REDUCTIONS[reduction_name]
    shape, chunk, dimensions = sweep.shape, sweep.chunk_shape, list(sweep.dimensions)
    if reduction.labels:
        shape, chunk = (*shape, len(reduction.labels)), (*chunk, len(reduction.labels))
        dimensions.append(reduction.dimension)
        if reduction.dimension not in group:
            labels = group.create_array(
                reduction.dimension,
                shape=(len(reduction.labels),),
                dtype=str,
                dimension_names=[reduction.dimension],
            )
            labels[:] = np.array(reduction.labels, dtype=object)
    attributes: dict[str, Any] = {"long_name": reduction.title, "units": reduction.units}
    if reduction.flags:
        attributes["flag_values"] = list(reduction.flags)
        attributes["flag_meanings"] = " ".join(
            each.replace(" ", "_") for each in reduction.flags.values()
        )
    group.create_array(
        name,
        shape=shape,
        chunks=chunk,
        dtype=reduction.dtype,
        fill_value=reduction.fill,
        dimension_names=dimensions,
        attributes=attributes,
    )
