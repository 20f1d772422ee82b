"""The documents of `docs` as pages of the web site and as Jupyter notebooks.

`folder` has the documents; `name` is a path in `folder`.
"""

import base64
import hashlib
import posixpath
import re
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pyharness.edition.markdown import Document, document
from pyharness.model.errors import InputError
from pyharness.model.facts import shipped
from pyharness.views.render import json_text

_PICTURES = (".png", ".svg")
_BESIDE = (*_PICTURES, ".csv", ".schema.json")
# Folder that the site omits.
_OFF_SITE = "contributing/"
# Folders whose documents become notebooks too if they have Python examples.
_NOTEBOOKS = ("gallery", "tutorials")
# Documents to which other pages of the site link.
_LINKED = (
    "index.md",
    "article/article.md",
    "explanation/about-the-text.md",
    "explanation/methods.md",
)
# An example with any output, or a picture.
_PART = re.compile(
    r"```python\n(?P<code>.*?)```(?:\n*```output\n(?P<output>.*?)```)?"
    r"|!\[[^]]*\]\((?P<picture>[^)/]+\.(?P<form>svg|png))\)",
    re.DOTALL,
)
_LINK = re.compile(r"(?<!!)\[((?:[^][]|\[[^]]*\])*)\]\([^):]*\)")


def documents_folder(given: str | None = None) -> Path:
    """Return the folder `given` or, by default, `docs` of the checkout or in the current folder.

    Raise InputError if a document is missing there.
    """
    for folder in [shipped("docs"), Path("docs")] if given is None else [Path(given)]:
        missing = [name for name in _LINKED if not (folder / name).is_file()]
        if not missing:
            return folder
    if given is None:
        raise InputError(
            "edition: an installed package does not contain the documents; give --docs DIR, "
            "the folder 'docs' of the source, or run it in a checkout"
        )
    raise InputError(
        f"--docs '{given}': does not contain {missing[0]}; give the folder 'docs' of the source"
    )


def documents(folder: Path) -> Iterator[tuple[str, Document]]:
    """Yield the site's path and the rendered text of each document of the site."""
    for file in sorted(folder.rglob("*.md")):
        name = file.relative_to(folder).as_posix()
        if not name.startswith(_OFF_SITE):
            text = file.read_text(encoding="utf-8")
            yield page_of(name), document(text, partial(_link, folder, name))


def page_of(name: str) -> str:
    return f"docs/{name.removesuffix('.md')}.html"


def files(folder: Path) -> dict[str, bytes]:
    """Return the documents' pictures, tables and schemas, by path on the site."""
    found = {}
    for file in sorted(folder.rglob("*")):
        name = file.relative_to(folder).as_posix()
        if name.endswith(_BESIDE) and not name.startswith(_OFF_SITE):
            found[f"docs/{name}"] = file.read_bytes()
    return found


def with_notebooks(folder: Path) -> list[Path]:
    files = [path for name in _NOTEBOOKS for path in sorted((folder / name).glob("*.md"))]
    return [path for path in files if "```python\n" in path.read_text(encoding="utf-8")]


def notebooks(folder: Path) -> dict[str, bytes]:
    found = {}
    for path in with_notebooks(folder):
        beside = [file for file in path.parent.iterdir() if file.suffix in _PICTURES]
        pictures = {file.name: file.read_bytes() for file in beside}
        name = path.relative_to(folder).with_suffix(".ipynb").as_posix()
        found[f"docs/{name}"] = notebook(path.read_text(encoding="utf-8"), pictures)
    return found


def notebook(text: str, pictures: Mapping[str, bytes]) -> bytes:
    """Return a document as a notebook (JSON, format 4.5), with links to documents as plain text.

    `pictures` maps file names to contents.
    """
    cells: list[dict[str, Any]] = []

    def add(kind: str, source: str, **more: Any) -> None:
        identifier = hashlib.sha256(f"{len(cells)} {source}".encode()).hexdigest()[:8]
        cell = {"cell_type": kind, "id": identifier, "metadata": {}}
        cells.append(cell | {"source": source.splitlines(keepends=True)} | more)

    start = 0
    for found in (*_PART.finditer(text), None):
        prose = text[start : found.start() if found else None].strip()
        if prose:
            add("markdown", _LINK.sub(r"\1", prose))
        if found is None:
            break
        start = found.end()
        if found["code"] is not None:
            printed = (found["output"] or "").splitlines(keepends=True)
            stream = {"name": "stdout", "output_type": "stream", "text": printed}
            outputs = [stream] if printed else []
            add("code", found["code"].rstrip("\n"), execution_count=None, outputs=outputs)
        elif cells and cells[-1]["cell_type"] == "code" and found["picture"] in pictures:
            cells[-1]["outputs"].append(_display(found["form"], pictures[found["picture"]]))
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    record = {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}
    return json_text(record).encode()


def _display(form: str, content: bytes) -> dict[str, Any]:
    data = content.decode() if form == "svg" else base64.b64encode(content).decode()
    kind = "image/svg+xml" if form == "svg" else "image/png"
    return {"data": {kind: data}, "metadata": {}, "output_type": "display_data"}


def _link(folder: Path, name: str, target: str) -> str | None:
    """Return a document's link as on the site, or None if the site lacks the target."""
    path, hash_, anchor = target.partition("#")
    if "://" in target or not path:
        return target
    place = posixpath.normpath(posixpath.join(posixpath.dirname(name), path))
    is_outside = place.startswith(("..", _OFF_SITE)) or not place.endswith((".md", *_BESIDE))
    if is_outside or not (folder / place).exists():
        return None
    return f"{path.removesuffix('.md')}.html{hash_}{anchor}" if path.endswith(".md") else path
