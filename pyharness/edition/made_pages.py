"""Parts of Markdown documents made from data."""

from collections.abc import Sequence


def table(head: str, rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; bars separate the column heads in `head`."""
    heads = head.split(" | ")
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)
