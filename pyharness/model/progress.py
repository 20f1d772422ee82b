"""Reports of the progress of a long computation."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from pyharness.model.values import boolean

Progress = Callable[[int, int, str], None]
"""The type of a function that is called whenever a part of a computation is completed.

Its arguments are the numbers of completed parts and of all, and the name of the next part.
"""

# None if no bar was requested.
_bar: ContextVar[Any] = ContextVar("bar", default=None)


def no_progress(done: int, total: int, what: str) -> None:
    """Ignore a report of progress."""


@contextmanager
def bar_of_bodies(is_shown: bool) -> Iterator[None]:
    """Show tqdm's progress bar of bodies in this context, if `is_shown`."""
    if not is_shown:
        yield
        return
    from tqdm.auto import tqdm

    with tqdm(unit=" bodies", unit_scale=True) as bar:
        token = _bar.set(bar)
        try:
            yield
        finally:
            _bar.reset(token)


def has_bar() -> bool:
    """Return whether a progress bar of bodies is shown."""
    return _bar.get() is not None


def expect_bodies(n: int) -> None:
    """Set the number of bodies of the bar, if any, once."""
    bar = _bar.get()
    if bar is not None and bar.total is None:
        bar.reset(total=n)


def count_done(n: int) -> None:
    """Add n completed bodies to the bar, if any."""
    bar = _bar.get()
    if bar is not None:
        bar.update(n)


@contextmanager
def progress_of(choice: bool | Progress, what: str) -> Iterator[Progress]:
    """Provide a function that reports progress: the user's, or for True one with a bar."""
    if callable(choice):
        yield choice
    elif not boolean("progress", choice):
        yield no_progress
    else:
        from tqdm.auto import tqdm

        with tqdm(unit=f" {what}") as bar:

            def show(done: int, total: int, what: str) -> None:
                bar.total = total
                bar.update(done - bar.n)

            yield show
