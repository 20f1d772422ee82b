"""Progress bars, and the division of many bodies among threads."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.values import boolean

Progress = Callable[[int, int, str], None]
"""The type of a function that is called whenever a part of a computation is completed.

Its arguments are the numbers of completed parts and of all parts, and the name of the next part.
"""

_PIECE = 1 << 18  # most bodies in a piece, some milliseconds; Python checks for signals after it
_SMALL = 256  # fewest bodies for which a further thread saves time
_REPORTS = 100  # fewest pieces with a progress bar
_bar: ContextVar[Any] = ContextVar("bar", default=None)  # None if no bar was requested


def no_progress(done: int, total: int, what: str) -> None:
    pass


@contextmanager
def bar_of_bodies(is_shown: bool) -> Iterator[None]:
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


def expect_bodies(n: int) -> None:
    bar = _bar.get()
    if bar is not None and bar.total is None:
        bar.reset(total=n)


def count_done(n: int) -> None:
    bar = _bar.get()
    if bar is not None:
        bar.update(n)


@contextmanager
def progress_of(choice: bool | Progress, what: str) -> Iterator[Progress]:
    """Yield `choice` if it is a function, else one that updates a bar (True) or does nothing."""
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


def for_each_piece(
    work: Callable[[slice, NDArray[np.int32]], object],
    n: int,
    threads: int,
    pieces: Sequence[slice] | None = None,
) -> None:
    """Call ``work(piece, given_up)`` in threads for each of `pieces`.

    By default these are slices of n bodies. With several threads, an exception sets `given_up[0]`
    to 1, which ends kernels.
    """
    if not n:
        return
    given_up = np.zeros(1, dtype=np.int32)
    if pieces is None:
        count = max(1, -(-n // _PIECE), min(threads, n // _SMALL))
        if _bar.get() is not None:
            expect_bodies(n)
            count = max(count, min(_REPORTS, n))
        ends = [n * piece // count for piece in range(count + 1)]
        pieces = [slice(first, last) for first, last in itertools.pairwise(ends)]
    if threads == 1 or len(pieces) < 2:
        for piece in pieces:
            work(piece, given_up)
            count_done(piece.stop - piece.start)
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(min(threads, len(pieces))) as pool:
        jobs = [pool.submit(work, piece, given_up) for piece in pieces]
        try:
            for job, piece in zip(jobs, pieces, strict=True):
                job.result()
                count_done(piece.stop - piece.start)
        except BaseException:
            # Only the main thread receives signals; the others poll this number.
            given_up[0] = 1
            pool.shutdown(cancel_futures=True)
            raise
