"""Build the gallery: outputs and pictures of its pages, its index, and notebooks.

An example is a section of a page, and has the name of its picture. ``python -m
docs.gallery.build``, in a checkout, executes the examples of all pages and tutorials, replaces
their outputs and pictures, and writes the index `README.md`, and notebooks to `build/notebooks`.
With names, such as ``python -m docs.gallery.build free-body``, only these pages are executed.
"""

import re
import sys
import textwrap
from functools import cache
from pathlib import Path

from docs.gallery.execution import PICTURE, executed, picture_file, picture_of, shown_output
from pyharness.edition import documents
from pyharness.edition.made_pages import table
from pyharness.edition.markdown import slug
from pyharness.views.pictures import saved

HERE = Path(__file__).parent
PAGE = "gallery/README.md"
"""The index's path in the folder `docs`."""

PAGES = ("free-body", "satellites", "many-bodies", "programs")
"""The pages, in the order of the index."""

NOTEBOOKS = HERE.parents[1] / "build" / "notebooks"
"""The folder of the notebooks."""

_HEAD = """
Each example answers a question by a short program, a picture and numbers. Run as a script, an
example saves its picture if you add `figure.savefig("picture.png")`. The web pages offer Jupyter
notebooks, which `python -m docs.gallery.build` writes to `build/notebooks`.
"""


def page(name: str) -> Path:
    """Return the file of a page."""
    return HERE / f"{name}.md"


@cache
def examples() -> dict[str, tuple[str, str]]:
    """Return page and text of each example by the example's name, in the order of the index."""
    found = {}
    for each in PAGES:
        _, *sections = re.split(r"^(?=## )", page(each).read_text(encoding="utf-8"), flags=re.M)
        for section in sections:
            picture = PICTURE.search(section)
            assert picture is not None, section.partition("\n")[0]
            found[Path(picture[1]).stem] = each, section
    return found


def question(text: str) -> str:
    """Return the heading of an example."""
    return text.partition("\n")[0].removeprefix("## ")


def answer(text: str) -> str:
    """Return the paragraph of an example that begins with the word Answer, without this word."""
    (found,) = re.findall(r"^\*\*Answer\.\*\* (.*?)(?:\n\n|\Z)", text, re.DOTALL | re.MULTILINE)
    return " ".join(found.split())


def gallery_page() -> str:
    """Return the index of the gallery as Markdown."""
    rows = []
    for name, (where, text) in examples().items():
        found = PICTURE.search(text)
        assert found is not None, name
        link = f"{where}.md#{slug(question(text))}"
        rows.append(
            [f"[![{_alternative(found[0])}]({found[1]})]({link})", f"[{question(text)}]({link})"]
        )
    head = textwrap.fill(" ".join(_HEAD.split()), 120, break_on_hyphens=False)
    table_of_all = table("picture | question", rows)
    return f"# Gallery: questions about rotating bodies\n\n{head}\n\n{table_of_all}"


def _alternative(picture: str) -> str:
    """Return a picture's alternative text up to the first comma, semicolon or colon."""
    return " ".join(re.split("[],;:]", picture[2:])[0].split())


def rebuild(path: Path) -> None:
    """Execute the examples of a document, and replace the outputs and pictures that it shows.

    In the gallery, missing outputs are added.
    """
    text = path.read_text(encoding="utf-8")
    parts, end = [], 0
    for step in executed(text, path.name):
        parts.append(text[end : step.end])
        shown = shown_output(text, step)
        end = step.end
        if shown is not None or (path.parent == HERE and step.printed):
            parts.append(f"\n\n```output\n{step.printed}```")
            end += len(f"\n\n```output\n{shown}```") if shown is not None else 0
        file = picture_file(path, step)
        if step.figure is not None and file is not None:
            for name, content in saved(picture_of(step.figure), str(file)).items():
                Path(name).write_bytes(content)
    path.write_text("".join(parts) + text[end:], encoding="utf-8")


def write_notebooks(folder: Path) -> None:
    """Write a notebook for each page of the gallery and each tutorial with examples."""
    folder.mkdir(parents=True, exist_ok=True)
    for path, content in documents.notebooks(HERE.parent).items():
        (folder / Path(path).name).write_bytes(content)


def main(arguments: list[str]) -> None:
    """Execute the named pages, or all; write the index and the notebooks."""
    for path in documents.with_notebooks(HERE.parent):
        if not arguments or path.stem in arguments:
            rebuild(path)
    (HERE.parent / PAGE).write_text(gallery_page(), encoding="utf-8")
    write_notebooks(NOTEBOOKS)


if __name__ == "__main__":
    main(sys.argv[1:])
