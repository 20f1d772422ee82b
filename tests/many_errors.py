"""`python -m tests.many_errors 1000000 SEED`: check that many bodies keep the tolerance of one.

Random bodies, without torque and under constant torque, ramps and waves, are solved to tolerances
of 1e-3 to 1e-12. The truth is `solve_many` at 1e-15, where it leaves all bodies to the single
kernel. The only error of this truth is rounding.
"""

import sys
from typing import Any

import numpy as np

from pyharness import Ensemble, Scene, TorqueLaw, solve, solve_many
from pyharness.model.trajectory import Array

_BATCH = 20_000
KINDS = ("free", "constant", "ramp", "waves")
_ROUNDING = 8e-15  # rounding error for each unit of error amplification
_BODY = Scene("", (1.0, 1.0, 1.0), moments=(1.0, 1.0, 1.0))


def bodies(kind: str, n: int, seed: int, decades: float = 3.0) -> dict[str, Any]:
    """Draw bodies, starts, times and torques of noticeable size."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    moments = 10.0 ** (decades * rng.uniform(-0.5, 0.5, (n, 3)))
    omega0 = rng.standard_normal((n, 3)) * 10.0 ** rng.uniform(-2, 2, (n, 1))
    rate = np.abs(omega0).max(axis=1, keepdims=True)
    drawn = {"moments": moments, "omega": omega0, "t_end": rng.uniform(0.3, 10.0, n) / rate[:, 0]}
    if kind != "free":
        drawn["torque_constant"] = moments * rate**2 * rng.standard_normal((n, 3))
    if kind in ("ramp", "waves"):
        drawn["torque_rate"] = 0.1 * moments * rate**3 * rng.standard_normal((n, 3))
    if kind == "waves":
        for name in ("sines", "cosines"):
            amplitude = moments * rate**2 * rng.standard_normal((n, 3))
            frequency = rate * rng.uniform(0.1, 3.0, (n, 1))
            drawn[name] = np.concatenate([amplitude, frequency], axis=1)[:, None, :]
    drawn["t_end"][::3] *= -1.0
    return drawn


def scene_of(drawn: dict[str, Any], row: int) -> Scene:
    waves = {
        name: [(tuple(wave[:3]), wave[3]) for wave in drawn[name][row]] if name in drawn else ()
        for name in ("sines", "cosines")
    }
    zero = np.zeros((row + 1, 3))
    law = TorqueLaw(
        drawn.get("torque_constant", zero)[row], drawn.get("torque_rate", zero)[row],
        waves["sines"], waves["cosines"],
    )  # fmt: skip
    return Scene("", drawn["omega"][row], moments=drawn["moments"][row], torque=law)


def exceeding(
    drawn: dict[str, Any], tolerance: float, found: Ensemble, truth: Ensemble
) -> tuple[list[int], list[int], Array]:
    """Return the bodies beyond the tolerance, those of them that are so alone, and all errors.

    Errors are relative to the tolerance; they are NaN for a body without result.
    """
    done = (found.status == 0) & np.isin(truth.status, (0, 6))
    ends = np.maximum(np.abs(truth.omega), np.abs(drawn["omega"])).max(axis=1)
    error = np.where(done, np.abs(found.omega - truth.omega).max(axis=1) / ends, np.nan)
    beyond, alike = [], []
    for body in np.flatnonzero(error > tolerance).tolist():
        # The tolerance is relative to the largest omega of the trajectory, and amplified rounding
        # is allowed in addition.
        scene, end = scene_of(drawn, body), float(drawn["t_end"][body])
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
    """Print the outcomes of `count` bodies; return 1 if one is worse than its single solution."""
    generator = np.random.default_rng(seed)
    most: dict[str, float] = {}
    solved = n_beyond = n_alike = 0
    for number in range(-(-count // _BATCH)):
        kind, tolerance = KINDS[number % len(KINDS)], 10.0 ** -float(generator.integers(3, 13))
        n, decades = min(_BATCH, count), float(generator.choice([0.5, 2.0, 4.0]))
        drawn = bodies(kind, n, int(generator.integers(2**31)), decades)
        if kind != "free":
            drawn["torque_constant"] *= 10.0 ** generator.uniform(-2.0, 0.5, (n, 1))
        found, truth = (solve_many(_BODY, tolerance=each, **drawn) for each in (tolerance, 1e-15))
        beyond, alike, shares = exceeding(drawn, tolerance, found, truth)
        for body in sorted({*beyond} - {*alike}):
            print(f"{kind} at {tolerance:g}: {shares[body]:.2g} of it, {scene_of(drawn, body)}")
        solved += int(np.isfinite(shares).sum())
        n_beyond += len(beyond)
        n_alike += len(alike)
        name = f"{kind} at {tolerance:g}"
        most[name] = max(most.get(name, 0.0), float(np.nanmax(shares)))
    for name, share in sorted(most.items()):
        print(f"{name}: most {share:.2g} of the tolerance")
    print(f"{solved} bodies of seed {seed}: {n_beyond} exceed, {n_alike} of them by themselves too")
    return 1 if n_beyond > n_alike else 0


if __name__ == "__main__":
    number, seed = [*sys.argv[1:], *("100000", "1")[len(sys.argv) - 1 :]]
    sys.exit(main(int(number), int(seed)))
