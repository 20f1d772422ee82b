"""Third-party solvers for `bench --ensemble`: NumPy, SciPy, heyoka, and a list of all.

Each returns a function that computes omega (rad/s) at the end time, shape (n, 3).
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np

from pyharness.bench import ensemble_compiled as compiled
from pyharness.bench.contenders import refuse_rounding
from pyharness.bench.ensemble_contenders import (
    HORIZON,
    EnsembleContender,
    EnsembleLoad,
    coefficients,
)
from pyharness.bench.heyoka_equations import heyoka_equations
from pyharness.model.attitude import quaternion_rates
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array

# Bodies in a batch. heyoka recommends 4 even if a register has 8 numbers, which is slower.
BATCHES = (4, 8, 16)
_BLOCK = 4096  # bodies whose arrays fit into the cache


def ensemble_peers() -> list[EnsembleContender]:
    """Return all third-party contenders, installed or not."""
    one = EnsembleContender
    blocks, alone = partial(compiled.numba_rk4, True), partial(compiled.numba_rk4, False)
    batches, ensembles = (
        {f"batches of {size}": partial(prepare, size=size) for size in BATCHES}
        for prepare in (heyoka_batch, _heyoka_ensemble)
    )
    return [
        one(
            "heyoka-batch",
            "tolerance",
            heyoka_batch,
            (1,),
            attitude=True,
            package="heyoka",
            variants=batches,
        ),
        one("heyoka-ensemble", "tolerance", _heyoka_ensemble, package="heyoka", variants=ensembles),
        one("numba-blocks-rk4", "steps", blocks, package="numba"),
        one("numba-bodies-rk4", "steps", alone, package="numba"),
        one("numpy-rk4", "steps", _numpy_rk4, package="numpy"),
        one("scipy-dop853-loop", "tolerance", _scipy_loop, (1,), package="scipy"),
    ]


def heyoka_batch(
    load: EnsembleLoad, setting: float, threads: int, size: int = BATCHES[0]
) -> Callable[[], Array]:
    """Return an integration by one heyoka batch integrator, `size` bodies at a time.

    It returns attitudes, shape (n, 4), if the load requests them. `threads` has no effect.
    """
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
            integrator, HORIZON, len(starts), begin, max_workers=threads
        )
        ends = np.array([each[0].state for each in found])
        return ends.transpose(0, 2, 1).reshape(-1, 3)[: load.n]

    return run


@cache
def _integrator(
    with_torque: bool, tolerance: float, size: int, scene: Scene | None = None,
    with_attitude: bool = False,
) -> Any:  # fmt: skip
    """Return a compiled batch integrator for `size` bodies: the benchmark's, or `scene`'s."""
    import heyoka

    x, y, z = heyoka.make_vars("x", "y", "z")
    a, b, c = coefficients()
    rates = [a * y * z, b * x * z, c * x * y]
    if with_torque:
        rates = [rate + heyoka.par[axis] for axis, rate in enumerate(rates)]
    equations = list(zip((x, y, z), rates, strict=True))
    if with_attitude:
        q = heyoka.make_vars("q0", "q1", "q2", "q3")
        equations += zip(q, quaternion_rates((x, y, z), q), strict=True)
    if scene is not None:
        equations = heyoka_equations(scene)
    start = np.ones((len(equations), size))
    return heyoka.taylor_adaptive_batch(equations, start, tol=tolerance, compact_mode=False)


def _batches(rows: Array, size: int) -> Array:
    """Return `rows`, shape (n, k), as (batches, k, size), padded with copies of the last row."""
    lacking = -len(rows) % size
    filled = np.concatenate([rows, np.repeat(rows[-1:], lacking, axis=0)])
    return np.ascontiguousarray(filled.reshape(-1, size, rows.shape[1]).transpose(0, 2, 1))


def _numpy_rk4(load: EnsembleLoad, setting: float, threads: int) -> Callable[[], Array]:
    """Return an integration by RK4 on NumPy arrays: a row per component, a column per body."""
    a, b, c = coefficients()
    starts, torques = load.omega0.T.copy(), load.acceleration.T.copy()
    found = np.empty_like(load.omega0)
    steps = round(setting)
    h = HORIZON / steps

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
        compiled.in_threads(solve, load.n, threads, _BLOCK)
        return found

    return run


def _scipy_loop(load: EnsembleLoad, setting: float, threads: int) -> Callable[[], Array]:
    """Return an integration by SciPy's `solve_ivp`, body by body; `threads` has no effect."""
    from scipy.integrate import solve_ivp

    refuse_rounding("solve_ivp", setting)
    a, b, c = coefficients()
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
                slope, (0.0, HORIZON), start, method="DOP853", rtol=setting, atol=setting * size
            )
            ends.append(found.y[:, -1])
        return np.array(ends)

    return run
