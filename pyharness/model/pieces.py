"""Computations for many bodies, divided into pieces that threads process."""

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

# Bodies in a piece: some milliseconds of work, after which Python checks for a signal.
_PIECE = 1 << 18
# The fewest bodies for which a further thread is worth its cost.
_SMALL = 256


def share(
    work: Callable[[slice], None],
    pieces: Sequence[slice],
    threads: int,
    given_up: NDArray[np.int32],
) -> None:
    """Call `work` for each piece, a range of bodies, in at most `threads` threads.

    `given_up` is an array of one number, 0, which the kernels poll. An exception, for example after
    Ctrl-C, sets it to 1, so that the kernels in all threads end.
    """
    if threads == 1 or len(pieces) < 2:
        # The work is done in this thread and in no other, because Python delivers signals here.
        for piece in pieces:
            work(piece)
        return
    with ThreadPoolExecutor(min(threads, len(pieces))) as pool:
        jobs = [pool.submit(work, piece) for piece in pieces]
        try:
            for job in jobs:
                job.result()
        except BaseException:
            # Signals don't reach the other threads.
            given_up[0] = 1
            pool.shutdown(cancel_futures=True)
            raise


def for_each_piece(work: Callable[[slice, NDArray[np.int32]], None], n: int, threads: int) -> None:
    """Divide n bodies into pieces, and call `work` for each piece in at most `threads` threads.

    `work` takes a piece, which is a slice of the bodies, and an array of one number. The number
    becomes 1 after an interrupt by the user, and the work should then end. All pieces have nearly
    the same size, so that no thread waits long for another.
    """
    if not n:
        return
    given_up = np.zeros(1, dtype=np.int32)
    count = max(1, -(-n // _PIECE), min(threads, n // _SMALL))
    ends = [n * piece // count for piece in range(count + 1)]
    pieces = [slice(*each) for each in itertools.pairwise(ends)]
    share(lambda piece: work(piece, given_up), pieces, threads, given_up)
