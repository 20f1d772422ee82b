"""Solvers that numba compiles at their first call, for `bench --ensemble`.

Each returns a function that computes omega (rad/s) at the end time `HORIZON`, shape (n, 3).
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np

from pyharness.bench.ensemble_contenders import HORIZON, EnsembleLoad, coefficients
from pyharness.model.trajectory import Array

LANES = 64  # bodies in a block


def in_threads(solve: Callable[[slice], None], n: int, threads: int, block: int) -> None:
    """Call `solve` for slices of at most `block` bodies, distributed over `threads` threads."""
    pieces = [slice(first, min(n, first + block)) for first in range(0, n, block)]
    if threads == 1:
        for piece in pieces:
            solve(piece)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(solve, pieces))


def numba_rk4(
    in_blocks: bool, load: EnsembleLoad, setting: float, threads: int
) -> Callable[[], Array]:
    """Return an integration by RK4, compiled by numba.

    If `in_blocks`, each step is a loop over the bodies of a block; else each body is integrated to
    the end before the next.
    """
    blocks, bodies = _numba_kernels()
    kernel = blocks if in_blocks else bodies
    starts, torques = load.omega0, load.acceleration
    found = np.empty_like(starts)
    steps = round(setting)
    piece = LANES * max(1, -(-load.n // (LANES * threads)))

    def solve(rows: slice) -> None:
        kernel(starts[rows], torques[rows], _rates(), HORIZON / steps, steps, found[rows])

    def run() -> Array:
        in_threads(solve, load.n, threads, piece)
        return found

    return run


@cache
def _rates() -> Array:
    return np.array(coefficients())


@cache
def _numba_kernels() -> tuple[Any, Any]:
    import numba

    def step(
        x: float, y: float, z: float, p: float, q: float, r: float,
        a: float, b: float, c: float, h: float,
    ) -> tuple[float, float, float]:  # fmt: skip
        half = 0.5 * h
        x1, y1, z1 = a * y * z + p, b * x * z + q, c * x * y + r
        u, v, w = x + half * x1, y + half * y1, z + half * z1
        x2, y2, z2 = a * v * w + p, b * u * w + q, c * u * v + r
        u, v, w = x + half * x2, y + half * y2, z + half * z2
        x3, y3, z3 = a * v * w + p, b * u * w + q, c * u * v + r
        u, v, w = x + h * x3, y + h * y3, z + h * z3
        x4, y4, z4 = a * v * w + p, b * u * w + q, c * u * v + r
        sixth = h / 6.0
        return (
            x + sixth * (x1 + 2.0 * (x2 + x3) + x4),
            y + sixth * (y1 + 2.0 * (y2 + y3) + y4),
            z + sixth * (z1 + 2.0 * (z2 + z3) + z4),
        )

    # The compiler may contract a product and a sum into one operation, as in our kernels. It may
    # not change the arithmetic in any other way.
    step = numba.njit(inline="always", fastmath={"contract"})(step)

    def blocks(
        starts: Array, torques: Array, rates: Array, h: float, steps: int, ends: Array
    ) -> None:
        n, (a, b, c) = len(starts), (rates[0], rates[1], rates[2])
        w, m = np.zeros((3, LANES)), np.zeros((3, LANES))
        for first in range(0, n, LANES):
            there = min(LANES, n - first)
            for i in range(there):
                for k in range(3):
                    w[k, i] = starts[first + i, k]
                    m[k, i] = torques[first + i, k]
            for _ in range(steps):
                for i in range(LANES):
                    x, y, z = step(w[0, i], w[1, i], w[2, i], m[0, i], m[1, i], m[2, i], a, b, c, h)
                    w[0, i] = x
                    w[1, i] = y
                    w[2, i] = z
            for i in range(there):
                for k in range(3):
                    ends[first + i, k] = w[k, i]

    def bodies(
        starts: Array, torques: Array, rates: Array, h: float, steps: int, ends: Array
    ) -> None:
        a, b, c = rates[0], rates[1], rates[2]
        for i in range(len(starts)):
            x, y, z = starts[i, 0], starts[i, 1], starts[i, 2]
            p, q, r = torques[i, 0], torques[i, 1], torques[i, 2]
            for _ in range(steps):
                x, y, z = step(x, y, z, p, q, r, a, b, c, h)
            ends[i, 0], ends[i, 1], ends[i, 2] = x, y, z

    compile_it = numba.njit(nogil=True, fastmath={"contract"})
    return compile_it(blocks), compile_it(bodies)
