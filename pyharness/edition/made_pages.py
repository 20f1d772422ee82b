"""Parts of Markdown documents made from data."""

import textwrap
from collections.abc import Sequence

_WIDTH = 120  # of the lines of a document, in characters


def paragraphs(text: str, indent: str = "") -> str:
    """Return paragraphs wrapped at 120 columns; lines after the first are indented."""
    return "\n\n".join(_filled(part, indent) for part in text.split("\n\n")) + "\n"


def table(head: str, rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; bars separate the column heads in `head`."""
    heads = head.split(" | ")
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _filled(text: str, indent: str) -> str:
    words = " ".join(text.split())
    return textwrap.fill(
        words, _WIDTH, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False
    )
