"""The documents of `docs/` as pages."""

import posixpath
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from pyharness.edition.markdown import Document, document
from pyharness.model.facts import shipped

# What the documents show.
_PICTURES = (".png", ".svg")


def documents() -> Iterator[tuple[str, Document]]:
    """Give the path of each page in the site, and what is on it."""
    folder = shipped("docs")
    for file in sorted(folder.rglob("*.md")):
        name = file.relative_to(folder).as_posix()
        text = file.read_text(encoding="utf-8")
        yield page_of(name), document(text, partial(_link, name))


def page_of(name: str) -> str:
    """Return where in the site a document of `docs/` is."""
    return f"docs/{name.removesuffix('.md')}.html"


def files() -> dict[str, bytes]:
    """Return by path in the site what the documents show."""
    folder = shipped("docs")
    return {
        f"docs/{file.relative_to(folder).as_posix()}": file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.suffix in _PICTURES
    }


def _link(name: str, target: str) -> str | None:
    """Return what a target in a document becomes; None for what the site does not have."""
    path, hash_, anchor = target.partition("#")
    if "://" in target or not path:
        return target
    here = posixpath.dirname(name)
    if not _exists(posixpath.normpath(posixpath.join(here, path))):
        return None
    return f"{path.removesuffix('.md')}.html{hash_}{anchor}" if path.endswith(".md") else path


def _exists(name: str) -> bool:
    file = Path(name)
    return (
        file.suffix in (".md", *_PICTURES)
        and not name.startswith("..")
        and (shipped("docs") / file).exists()
    )
