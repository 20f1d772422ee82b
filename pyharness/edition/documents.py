"""The Markdown documents of `docs` as pages of the web site.

`folder` is the folder of the documents, `name` a path in it.
"""

import posixpath
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from pyharness.edition.markdown import Document, document
from pyharness.edition.notebooks import has_examples, notebook
from pyharness.model.errors import InputError
from pyharness.model.facts import shipped

# Suffixes of pictures, and of all files that the site copies with the documents.
_PICTURES = (".png", ".svg")
_BESIDE = (*_PICTURES, ".csv", ".schema.json")
# The folder of documents for contributors, which the site omits.
_OFF_SITE = "contributing/"
# Folders of documents that also become notebooks if they have Python examples.
_NOTEBOOKS = ("gallery", "tutorials")
# Documents that the site's other pages link.
_LINKED = (
    "index.md",
    "article/article.md",
    "explanation/about-the-text.md",
    "explanation/methods.md",
)


def documents_folder(given: str | None = None) -> Path:
    """Return `given` or the checkout's `docs`; raise InputError if documents are missing.

    An installed package does not include them.
    """
    folder = shipped("docs") if given is None else Path(given)
    missing = [name for name in _LINKED if not (folder / name).is_file()]
    if not missing:
        return folder
    if given is None:
        raise InputError(
            "edition: an installed package does not contain the documents; give --docs DIR, "
            "the folder 'docs' of "
            "the source, or run it in a checkout"
        )
    raise InputError(
        f"--docs '{given}': does not contain {missing[0]}; give the folder 'docs' of the source"
    )


def documents(folder: Path) -> Iterator[tuple[str, Document]]:
    """Yield path and rendered text of each document, except those for contributors."""
    for file in sorted(folder.rglob("*.md")):
        name = file.relative_to(folder).as_posix()
        if not _is_on_site(name):
            continue
        text = file.read_text(encoding="utf-8")
        yield page_of(name), document(text, partial(_link, folder, name))


def page_of(name: str) -> str:
    """Return the path of a document in the site."""
    return f"docs/{name.removesuffix('.md')}.html"


def files(folder: Path) -> dict[str, bytes]:
    """Return the documents' pictures, tables and schemas, by path in the site."""
    return {
        f"docs/{file.relative_to(folder).as_posix()}": file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.name.endswith(_BESIDE) and _is_on_site(file.relative_to(folder).as_posix())
    }


def with_notebooks(folder: Path) -> list[Path]:
    """Return the documents with Python examples, which also become notebooks."""
    files = [path for name in _NOTEBOOKS for path in sorted((folder / name).glob("*.md"))]
    return [path for path in files if has_examples(path.read_text(encoding="utf-8"))]


def notebooks(folder: Path) -> dict[str, bytes]:
    """Return the notebooks by path in the site, with outputs and pictures."""
    found = {}
    for path in with_notebooks(folder):
        beside = [file for file in path.parent.iterdir() if file.suffix in _PICTURES]
        pictures = {file.name: file.read_bytes() for file in beside}
        name = path.relative_to(folder).with_suffix(".ipynb").as_posix()
        found[f"docs/{name}"] = notebook(path.read_text(encoding="utf-8"), pictures)
    return found


def _link(folder: Path, name: str, target: str) -> str | None:
    """Return a document's link as a link in the site, or None if the site lacks the target."""
    path, hash_, anchor = target.partition("#")
    if "://" in target or not path:
        return target
    here = posixpath.dirname(name)
    if not _exists(folder, posixpath.normpath(posixpath.join(here, path))):
        return None
    return f"{path.removesuffix('.md')}.html{hash_}{anchor}" if path.endswith(".md") else path


def _exists(folder: Path, name: str) -> bool:
    return (
        name.endswith((".md", *_BESIDE))
        and not name.startswith("..")
        and _is_on_site(name)
        and (folder / name).exists()
    )


def _is_on_site(name: str) -> bool:
    return not name.startswith(_OFF_SITE)
