"""The report of `edition`: the number and size of the written files, by kind."""

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

from pyharness.model.records import build_record
from pyharness.model.report import Column, Report, Section, Table, digits, words

# The file that marks a folder as made by `edition`; it lists the files that were written.
MARK = "edition.json"
_KINDS = (*words("files"), Column("number"), Column("kB", digits(".0f", 1e-3)))


def listed(content: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the JSON record of a site's files: sizes in bytes, and the build that wrote them.

    `content` has the content of the files by path.
    """
    return {"build": build_record(), "files": {name: len(each) for name, each in content.items()}}


def edition_report(folder: str, content: Mapping[str, bytes]) -> Report:
    """Report the number and size (kB) of the files of a site that was written to a folder, by kind.

    `content` has the content of the files by path.
    """
    sizes: dict[str, list[int]] = {}
    for name, each in content.items():
        sizes.setdefault(PurePosixPath(name).suffix.lstrip("."), []).append(len(each))
    rows = [[kind, len(found), sum(found)] for kind, found in sorted(sizes.items())]
    rows.append(["all", len(content), sum(map(len, content.values()))])

    text: list[Section] = [[Table(_KINDS, rows)], [f"Open {folder}/index.html in a browser."]]
    return Report("edition", text, lambda: {"folder": folder, **listed(content)})
