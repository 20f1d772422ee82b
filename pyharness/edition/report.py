"""The reports of the command `edition`, and the check of its libraries.

`content` has the written files' contents by path.
"""

import shlex
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

from pyharness.edition.citation import MANIFEST
from pyharness.history.identifiers import data_identifier, directory_identifier, text_digest
from pyharness.model.distribution import check_package, install_command
from pyharness.model.records import build_record
from pyharness.model.report import Column, Line, Report, Section, Table, digits, words

LIBRARIES = (
    "docstring_parser", "jinja2", "latex2mathml", "markdown_it", "markupsafe", "matplotlib",
    "mdit_py_plugins",
)  # fmt: skip
# File that marks a folder as written by `edition`, and lists the site's files.
MARK = "edition.json"
_KINDS = (*words("files"), Column("number"), Column("kB", digits(".0f", 1e-3)))


def check_libraries() -> None:
    for name in LIBRARIES:
        check_package(name, "edition", install_command("edition"))


def listed(content: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the record of the build, and the size (bytes) of each file."""
    return {"build": build_record(), "files": {name: len(each) for name, each in content.items()}}


def edition_report(folder: str, content: Mapping[str, bytes]) -> Report:
    text: list[Section] = [[_sizes(content)], [f"Open {folder}/index.html in a browser."]]
    return Report("edition", text, lambda: {"folder": folder, **listed(content)})


def package_report(folder: str, content: Mapping[str, bytes]) -> Report:
    package, data, digest = directory_identifier(content), data_identifier(), text_digest()
    names = (("Identifier of the package:", package), ("Identifier of its sources:", data))
    named = [Line(f"{name:28s}{each}") for name, each in (*names, ("Digest of the text:", digest))]
    check = Line(f"Check it with: cd {shlex.quote(folder)} && sha256sum -c {MANIFEST}")
    identifiers = {"package": package, "data": data, "text": digest}
    record = {"folder": folder, "identifiers": identifiers, **listed(content)}
    return Report("edition", [[_sizes(content)], named, [check]], lambda: record)


def _sizes(content: Mapping[str, bytes]) -> Table:
    sizes: dict[str, list[int]] = {}
    for name, each in content.items():
        sizes.setdefault(PurePosixPath(name).suffix.lstrip("."), []).append(len(each))
    rows = [[kind or "-", len(found), sum(found)] for kind, found in sorted(sizes.items())]
    rows.append(["all", len(content), sum(map(len, content.values()))])
    return Table(_KINDS, rows)
