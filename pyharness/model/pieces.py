"""Work on many bodies, in pieces that threads take."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray


def share(
    work: Callable[[slice], None],
    pieces: Sequence[slice],
    threads: int,
    given_up: NDArray[np.int32],
) -> None:
    """Call `work` for each piece, in so many threads.

    What is raised, as by Ctrl-C, sets `given_up`, which kernels look at now and then.
    """
    if threads == 1 or len(pieces) < 2:
        # Here and not in a thread of its own: Python gives signals to this one.
        for piece in pieces:
            work(piece)
        return
    with ThreadPoolExecutor(min(threads, len(pieces))) as pool:
        jobs = [pool.submit(work, piece) for piece in pieces]
        try:
            for job in jobs:
                job.result()
        except BaseException:
            # Signals don't reach the others.
            given_up[0] = 1
            pool.shutdown(cancel_futures=True)
            raise
