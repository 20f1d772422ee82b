"""Arrays of many bodies: checked, and dealt out to threads."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.pieces import share
from pyharness.model.trajectory import Array
from pyharness.model.values import whole

# Some milliseconds, after which Python looks at the user.
_PIECE = 1 << 18
# That no thread is worth.
_SMALL = 256
_MOST_THREADS = 1024


def many_starts(
    packed: Array, omega0: Any, t_end: Any, *, threads: int = 1, out: Array | None = None
) -> tuple[Array, NDArray[np.int8]]:
    """Return the ends of many starts of a packed scene, and their statuses: see `Solver.many`.

    InputError for what is not shape (n, 3), or no time, or none for each start.
    """
    starts, times = rows_of("omega0", omega0, 3), times_of(t_end)
    n = len(starts)
    if len(times) not in (1, n):
        raise InputError(f"t_end: shape {times.shape}; allowed: one number, or shape ({n},)")
    omega = np.empty((n, 3)) if out is None else buffer_of("out", out, (n, 3), "d")
    status = np.empty(n, np.int8)

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        own = times if len(times) == 1 else times[piece]
        extension().solve_packed_many(
            packed, starts[piece].T, own, given_up, omega[piece].T, status[piece]
        )

    for_each_piece(enter, n, threads_of(threads))
    return omega, status


def for_each_piece(work: Callable[[slice, NDArray[np.int32]], None], n: int, threads: int) -> None:
    """Call `work` for the pieces that n bodies fall into, in so many threads.

    It is given a number too, which is not 0 where the rest is not wanted any more.

    Pieces as large as each other: a body alone in one would be solved another way.
    """
    if not n:
        return
    given_up = np.zeros(1, dtype=np.int32)
    count = max(1, -(-n // _PIECE), min(threads, n // _SMALL))
    ends = [n * piece // count for piece in range(count + 1)]
    pieces = [slice(*each) for each in itertools.pairwise(ends)]
    share(lambda piece: work(piece, given_up), pieces, threads, given_up)


def threads_of(threads: int) -> int:
    """Return a number of threads; InputError where it is none."""
    found = whole("threads", threads)
    if not 1 <= found <= _MOST_THREADS:
        raise InputError(f"threads is {found}; allowed: 1 to {_MOST_THREADS}")
    return found


def times_of(t_end: Any) -> Array:
    """Return times in an array of one dimension; InputError for another."""
    found = numbers_of("t_end", t_end)
    if found.ndim > 1:
        raise InputError(f"t_end: shape {found.shape}; allowed: one number, or shape (n,)")
    return np.ascontiguousarray(np.atleast_1d(found))


def numbers_of(where: str, values: Any) -> Array:
    """Return an array of float64; InputError where it holds anything but real numbers."""
    try:
        found = np.asarray(values)
    except ValueError:
        raise InputError(f"{where}: rows of different lengths; allowed: an array") from None
    if found.dtype.kind not in "iuf" and found.size:
        raise InputError(f"{where}: an array of {found.dtype}; allowed: real numbers")
    return found.astype(float, copy=False)


def rows_of(where: str, values: Any, width: int) -> Array:
    """Return rows of so many numbers, side by side; InputError for another shape."""
    found = numbers_of(where, values)
    if found.ndim not in (1, 2) or found.shape[-1] != width:
        raise InputError(f"{where}: shape {found.shape}; allowed: ({width},) or (n, {width})")
    return np.ascontiguousarray(found.reshape(-1, width))


def buffer_of(where: str, array: Any, shape: tuple[int, ...], kind: str) -> Any:
    """Return an array that a kernel can write to; InputError for any other."""
    right = isinstance(array, np.ndarray) and array.shape == shape and array.dtype.char == kind
    if not (right and array.flags.c_contiguous and array.flags.writeable and array.flags.aligned):
        raise InputError(
            f"{where}: allowed: a writable array of {np.dtype(kind)}, shape {shape}, in one piece"
        )
    return array
