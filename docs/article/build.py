"""The article, built from templates and computed values.

``python -m docs.article.build``, in a checkout, fills `article.md.in` and `metadata.yaml.in` with
values from `values.py` and references from `bibliography.bib`. It also draws the collocation points
in the folder `docs/figures`.
"""

import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from docs.article.values import values
from pyharness.history.figures import points_picture
from pyharness.views.pictures import saved

HERE = Path(__file__).parent
ARTICLE, METADATA, POINTS = "article.md", "metadata.yaml", "figure-points.svg"
_WIDTH = 120
# Code, formulas and links must not be broken across lines.
_WHOLE = re.compile(r"`[^`]*`|\$[^$]*\$|\[[^]]*\]\([^)]*\)")
_KEPT = ("|", "```", "$$", "#", "![")


def built(found: Mapping[str, Any]) -> dict[str, str]:
    """Return article and metadata, filled with the values of `values()`, by file name."""
    entries = references((HERE / "bibliography.bib").read_text(encoding="utf-8"))
    listed = "\n".join(f"- {each}" for each in entries)
    article = rendered(_template(ARTICLE), {**found, "references": listed})
    text = wrapped(article)
    (title,) = re.findall(r"^# (.*)$", text, re.MULTILINE)
    told = {"title": title, "abstract": abstract_of(text)}
    return {ARTICLE: text, METADATA: rendered(_template(METADATA), told)}


def rendered(template: str, found: Mapping[str, Any]) -> str:
    """Return a template filled with values; raise UndefinedError if a value is missing."""
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)
    return environment.from_string(template).render(found)


def abstract_of(text: str) -> str:
    """Return the abstract of the article as one line, without the keywords."""
    return " ".join(text.partition("## Abstract\n")[2].partition("\n**Keywords:**")[0].split())


def wrapped(text: str) -> str:
    """Return a Markdown text with paragraphs and items wrapped at 120 characters."""
    return "\n\n".join(map(_block, re.split(r"\n\n+", text.strip()))) + "\n"


def _block(block: str) -> str:
    if block.startswith(_KEPT):
        return block
    parts = re.split(r"\n(?=- )", block)
    return "\n".join(_paragraph(part) for part in parts)


def _paragraph(text: str) -> str:
    whole = _WHOLE.sub(lambda found: re.sub(r"\s+", "\0", found[0]), text)
    indent = "  " if text.startswith("- ") else ""
    lines = textwrap.wrap(
        " ".join(whole.split(None)), _WIDTH, subsequent_indent=indent,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    return "\n".join(lines).replace("\0", " ")


def references(text: str) -> list[str]:
    """Return the entries of a BibTeX file as list items, in the file's order."""
    found = []
    for body in re.findall(r"^@\w+\{[^,]*,\n(.*?)^\}", text, re.DOTALL | re.MULTILINE):
        field = dict(re.findall(r"(\w+)\s*=\s*\{(.*)\}", body))
        place = ", ".join(
            field[name]
            for name in ("journal", "edition", "institution", "publisher", "number")
            if name in field
        )
        volume = f", {field['volume']}" if "volume" in field else ""
        pages = f", {field['pages'].replace('--', '-')}" if "pages" in field else ""
        note = f". {field['note']}" if "note" in field else ""
        year = f" ({field['year']})" if "year" in field else ""
        who = field["author"].strip("{}").replace(" and ", ", ")
        found.append(f"{who}{year}. *{field['title']}*. {place}{volume}{pages}{note}.")
    return found


def _template(name: str) -> str:
    return (HERE / f"{name}.in").read_text(encoding="utf-8")


def main() -> None:
    """Write the article, its metadata and the picture of the collocation points."""
    for name, file in saved(points_picture(), POINTS).items():
        (HERE.parent / "figures" / name).write_bytes(file)
    for name, text in built(values()).items():
        (HERE / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
