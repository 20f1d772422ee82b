"""`python -m tests.campaigns.default_campaign COUNT SEED`: which tolerance suits ordinary motions.

Each motion is of a kind that users integrate: free tumbling, a driven body, heavy tops, detumbling
by magnetic torquers, gravity gradients, a slew, wheels, a fly-by. The command prints, for each
tolerance, how many of COUNT motions are not `complete`.
"""

import sys
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np

from pyharness import Scene, TorqueLaw, solve, torques
from pyharness.model.values import Triple

TOLERANCES = (1e-12, 1e-11, 1e-10, 1e-9)
_GRAVITY = 9.81  # m/s2


def _body(source: Random, size: float = 1.0) -> Triple:
    low, middle = sorted(source.uniform(0.3, 1.0) for _ in range(2))
    return low * size, middle * size, source.uniform(middle, 0.99 * (low + middle)) * size


def _vector(source: Random, size: float) -> Any:
    return size * np.array([source.gauss(0.0, 1.0) for _ in range(3)])


def _unit(source: Random) -> Any:
    q = np.array([source.gauss(0.0, 1.0) for _ in range(4)])
    return q / np.linalg.norm(q)


def _free(source: Random) -> tuple[Scene, float]:
    scene = Scene("", _vector(source, 1.0), _body(source), attitude=_unit(source))
    return scene, 10 ** source.uniform(0.0, 4.0)


def _driven(source: Random) -> tuple[Scene, float]:
    wave = _vector(source, 0.3), source.uniform(0.1, 3.0)
    law = TorqueLaw(_vector(source, 0.1), sines=[wave])
    return Scene("", _vector(source, 1.0), _body(source), torque=law), source.uniform(5.0, 50.0)


def _top(source: Random) -> tuple[Scene, float]:
    weight = source.uniform(0.5, 2.0) * _GRAVITY * 0.05

    def gravity(t: Any, w: Any, q: Any) -> Any:
        q0, q1, q2, q3 = q
        down = [2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1)]
        return [-weight * down[1], weight * down[0], 0.0 * t]

    i1, spin = source.uniform(0.002, 0.01), source.uniform(20.0, 200.0)
    i2 = i1 if source.random() < 0.5 else i1 * source.uniform(0.8, 1.2)
    omega = *_vector(source, 0.5)[:2], spin
    tilt = source.uniform(0.1, 1.0)
    turned = np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0
    body = i1, i2, source.uniform(0.3, 1.0) * i1
    return Scene("", omega, body, torque=gravity, attitude=turned), source.uniform(1.0, 10.0)


def _detumbling(source: Random) -> tuple[Scene, float]:
    turn = source.uniform(0.8e-3, 1.2e-3)  # rad/s
    wave = 2e-5 * np.array([0.3, 1.0, 0.0]), 2.0 * turn
    other = 2e-5 * np.array([0.0, 0.3, 1.0]), 2.0 * turn
    field = TorqueLaw(_vector(source, 1e-5), sines=[wave], cosines=[other], frame="space")
    torque = torques.magnetic_damping(10 ** source.uniform(4.5, 6.0), field)
    scene = Scene("", _vector(source, 0.05), _body(source, 5.0), torque=torque)
    return scene, source.uniform(600.0, 5400.0)


def _orbiting(source: Random) -> tuple[Scene, float]:
    body, rate = _body(source, 100.0), 1.1e-3
    gradient = torques.gravity_gradient(body, rate)
    omega = np.array([0.0, rate, 0.0]) + _vector(source, 2e-4)
    scene = Scene("", omega, body, torque=gradient, attitude=_unit(source))
    return scene, source.uniform(1.0, 5.0) * 5700.0


def _slew(source: Random) -> tuple[Scene, float]:
    stiffness = source.uniform(0.05, 1.0)
    torque = torques.attitude_control(stiffness, 1.4 * np.sqrt(stiffness), _unit(source))
    scene = Scene("", _vector(source, 0.1), _body(source), torque=torque, attitude=_unit(source))
    return scene, source.uniform(10.0, 100.0)


def _wheels(source: Random) -> tuple[Scene, float]:
    torque = torques.wheels(_vector(source, 0.5))
    return Scene("", _vector(source, 0.5), _body(source), torque=torque), source.uniform(10, 100)


def _fly_by(source: Random) -> tuple[Scene, float]:
    body, nearest = _body(source, 1.0), source.uniform(3.0, 6.0) * 3600.0
    strength = 3.0 * 3.986e14 / source.uniform(2e7, 6e7) ** 3

    def tide(t: Any, w: Any, q: Any) -> Any:
        s = (t - nearest) / source_width
        q0, q1, q2, q3 = q
        x = q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3
        y, z = 2.0 * (q1 * q2 - q0 * q3), 2.0 * (q1 * q3 + q0 * q2)
        k = strength / (1.0 + s * s) ** 1.5
        i1, i2, i3 = body
        return [k * (i3 - i2) * y * z, k * (i1 - i3) * z * x, k * (i2 - i1) * x * y]

    source_width = source.uniform(1.0, 3.0) * 3600.0
    omega = _vector(source, 2e-5 * source.uniform(1.0, 5.0))
    return Scene("", omega, body, torque=tide, attitude=_unit(source)), 2.0 * nearest


KINDS: dict[str, Callable[[Random], tuple[Scene, float]]] = {
    "free": _free, "driven": _driven, "heavy top": _top, "detumbling": _detumbling,
    "gravity gradient": _orbiting, "slew": _slew, "wheels": _wheels, "fly-by": _fly_by,
}  # fmt: skip


def motion(number: int, seed: str) -> tuple[str, Scene, float]:
    """Return the kind of a motion, its scene and its end (s)."""
    kind = list(KINDS)[number % len(KINDS)]
    return kind, *KINDS[kind](Random(f"{seed} {number}"))


def main(count: int, seed: str) -> None:
    left = {kind: dict.fromkeys(TOLERANCES, 0) for kind in KINDS}
    for number in range(count):
        kind, scene, end = motion(number, seed)
        for tolerance in TOLERANCES:
            left[kind][tolerance] += solve(scene, end, tolerance=tolerance).ended != "complete"
    print(f"{'not complete at':18s}" + "".join(f"{tolerance:9.0e}" for tolerance in TOLERANCES))
    for kind, counts in left.items():
        print(f"{kind:18s}" + "".join(f"{n:9d}" for n in counts.values()))
    total = [sum(counts[tolerance] for counts in left.values()) for tolerance in TOLERANCES]
    print(f"{f'of {count} motions':18s}" + "".join(f"{n:9d}" for n in total))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
