"""Archives of trajectories and ensembles, in the format of `numpy.savez`.

The array `header` is JSON with the kind of content and the schema number; `sha256` is a digest of
the other arrays. Files are not trusted: nothing is unpickled, and no array may exceed the file's
size.
"""

import hashlib
import io
import math
import os
import zipfile
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from pyharness.model.errors import InputError, kind_of
from pyharness.model.json_text import parse_json
from pyharness.model.output_files import check_writable
from pyharness.model.pipes import read_input
from pyharness.model.schema import check_schema

DIGEST = "sha256"  # name of the last array
_OTHERS = (".csv", ".json", ".md", ".toml", ".tsv", ".txt", ".xlsx", ".xml")


def checked_path(where: str, path: object) -> str:
    if not isinstance(path, (str, os.PathLike)):
        kind = "bytes" if isinstance(path, bytes) else kind_of(path)
        raise InputError(f"{where}: the path is {kind}; allowed: a path, as text or a Path")
    name = os.fsdecode(path)
    stem, ending = os.path.splitext(os.path.basename(name))
    return name if not stem or ending or os.path.exists(name) else f"{name}.npz"


def checked_file(where: str, path: object) -> str:
    name = checked_path(where, path)
    ending = os.path.splitext(name)[1].lower()
    if ending in _OTHERS:
        raise InputError(
            f"{where} '{name}': the file is an archive of NumPy; allowed: a name that ends in "
            ".npz; for text, use np.savetxt or to_pandas"
        )
    check_writable(name, where)
    return name


def archive_of(arrays: dict[str, Any]) -> bytes:
    buffer, digest = io.BytesIO(), hashlib.sha256()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in [*(each for each in arrays if each != DIGEST), DIGEST]:
            array = digest.hexdigest() if name == DIGEST else arrays[name]
            entry = io.BytesIO()
            np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)
            add_entry(digest, f"{name}.npy", entry.getbuffer())
            # The date of a `ZipInfo` is fixed, so that every run writes the same bytes.
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
                file.write(entry.getbuffer())
    return buffer.getvalue()


def add_entry(digest: Any, name: str, data: bytes | memoryview) -> None:
    digest.update(f"{name} {len(data)}\n".encode())
    digest.update(data)


def read_archive(
    where: str, name: str, kinds: tuple[str, str], known: Iterable[str], written: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the arrays and the header of an archive; raise InputError if it is damaged.

    Only arrays named in `known` are allowed. `kinds` names the content in the header and messages.
    """
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    content = read_input(name, where, memory // 4, written)
    damaged = InputError(f"{where}: no {kinds[1]}, or damaged; give {written}")
    try:
        text = text_of(_arrays(content, known, ["header"])[0], "header")
    except Exception:  # zipfile and NumPy raise errors of many types
        raise damaged from None
    try:
        header = parse_json(text, only_finite=False)
    except ValueError as error:
        raise InputError(
            f"{where}: no {kinds[1]}, or damaged (header: {error}); give {written}"
        ) from None
    if not isinstance(header, dict) or header.get("kind") != kinds[0]:
        raise damaged
    # The schema is checked first: other versions may have other arrays.
    kind = f"{kinds[1]} file"
    check_schema(where, kind, header.get("schema"), "take a version that reads it")
    try:
        arrays, digest = _arrays(content, known)
        is_intact = DIGEST in arrays and text_of(arrays, DIGEST) == digest
    except Exception:
        raise damaged from None
    if not is_intact:
        raise InputError(
            f"{where}: was changed after it was written, or has no digest (SHA-256) of its "
            f"content; give {written}"
        )
    return arrays, header


def _arrays(
    content: bytes, known: Iterable[str], names: Sequence[str] = ()
) -> tuple[dict[str, Any], str]:
    found, digest = {}, hashlib.sha256()
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        allowed = {f"{name}.npy" for name in ("header", DIGEST, *known)}
        entries = [archive.getinfo(f"{name}.npy") for name in names] or archive.infolist()
        for each in entries:
            allowed.remove(each.filename)  # an error if the name is unknown, or occurs twice
            if each.compress_type != zipfile.ZIP_STORED or each.file_size > len(content):
                raise ValueError("an entry is compressed")
            data = archive.read(each)
            name = each.filename.removesuffix(".npy")
            if name != DIGEST:
                add_entry(digest, each.filename, data)
            found[name] = _array(data)
    return found, digest.hexdigest()


def _array(data: bytes) -> Any:
    stream = io.BytesIO(data)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise ValueError("another version of NumPy's format")
    shape, by_columns, dtype = np.lib.format.read_array_header_1_0(stream)
    begin = stream.tell()
    if dtype.kind not in "fiU" or math.prod(shape) * dtype.itemsize != len(data) - begin:
        raise ValueError("another type, or another size")
    flat = np.frombuffer(data, dtype, offset=begin).astype(dtype.newbyteorder("="))
    return flat.reshape(shape, order="F" if by_columns else "C")


def text_of(arrays: dict[str, Any], name: str) -> str:
    array = arrays[name]
    if array.shape != () or array.dtype.kind != "U":
        raise ValueError("no text")
    return str(array)
