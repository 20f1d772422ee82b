"""Layout of a sweep's store: arrays, metadata, identity, and checksums of files.

`sha256sum --check` can read a file of checksums. Its first line names version, sweep and part of
the store, so that a file of another store is detected. `folder` is the store's folder, `name` a
path in it.
"""

import atexit
import contextlib
import errno
import hashlib
import math
import os
import re
import shutil
import stat
import time
import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyharness.model.distribution import version
from pyharness.model.json_text import parse_json
from pyharness.model.scene_file import scene_text
from pyharness.model.schema import SCHEMAS
from pyharness.sweep.axes import MOST_VALUES, units_of
from pyharness.sweep.reductions import REDUCTIONS, empty
from pyharness.sweep.sweep import ReductionSpec, Sweep

_PIECE = 1 << 20  # bytes read at once
_REMOVALS = 20  # most attempts, 0.05 s apart, to remove a folder in which a thread may still write


class DamageError(Exception):
    """Damage to a file of a store."""


class Label(NamedTuple):
    schema: object  # number of the store's format; an integer if pyharness wrote the store
    version: str  # version of pyharness
    fingerprint: str  # SHA-256 of the sweep


def checksum_text(label: Label, part: str, folder: Path, names: Sequence[str], limit: int) -> bytes:
    """Return a checksum file's content for the files `names` of `part`, such as "chunk 0/1".

    Raise DamageError for files that are unreadable or above `limit` bytes.
    """
    identity = f"schema {label.schema}, version {label.version}, sweep {label.fingerprint}"
    lines = [f"# pyharness sweep store, {identity}, {part}"]
    lines += [f"{_digest(folder, name, limit)}  {name}" for name in names]
    return "\n".join(lines).encode() + b"\n"


def check_files(
    label: Label, part: str, folder: Path, names: Sequence[str], limit: int, checksums: str
) -> None:
    found = checksum_text(label, part, folder, names, limit)
    known = read_bounded(folder, checksums, 2 * len(found))
    if known != found:
        lines = known.split(b"\n")
        for name, line in zip(names, found.split(b"\n")[1:], strict=False):
            if line not in lines and any(each.endswith(b"  " + name.encode()) for each in lines):
                raise DamageError(f"'{name}' differs from its checksum")
        raise DamageError(f"'{checksums}' is not what was written for these files")


def read_bounded(folder: Path, name: str, limit: int) -> bytes:
    """Return a file's content; raise DamageError if missing, not regular or above `limit` bytes."""
    with _opened(folder, name, limit) as handle, open(handle, "rb", closefd=False) as file:
        return file.read(limit)


def _digest(folder: Path, name: str, limit: int) -> str:
    digest = hashlib.sha256()
    with _opened(folder, name, limit) as handle:
        # If another process extends the file, its end might never be reached.
        for _ in range(limit // _PIECE + 2):
            digest.update(os.read(handle, _PIECE))
    return digest.hexdigest()


@contextlib.contextmanager
def _opened(folder: Path, name: str, limit: int) -> Iterator[int]:
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
    """Remove the file, link or folder `name`, and a file where a parent folder should be."""
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
    new = path.with_name(f"{path.name}.{os.urandom(8).hex()}.partial")
    try:
        new.write_bytes(content)
        os.replace(new, path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise


CHECKSUMS = "checksums"  # the group of the checksums; no array may have this name
METADATA = f"{CHECKSUMS}/metadata"
# Bytes of the values of the longest axis, to which compression may add a little.
LARGEST_METADATA = 65536 + 9 * MOST_VALUES
_HEAD = re.compile(
    r"# pyharness sweep store, schema (\d{1,9}), version (\S+), sweep ([0-9a-f]{64}), metadata"
)


def label(sweep: Sweep) -> Label:
    return Label(SCHEMAS["sweep store"], version(), sweep.fingerprint)


def labels(folder: Path) -> list[Label]:
    """Return the labels that are readable in a store's metadata and its file of checksums."""
    found = []
    with contextlib.suppress(DamageError, OSError, ValueError, LookupError, TypeError):
        attributes = parse_json(read_bounded(folder, "zarr.json", LARGEST_METADATA))["attributes"]
        words = [attributes[key] for key in ("pyharness_version", "sweep_sha256")]
        if all(isinstance(each, str) for each in words):
            found.append(Label(attributes.get("schema"), *words))
    with contextlib.suppress(DamageError, OSError, ValueError):
        head = read_bounded(folder, METADATA, LARGEST_METADATA).split(b"\n")[0].decode()
        match = _HEAD.fullmatch(head)
        if match:
            found.append(Label(int(match[1]), match[2], match[3]))
    return found


def metadata_files(sweep: Sweep) -> list[str]:
    """Return the paths of all files without results: metadata, values of axes, and labels."""
    labels = {REDUCTIONS[asked.reduction].dimension for asked in sweep.reductions} - {""}
    values = [*(axis.field for axis in sweep.axes), *sorted(labels)]
    described = ["", CHECKSUMS, *values, *(asked.name for asked in sweep.reductions)]
    files = [f"{name}/zarr.json".lstrip("/") for name in described]
    return [*files, *(f"{name}/c/0" for name in values)]


@contextlib.contextmanager
def filled(sweep: Sweep, folder: Path) -> Iterator[Path]:
    """Make an empty store beside `folder`, and yield its temporary path.

    Files left there are removed at the end.
    """
    import zarr

    new = folder.absolute().with_name(f".pyharness-{os.urandom(8).hex()}-new")
    fields = [axis.field for axis in sweep.axes if axis.field != axis.dimension]
    attributes: dict[str, Any] = {"schema": SCHEMAS["sweep store"], "title": sweep.name}
    attributes |= {"pyharness_version": version(), "sweep": sweep.text}
    attributes |= {"scene": scene_text(sweep.scene), "sweep_sha256": sweep.fingerprint}
    if fields:
        attributes["coordinates"] = " ".join(fields)
    # Ctrl-C may leave Zarr's thread writing, or interrupt the removal.
    remove = partial(_remove, new)
    atexit.register(remove)
    try:
        with zarr.config.set({"array.write_empty_chunks": True}):
            _fill_group(zarr.create_group(new, zarr_format=3, attributes=attributes), sweep)
        with warnings.catch_warnings():
            # xarray warns if consolidated metadata are missing, and Zarr if they are made.
            warnings.filterwarnings("ignore", "Consolidated metadata", UserWarning)
            zarr.consolidate_metadata(new)
        files = metadata_files(sweep)
        place_checksums(label(sweep), "metadata", new, files, LARGEST_METADATA, METADATA)
        yield new
    finally:
        remove()
        atexit.unregister(remove)


def _remove(folder: Path) -> None:
    for _ in range(_REMOVALS):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return
        time.sleep(0.05)


def _fill_group(group: Any, sweep: Sweep) -> None:
    group.create_group(
        CHECKSUMS, attributes={"long_name": "SHA-256 of each file, as `sha256sum --check` reads it"}
    )
    for axis in sweep.axes:
        _write_values(group, axis.field, axis.dimension, axis.coordinates(), units_of(axis.field))
    for asked in sweep.reductions:
        _make_array(group, sweep, asked)


def _write_values(
    group: Any, name: str, dimension: str, values: NDArray[Any], units: str = ""
) -> None:
    dtype = str if values.dtype == object else values.dtype
    about = {"dimension_names": [dimension], "attributes": {"units": units} if units else {}}
    shape = values.shape
    array = group.create_array(name, shape=shape, chunks=shape, dtype=dtype, **about)
    array[:] = values


def _make_array(group: Any, sweep: Sweep, asked: ReductionSpec) -> None:
    from zarr.codecs import ZstdCodec

    reduction = REDUCTIONS[asked.reduction]
    shape, chunk, dimensions = sweep.shape, sweep.chunk_shape, list(sweep.dimensions)
    if reduction.labels:
        shape, chunk = (*shape, len(reduction.labels)), (*chunk, len(reduction.labels))
        dimensions.append(reduction.dimension)
        if reduction.dimension not in group:
            labels = np.array(reduction.labels, dtype=object)
            _write_values(group, reduction.dimension, reduction.dimension, labels)
    attributes: dict[str, Any] = {"long_name": reduction.title, "units": reduction.units}
    if reduction.flags:
        names = (each.replace(" ", "_") for each in reduction.flags.values())
        attributes |= {"flag_values": list(reduction.flags), "flag_meanings": " ".join(names)}
    # Fixed, because a recomputed chunk must have the same bytes, whatever Zarr's default is.
    form: dict[str, Any] = {"compressors": ZstdCodec(level=0, checksum=False)}
    form |= {"dtype": reduction.dtype, "fill_value": reduction.fill}
    form |= {"dimension_names": dimensions, "attributes": attributes}
    group.create_array(asked.name, shape=shape, chunks=chunk, **form)


def largest_chunk(sweep: Sweep) -> int:
    """Return an upper bound (bytes) on each file of a chunk."""
    scenes = math.prod(sweep.chunk_shape)
    return 65536 + 2 * scenes * max(empty(asked, 1).nbytes for asked in sweep.reductions)
