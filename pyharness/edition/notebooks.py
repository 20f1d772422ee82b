"""Documents as Jupyter notebooks, with their outputs and pictures."""

import base64
import hashlib
import re
from collections.abc import Iterator, Mapping
from typing import Any

from pyharness.views.render import json_text

# An example with its output, or a picture in the folder of the document.
_PART = re.compile(
    r"```python\n(?P<code>.*?)```(?:\n*```output\n(?P<output>.*?)```)?"
    r"|!\[[^]]*\]\((?P<picture>[^)/]+\.(?:svg|png))\)",
    re.DOTALL,
)
_LINK = re.compile(r"(?<!!)\[((?:[^][]|\[[^]]*\])*)\]\([^):]*\)")
_TYPES = {"svg": "image/svg+xml", "png": "image/png"}


def has_examples(text: str) -> bool:
    """Return whether a document has Python examples."""
    return "```python\n" in text


def notebook(text: str, pictures: Mapping[str, bytes]) -> bytes:
    """Return a document as a notebook, JSON in format 4.5.

    `pictures` has contents by file name. Links to documents become plain text, because a notebook
    may be in any folder.
    """
    cells: list[dict[str, Any]] = []
    for kind, source, found in _split(text):
        if kind == "picture" and cells and cells[-1]["cell_type"] == "code" and source in pictures:
            cells[-1]["outputs"].append(_display(source, pictures[source]))
        elif kind == "code":
            printed = found["output"] if found else None
            outputs = [_stream(printed)] if printed else []
            cells.append(_cell("code", source, len(cells), outputs))
        elif kind == "prose" and source.strip():
            cells.append(_cell("markdown", _LINK.sub(r"\1", source.strip()), len(cells)))
    metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    record = {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}
    return json_text(record).encode()


def _split(text: str) -> Iterator[tuple[str, str, "re.Match[str] | None"]]:
    """Yield each part's kind (prose, code or picture), text and match."""
    start = 0
    for found in _PART.finditer(text):
        yield "prose", text[start : found.start()], None
        if found["code"] is not None:
            yield "code", found["code"].rstrip("\n"), found
        else:
            yield "picture", found["picture"], found
        start = found.end()
    yield "prose", text[start:], None


def _cell(
    kind: str, source: str, number: int, outputs: list[dict[str, Any]] | None = None
) -> dict[str, Any]:
    identity = hashlib.sha256(f"{number} {source}".encode()).hexdigest()[:8]
    cell: dict[str, Any] = {
        "cell_type": kind,
        "id": identity,
        "metadata": {},
        "source": source.splitlines(keepends=True),
    }
    if kind == "code":
        cell |= {"execution_count": None, "outputs": outputs}
    return cell


def _stream(text: str) -> dict[str, Any]:
    return {"name": "stdout", "output_type": "stream", "text": text.splitlines(keepends=True)}


def _display(name: str, content: bytes) -> dict[str, Any]:
    form = name.rpartition(".")[2]
    data = content.decode() if form == "svg" else base64.b64encode(content).decode()
    return {"data": {_TYPES[form]: data}, "metadata": {}, "output_type": "display_data"}
