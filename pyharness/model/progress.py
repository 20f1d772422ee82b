"""The type of the functions to which a long computation reports its progress."""

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called with the number of completed parts, the number of all parts, and the current part."""


def no_progress(done: int, total: int, what: str) -> None:
    """Report nothing; the default of every computation."""
