"""Layout of a sweep's store: its arrays, their metadata, and its identity."""

import contextlib
import json
import math
import os
import re
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.distribution import version
from pyharness.model.scene_file import scene_text
from pyharness.model.schema import SCHEMAS
from pyharness.sweep.axes import MOST_VALUES, units_of
from pyharness.sweep.checksums import DamageError, Label, place_checksums, read_bounded
from pyharness.sweep.reductions import REDUCTIONS, empty
from pyharness.sweep.sweep import ReductionSpec, Sweep

CHECKSUMS = "checksums"  # the group of the checksums; no array may have this name
METADATA = f"{CHECKSUMS}/metadata"
# In bytes: the values of the longest axis, to which compression may add a little.
LARGEST_METADATA = 65536 + 9 * MOST_VALUES
_HEAD = re.compile(
    r"# pyharness sweep store, schema (\d{1,9}), version (\S+), sweep ([0-9a-f]{64}), metadata"
)


def label(sweep: Sweep) -> Label:
    """Return the identity of a store that this version of pyharness makes."""
    return Label(SCHEMAS["sweep store"], version(), sweep.fingerprint)


def labels(folder: Path) -> list[Label]:
    """Return the identities in a store's metadata and in the checksums of the metadata.

    An unreadable one is omitted. In an undamaged store both are equal.
    """
    found = []
    with contextlib.suppress(
        DamageError, OSError, ValueError, LookupError, TypeError, RecursionError
    ):
        attributes = json.loads(read_bounded(folder, "zarr.json", LARGEST_METADATA))["attributes"]
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
    """Return the paths of the files without results: metadata, axes and labels."""
    labels = {REDUCTIONS[asked.reduction].dimension for asked in sweep.reductions} - {""}
    values = [*(axis.field for axis in sweep.axes), *sorted(labels)]
    described = ["", CHECKSUMS, *values, *(asked.name for asked in sweep.reductions)]
    files = [f"{name}/zarr.json".lstrip("/") for name in described]
    return [*files, *(f"{name}/c/0" for name in values)]


@contextlib.contextmanager
def filled(sweep: Sweep, folder: Path) -> Iterator[Path]:
    """Make an empty store beside `folder`, and yield its temporary path.

    Files that the caller has not moved are removed at the end.
    """
    import zarr

    new = folder.absolute().with_name(f".pyharness-{os.urandom(8).hex()}-new")
    fields = [axis.field for axis in sweep.axes if axis.field != axis.dimension]
    attributes: dict[str, Any] = {
        "schema": SCHEMAS["sweep store"],
        "title": sweep.name,
        "pyharness_version": version(),
        "sweep": sweep.text,
        "scene": scene_text(sweep.scene),
        "sweep_sha256": sweep.fingerprint,
    }
    if fields:
        attributes["coordinates"] = " ".join(fields)
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
        shutil.rmtree(new, ignore_errors=True)


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
    array = group.create_array(
        name,
        shape=values.shape,
        chunks=values.shape,
        dtype=str if values.dtype == object else values.dtype,
        dimension_names=[dimension],
        attributes={"units": units} if units else {},
    )
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
        attributes["flag_values"] = list(reduction.flags)
        attributes["flag_meanings"] = " ".join(
            each.replace(" ", "_") for each in reduction.flags.values()
        )
    group.create_array(
        asked.name,
        shape=shape,
        chunks=chunk,
        # Fixed, because a chunk that is computed again must have the same bytes, and another
        # version of Zarr may have another default.
        compressors=ZstdCodec(level=0, checksum=False),
        dtype=reduction.dtype,
        fill_value=reduction.fill,
        dimension_names=dimensions,
        attributes=attributes,
    )


def largest_chunk(sweep: Sweep) -> int:
    """Return an upper bound of the size (bytes) of any file of a chunk."""
    scenes = math.prod(sweep.chunk_shape)
    return 65536 + 2 * scenes * max(empty(asked, 1).nbytes for asked in sweep.reductions)
