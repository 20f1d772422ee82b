"""`python -m tests.many_errors 1000000 SEED`: whether many bodies keep the tolerance of one.

Bodies over four decades, without torque and under constant torque, ramps and waves, to tolerances
of 1e-3 to 1e-12. The truth is the single kernel at 1e-15, to which `solve_many` leaves all of
them; what is left of a body's tolerance then is the rounding of its own motion.
"""

import sys
from typing import Any

import numpy as np

from pyharness import Ensemble, Scene, TorqueLaw, solve, solve_many
from pyharness.model.trajectory import Array

_BATCH = 20_000
_KINDS = ("no torque", "constant", "ramp", "wave")
_ROUNDING = 8e-15  # for each factor of growth
_BODY = Scene("", (1.0, 1.0, 1.0), moments=(1.0, 1.0, 1.0))


def drawn(generator: np.random.Generator, n: int, kind: int) -> tuple[Array, dict[str, Any]]:
    """Return times and arrays for `solve_many`."""
    narrow = generator.random() < 0.5
    moments = (
        generator.uniform(1, 3, (n, 3)) if narrow else 10.0 ** generator.uniform(-2, 2, (n, 3))
    )
    omega0 = generator.standard_normal((n, 3)) * 10.0 ** generator.uniform(-2, 2, (n, 1))
    fastest = np.abs(omega0).max(axis=1, keepdims=True)
    times = 3.0 * generator.uniform(0.1, 1) * 10.0 ** generator.uniform(-0.5, 1, n) / fastest[:, 0]
    arrays: dict[str, Any] = {"moments": moments, "omega0": omega0}

    def torque(scale: Array) -> Array:
        return np.asarray(generator.standard_normal((n, 3)) * moments * scale)

    if kind > 0:
        arrays["torque_constant"] = torque(fastest**2 * 10.0 ** generator.uniform(-2, 0.5, (n, 1)))
    if kind > 1:
        arrays["torque_rate"] = torque(0.1 * fastest**3)
    if kind > 2:
        frequency = generator.uniform(0.1, 3, (n, 1)) * fastest
        arrays["sines"] = np.concatenate([torque(fastest**2), frequency], axis=1)[:, None, :]
    return times, arrays


def scene_of(arrays: dict[str, Any], body: int) -> Scene:
    """Return one body as a scene."""
    rows: dict[str, Any] = {name: array[body].tolist() for name, array in arrays.items()}
    waves = [(wave[:3], wave[3]) for wave in rows.get("sines", [])]
    law = TorqueLaw(rows.get("torque_constant", ()), rows.get("torque_rate", ()), waves)
    return Scene("", rows["omega0"], moments=rows["moments"], torque=law)


def exceeding(
    times: Array, arrays: dict[str, Any], tolerance: float, found: Ensemble, truth: Ensemble
) -> tuple[list[int], list[int], Array]:
    """Return bodies beyond their tolerance, those whose single solution is too, and all errors.

    Errors are over the tolerance; NaN where a body has none.
    """
    done = (found.status == 0) & np.isin(truth.status, (0, 6))
    ends = np.maximum(np.abs(truth.omega), np.abs(arrays["omega0"])).max(axis=1)
    error = np.where(done, np.abs(found.omega - truth.omega).max(axis=1) / ends, np.nan)
    beyond, alike = [], []
    for body in np.flatnonzero(error > tolerance).tolist():
        # The promise is of the largest omega on the way, and of what rounding may grow to.
        scene, end = scene_of(arrays, body), float(times[body])
        way = solve(scene, np.linspace(0.0, end, 401)[1:], "taylor", 1e-15)
        largest = max(float(np.abs(way.omega).max()), float(ends[body]))
        allowed = tolerance + _ROUNDING * (way.growth or 1.0)
        error[body] *= ends[body] / largest
        if error[body] > allowed:
            beyond.append(body)
            single = solve(scene, [end], "auto", tolerance).omega[-1]
            if np.abs(single - truth.omega[body]).max() / largest > allowed:
                alike.append(body)
    return beyond, alike, error / tolerance


def main(count: int, seed: int) -> int:
    """Print what became of `count` bodies; 1 where one exceeds what its single solution keeps."""
    generator = np.random.default_rng(seed)
    most: dict[str, float] = {}
    solved = n_beyond = n_alike = 0
    for number in range(-(-count // _BATCH)):
        kind, tolerance = number % len(_KINDS), 10.0 ** -float(generator.integers(3, 13))
        times, arrays = drawn(generator, min(_BATCH, count), kind)
        found, truth = (
            solve_many(_BODY, times, tolerance=each, **arrays) for each in (tolerance, 1e-15)
        )
        beyond, alike, shares = exceeding(times, arrays, tolerance, found, truth)
        for body in sorted({*beyond} - {*alike}):
            scene = scene_of(arrays, body)
            print(f"{_KINDS[kind]} at {tolerance:g}: {shares[body]:.2g} of it, {scene}")
        solved += int(np.isfinite(shares).sum())
        n_beyond += len(beyond)
        n_alike += len(alike)
        name = f"{_KINDS[kind]} at {tolerance:g}"
        most[name] = max(most.get(name, 0.0), float(np.nanmax(shares)))
    for name, share in sorted(most.items()):
        print(f"{name}: most {share:.2g} of the tolerance")
    print(f"{solved} bodies of seed {seed}: {n_beyond} exceed, {n_alike} of them by themselves too")
    return 1 if n_beyond > n_alike else 0


if __name__ == "__main__":
    number, seed = [*sys.argv[1:], *("100000", "1")[len(sys.argv) - 1 :]]
    sys.exit(main(int(number), int(seed)))
