"""Parts of Markdown documents, made from data."""

from collections.abc import Sequence

from pyharness.views.render import markdown_table


def table(head: str, rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; `head` has the heads of columns, separated by bars."""
    return markdown_table([head.split(" | "), *rows])
