"""Random scenes with a weak torque, for long times."""

import math
from random import Random

from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw, Wave
from tests.checks.scenes.free_motions import KINDS
from tests.checks.scenes.free_motions import draw as draw_motion

MOTIONS = tuple(kind for kind in KINDS if kind not in ("needle", "sphere"))
TORQUES = ("constant", "linear", "slow waves", "fast wave", "sum")
_WEAKEST, _STRONGEST = -9.0, -5.0  # powers of 10; torque over the largest gyroscopic torque


def draw_weak(seed: str, number: int, rotations: float) -> tuple[Scene, float]:
    """Return scene `number` of a seed, and a time (s) in which the body rotates `rotations` times.

    It may be negative. The torque is 1e-9 to 1e-5 of the largest moment times omega squared. Scenes
    cycle through all pairs of `MOTIONS` and `TORQUES`.
    """
    source = Random(f"{seed}/weak/{number}")
    motion = MOTIONS[number % len(MOTIONS)]
    kind = TORQUES[number // len(MOTIONS) % len(TORQUES)]
    moments, omega, _, any_time = draw_motion(source, motion)
    spin = max(map(abs, omega))
    time = math.copysign(2.0 * math.pi * rotations / spin, any_time)
    size = max(moments) * spin * spin * 10 ** source.uniform(_WEAKEST, _STRONGEST)
    law = TorqueLaw(
        constant=_vector(source, size) if kind in ("constant", "sum") else (0.0, 0.0, 0.0),
        rate=_vector(source, size / abs(time)) if kind in ("linear", "sum") else (0.0, 0.0, 0.0),
        sines=_waves(source, size, spin * 1e-3) if kind in ("slow waves", "sum") else (),
        cosines=_waves(source, size, spin * (0.5 if kind == "fast wave" else 1e-4))
        if kind in ("slow waves", "fast wave")
        else (),
    )
    first, second, third = omega
    scene = Scene(
        f"{motion}, {kind}", omega=(first, second, third),
        moments=(moments[0], moments[1], moments[2]), torque=law,
    )  # fmt: skip
    return scene, time


def _vector(source: Random, size: float) -> Triple:
    return tuple(size * source.uniform(-1.0, 1.0) for _ in range(3))  # type: ignore[return-value]


def _waves(source: Random, size: float, fastest: float) -> tuple[Wave, ...]:
    return ((_vector(source, size), fastest * 10 ** source.uniform(-1.0, 0.0)),)
