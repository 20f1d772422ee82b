"""Division of many bodies into ranges, which threads process."""

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from pyharness.model.progress import count_done, expect_bodies, has_bar

# Most bodies in a piece. They take some milliseconds, after which Python checks for a signal.
_PIECE = 1 << 18
# Fewest bodies per thread. With fewer, a further thread costs more time than it saves.
_SMALL = 256
# Fewest pieces with a progress bar.
_REPORTS = 100


def share(
    work: Callable[[slice], None],
    pieces: Sequence[slice],
    threads: int,
    given_up: NDArray[np.int32],
) -> None:
    """Call `work` for each of `pieces`, ranges of bodies, in at most `threads` threads.

    After an exception, as by Ctrl-C, `given_up[0]` is 1; kernels poll it and return.
    """
    if threads == 1 or len(pieces) < 2:
        # Only the main thread receives signals; this is usually the calling one.
        for piece in pieces:
            work(piece)
            count_done(piece.stop - piece.start)
        return
    with ThreadPoolExecutor(min(threads, len(pieces))) as pool:
        jobs = [pool.submit(work, piece) for piece in pieces]
        try:
            for job, piece in zip(jobs, pieces, strict=True):
                job.result()
                count_done(piece.stop - piece.start)
        except BaseException:
            # Only the main thread receives signals; the others poll this number.
            given_up[0] = 1
            pool.shutdown(cancel_futures=True)
            raise


def for_each_piece(work: Callable[[slice, NDArray[np.int32]], None], n: int, threads: int) -> None:
    """Call `work` in threads for pieces of nearly equal size, with `given_up` of `share`."""
    if not n:
        return
    given_up = np.zeros(1, dtype=np.int32)
    count = max(1, -(-n // _PIECE), min(threads, n // _SMALL))
    if has_bar():
        expect_bodies(n)
        count = max(count, min(_REPORTS, n))
    ends = [n * piece // count for piece in range(count + 1)]
    pieces = [slice(first, last) for first, last in itertools.pairwise(ends)]
    share(lambda piece: work(piece, given_up), pieces, threads, given_up)
