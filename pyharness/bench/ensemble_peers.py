"""Third-party solvers for `bench --ensemble`.

Each returns a function that integrates to the end time, and returns omega (rad/s), shape (n, 3), or
the requested attitudes, shape (n, 4).
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Any

import numpy as np

from pyharness.bench.contenders import refuse_rounding
from pyharness.bench.ensemble_contenders import (
    MOMENTS,
    EnsembleContender,
    EnsembleLoad,
    coefficients,
)
from pyharness.bench.peers import heyoka_equations
from pyharness.model.attitude import IDENTITY
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array

# Numbers of bodies in a batch; heyoka recommends 4.
BATCHES = (4, 8, 16)
LANES = 64  # number of bodies in a block
_BLOCK = 4096  # number of bodies whose arrays fit into the cache


def ensemble_peers() -> list[EnsembleContender]:
    """Return all third-party contenders, installed or not."""
    one = EnsembleContender
    blocks, alone = partial(numba_rk4, True), partial(numba_rk4, False)

    def heyoka(prepare: Callable[..., Callable[[], Array]]) -> dict[str, Any]:
        variants = {f"batches of {size}": partial(prepare, size=size) for size in BATCHES}
        return {"prepare": prepare, "package": "heyoka", "variants": variants}

    return [
        one("heyoka-batch", "tolerance", threads=(1,), attitude=True, **heyoka(heyoka_batch)),
        one("heyoka-ensemble", "tolerance", **heyoka(_heyoka_ensemble)),
        one("numba-blocks-rk4", "steps", blocks, package="numba"),
        one("numba-bodies-rk4", "steps", alone, package="numba"),
        one("numpy-rk4", "steps", _numpy_rk4, package="numpy"),
        one("scipy-dop853-loop", "tolerance", _scipy_loop, (1,), package="scipy"),
    ]


def heyoka_batch(
    load: EnsembleLoad, setting: float, threads: int, size: int = BATCHES[0]
) -> Callable[[], Array]:
    """Return an integration by heyoka in batches of `size` bodies; `threads` has no effect."""
    of_state = isinstance(load.scene.torque, StateTorque)
    scene = load.scene if of_state else None
    with_attitude = load.attitude0 is not None
    integrator = _integrator(load.torque is not None, setting, size, scene, with_attitude)
    first, wanted = load.omega0, slice(0, 3)
    if load.attitude0 is not None:
        first, wanted = np.hstack([first, load.attitude0]), slice(3, 7)
    elif load.scene.attitude is not None:
        first = np.hstack([first, np.tile(load.scene.attitude, (load.n, 1))])
    starts, torques = _batches(first, size), _batches(load.acceleration, size)
    ends = np.empty_like(starts)
    state, parameters = integrator.state, integrator.pars

    def run() -> Array:
        for k in range(len(starts)):
            integrator.set_time(0.0)
            state[:] = starts[k]
            if len(parameters):
                parameters[:] = torques[k]
            integrator.propagate_until(load.horizon)
            ends[k] = state
        return ends.transpose(0, 2, 1).reshape(-1, first.shape[1])[: load.n, wanted]

    return run


def _heyoka_ensemble(
    load: EnsembleLoad, setting: float, threads: int, size: int = BATCHES[0]
) -> Callable[[], Array]:
    import heyoka

    integrator = _integrator(load.torque is not None, setting, size)
    starts, torques = _batches(load.omega0, size), _batches(load.acceleration, size)

    def begin(copy: Any, k: int) -> Any:
        copy.set_time(0.0)
        copy.state[:] = starts[k]
        if len(copy.pars):
            copy.pars[:] = torques[k]
        return copy

    def run() -> Array:
        found = heyoka.ensemble_propagate_until_batch(
            integrator, load.horizon, len(starts), begin, max_workers=threads
        )
        ends = np.array([each[0].state for each in found])
        return ends.transpose(0, 2, 1).reshape(-1, 3)[: load.n]

    return run


@cache
def _integrator(
    with_torque: bool, tolerance: float, size: int, scene: Scene | None = None,
    with_attitude: bool = False,
) -> Any:  # fmt: skip
    import heyoka

    attitude = IDENTITY if with_attitude else None
    equations = heyoka_equations(scene or Scene("", (0.0, 0.0, 0.0), MOMENTS, attitude=attitude))
    if scene is None and with_torque:
        for axis, (component, rate) in enumerate(equations[:3]):
            equations[axis] = component, rate + heyoka.par[axis]
    start = np.ones((len(equations), size))
    return heyoka.taylor_adaptive_batch(equations, start, tol=tolerance, compact_mode=False)


def _batches(rows: Array, size: int) -> Array:
    """Return `rows`, shape (n, k), in the shape (batches, k, size), padded with the last row."""
    lacking = -len(rows) % size
    filled = np.concatenate([rows, np.repeat(rows[-1:], lacking, axis=0)])
    return np.ascontiguousarray(filled.reshape(-1, size, rows.shape[1]).transpose(0, 2, 1))


def _numpy_rk4(load: EnsembleLoad, setting: float, threads: int) -> Callable[[], Array]:
    a, b, c = coefficients()
    starts, torques = load.omega0.T.copy(), load.acceleration.T.copy()
    found = np.empty_like(load.omega0)
    steps = round(setting)
    h = load.horizon / steps

    def slope(w: Array, torque: Array) -> Array:
        x, y, z = w
        rates = np.empty_like(w)
        np.multiply(y, a * z, out=rates[0])
        np.multiply(z, b * x, out=rates[1])
        np.multiply(x, c * y, out=rates[2])
        if load.torque is not None:
            rates += torque
        return rates

    def solve(piece: slice) -> None:
        w, torque = starts[:, piece], torques[:, piece]
        for _ in range(steps):
            k1 = slope(w, torque)
            k2 = slope(w + (0.5 * h) * k1, torque)
            k3 = slope(w + (0.5 * h) * k2, torque)
            k4 = slope(w + h * k3, torque)
            k2 += k3
            k2 *= 2.0
            k1 += k2
            k1 += k4
            k1 *= h / 6.0
            w = w + k1
        found[piece] = w.T

    def run() -> Array:
        in_threads(solve, load.n, threads, _BLOCK)
        return found

    return run


def _scipy_loop(load: EnsembleLoad, setting: float, threads: int) -> Callable[[], Array]:
    from scipy.integrate import solve_ivp

    refuse_rounding("solve_ivp", setting)
    a, b, c = coefficients()
    end = load.horizon
    bodies = list(zip(load.omega0.tolist(), load.acceleration.tolist(), strict=True))

    def run() -> Array:
        ends = []
        for start, (p, q, r) in bodies:

            def slope(
                _: float, w: Any, p: float = p, q: float = q, r: float = r
            ) -> tuple[float, float, float]:
                x, y, z = w.tolist()
                return a * y * z + p, b * x * z + q, c * x * y + r

            size = max(map(abs, start))
            found = solve_ivp(
                slope, (0.0, end), start, method="DOP853", rtol=setting, atol=setting * size
            )
            ends.append(found.y[:, -1])
        return np.array(ends)

    return run


def in_threads(solve: Callable[[slice], None], n: int, threads: int, block: int) -> None:
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

    If `in_blocks`, each step is a loop over a block of bodies.
    """
    blocks, bodies = _numba_kernels()
    kernel = blocks if in_blocks else bodies
    starts, torques = load.omega0, load.acceleration
    found = np.empty_like(starts)
    steps, rates = round(setting), np.array(coefficients())
    piece = LANES * max(1, -(-load.n // (LANES * threads)))

    def solve(rows: slice) -> None:
        kernel(starts[rows], torques[rows], rates, load.horizon / steps, steps, found[rows])

    def run() -> Array:
        in_threads(solve, load.n, threads, piece)
        return found

    return run


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

    # As in our kernels, the compiler may only contract a product and a sum into one operation.
    step = numba.njit(inline="always", fastmath={"contract"})(step)

    def blocks(
        starts: Array, torques: Array, rates: Array, h: float, steps: int, ends: Array
    ) -> None:
        n, (a, b, c) = len(starts), (rates[0], rates[1], rates[2])
        w, m = np.zeros((3, LANES)), np.zeros((3, LANES))
        for first in range(0, n, LANES):
            there = min(LANES, n - first)
            w[:, :there] = starts[first : first + there].T
            m[:, :there] = torques[first : first + there].T
            for _ in range(steps):
                for i in range(LANES):
                    x, y, z = step(w[0, i], w[1, i], w[2, i], m[0, i], m[1, i], m[2, i], a, b, c, h)
                    w[0, i], w[1, i], w[2, i] = x, y, z
            ends[first : first + there] = w[:, :there].T

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
