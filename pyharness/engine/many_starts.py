"""Solution of a prepared scene from many initial angular velocities."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.arrays import buffer_of, check_rows, rows_of, threads_of
from pyharness.model.extension import extension
from pyharness.model.pieces import for_each_piece
from pyharness.model.trajectory import Array


def many_starts(
    packed: Array, omega0: Any, t_end: Any, *, threads: int = 1, out: Array | None = None
) -> tuple[Array, NDArray[np.int8]]:
    """Return final omegas (rad/s), (n, 3), and statuses, or raise InputError for wrong shapes."""
    starts, times = rows_of("omega0", omega0, 3), rows_of("t_end", t_end)
    n = len(starts)
    check_rows("t_end", times, n)
    omega = np.empty((n, 3)) if out is None else buffer_of("out", out, (n, 3), "d")
    if np.may_share_memory(starts, omega):  # a kernel may write a result before it reads the start
        starts = starts.copy()
    status = np.empty(n, np.int8)

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        own = times if len(times) == 1 else times[piece]
        extension().solve_packed_many(
            packed, starts[piece].T, own, given_up, omega[piece].T, status[piece]
        )

    for_each_piece(enter, n, threads_of(threads))
    return omega, status
