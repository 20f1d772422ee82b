"""The type of the functions to which a long computation reports its progress."""

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""The type of a function that is called as a computation completes its parts.

Its arguments are the number of completed parts, the number of all parts, and the name of the part
that is computed next.
"""


def no_progress(done: int, total: int, what: str) -> None:
    """Ignore a report of progress; this is the default function of computations that report it.

    `done` is the number of completed parts, `total` the number of all parts, and `what` the name of
    the current part.
    """
