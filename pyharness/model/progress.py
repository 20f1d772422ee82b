"""The type of the functions to which a long computation reports its progress."""

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""A function with three arguments: the numbers of completed and of all parts, the current part."""


def no_progress(done: int, total: int, what: str) -> None:
    """Report nothing; this is the default of every computation that can report its progress.

    `done` is the number of completed parts, `total` the number of all parts, and `what` the name of
    the current part.
    """
