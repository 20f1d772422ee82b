"""The reports of the verb `edition`: the number and size of the written files, by type."""

import shlex
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

from pyharness.edition.crate import MANIFEST
from pyharness.history.identifiers import data_identifier, directory_identifier
from pyharness.history.text_digest import text_digest
from pyharness.model.records import build_record
from pyharness.model.report import Column, Line, Report, Section, Table, digits, words

# The file that marks a folder as written by the verb `edition`; it lists the files of the site.
MARK = "edition.json"
_KINDS = (*words("files"), Column("number"), Column("kB", digits(".0f", 1e-3)))


def listed(content: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the JSON record of the web site that the command `pyharness edition` writes.

    The key `build` has the versions, the compiler and the compiler flags of the installation that
    wrote the site. The key `files` has the size of each file in bytes, by its path. `content` maps
    the path of each file to its content.
    """
    return {"build": build_record(), "files": {name: len(each) for name, each in content.items()}}


def edition_report(folder: str, content: Mapping[str, bytes]) -> Report:
    """Return the report of the command `pyharness edition`, which writes the project's web site.

    The report has the number and the total size (kB) of the files of each type, which is the suffix
    of the file name. `folder` is the folder to which the site was written. `content` maps the path
    of each file to its content.
    """
    text: list[Section] = [[_sizes(content)], [f"Open {folder}/index.html in a browser."]]
    return Report("edition", text, lambda: {"folder": folder, **listed(content)})


def package_report(folder: str, content: Mapping[str, bytes]) -> Report:
    """Return the report of `pyharness edition --data`, which writes the edition's data package.

    The report has the number and the total size (kB) of the files of each type, and the identifier
    of the whole package. `folder` is the folder to which the package was written. `content` maps
    the path of each file to its content.
    """
    identifiers = {
        "package": directory_identifier(content), "data": data_identifier(), "text": text_digest(),
    }  # fmt: skip
    text: list[Section] = [
        [_sizes(content)],
        [
            Line(f"Identifier of the package:  {identifiers['package']}"),
            Line(f"Identifier of its sources:  {identifiers['data']}"),
            Line(f"Digest of the text:         {identifiers['text']}"),
        ],
        [Line(f"Check it with: cd {shlex.quote(folder)} && sha256sum -c {MANIFEST}")],
    ]
    return Report(
        "edition", text, lambda: {"folder": folder, "identifiers": identifiers, **listed(content)}
    )


def _sizes(content: Mapping[str, bytes]) -> Table:
    """Return a table of the number and the total size (kB) of files by their suffix."""
    sizes: dict[str, list[int]] = {}
    for name, each in content.items():
        sizes.setdefault(PurePosixPath(name).suffix.lstrip("."), []).append(len(each))
    rows = [[kind or "-", len(found), sum(found)] for kind, found in sorted(sizes.items())]
    rows.append(["all", len(content), sum(map(len, content.values()))])
    return Table(_KINDS, rows)
