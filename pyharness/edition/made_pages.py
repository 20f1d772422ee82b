"""Parts of Markdown documents made from data."""

import textwrap
from collections.abc import Sequence

_WIDTH = 120  # of the lines of a document, in characters


def paragraphs(text: str) -> str:
    """Return paragraphs wrapped at 120 columns."""
    wrapped = textwrap.TextWrapper(_WIDTH, break_on_hyphens=False, break_long_words=False)
    return "\n\n".join(wrapped.fill(" ".join(part.split())) for part in text.split("\n\n")) + "\n"


def table(head: str, rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; bars separate the column heads in `head`."""
    heads = head.split(" | ")
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)
