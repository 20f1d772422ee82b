"""Random scenes of moderate size, for judging integrators of other programs."""

from random import Random

from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw

KINDS = ("free", "constant", "wave")
"""The kinds of scenes: torque-free, constant torque, and waves with a linear torque."""


def draw_moderate(seed: str, kind: str, number: int) -> Scene:
    """Return scene `number` of a seed, with a torque of `kind`, an element of `KINDS`.

    The moments are possible and differ by at least a tenth. The body rotates by some radians in 12
    steps, 6 s in all. Torques are some tenths of a moment times 1/s2.
    """
    source = Random(f"{seed}/moderate/{kind}/{number}")
    size = 10.0 ** source.uniform(-1.0, 1.0)
    low = source.uniform(1.0, 2.0)
    middle = low * source.uniform(1.15, 1.6)
    high = source.uniform(1.1 * middle, 0.95 * (low + middle))
    moments = [size * moment for moment in (low, middle, high)]
    source.shuffle(moments)
    law = TorqueLaw()
    if kind == "constant":
        law = TorqueLaw(constant=_torque(source, moments))
    elif kind == "wave":
        law = TorqueLaw(
            rate=[0.1 * x for x in _torque(source, moments)],
            sines=[(_torque(source, moments), source.uniform(1.0, 3.0))],
            cosines=[(_torque(source, moments), source.uniform(1.0, 3.0))],
        )
    return Scene(
        f"{kind}-{number}",
        omega=_vector(source, 0.4, 1.4),
        moments=(moments[0], moments[1], moments[2]),
        torque=law,
        attitude=[source.gauss(0.0, 1.0) for _ in range(4)],
        step_size=0.5,
        steps=12,
    )


def _torque(source: Random, moments: list[float]) -> Triple:
    a, b, c = _vector(source, 0.2, 0.6)
    return a * moments[0], b * moments[1], c * moments[2]


def _vector(source: Random, least: float, most: float) -> Triple:
    a, b, c = (source.choice((-1.0, 1.0)) * source.uniform(least, most) for _ in range(3))
    return a, b, c
