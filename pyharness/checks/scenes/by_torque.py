"""Random scenes for each kind of torque, on which no method was tuned.

Torques and frequencies scale with the initial angular velocity, so that they affect slow and fast
bodies alike.
"""

import math
from collections.abc import Callable
from random import Random

from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw

MOST_TURNS = 300.0
WAVES = {"one wave": 1, "three waves": 3, "ten waves": 10}
LAWS = ("no torque", "constant torque", "ramp", *WAVES)
# Ranges of the frequencies of waves, relative to the initial |omega|.
SPEEDS = {"slow waves": (0.01, 0.1), "matched waves": (0.3, 3.0), "fast waves": (3.0, 10.0)}
# Moments in an arbitrary unit, from a random generator.
BODIES: dict[str, Callable[[Random], list[float]]] = {
    "compact": lambda source: [source.uniform(2.0, 3.0) for _ in range(3)],
    "flat": lambda source: _flat(source.uniform(1.0, 3.0), source.uniform(1.0, 3.0), source),
    "needle-like": lambda source: _needle(source.uniform(0.01, 0.1), source),
    "nearly symmetric": lambda source: [
        1.0,
        1.0 + _log(source, 1e-6, 1e-2),
        source.uniform(0.2, 1.9),
    ],
}


def by_torque(source: Random, name: str, law: str, speed: str, body: str) -> tuple[Scene, float]:
    """Return a random scene, and the time (s) of roughly 1 to 300 revolutions.

    `law`, `speed` and `body` are elements of `LAWS`, `SPEEDS` and `BODIES`.
    """
    mass = _log(source, 1.0, 50.0)
    moments = [mass * each for each in BODIES[body](source)]
    source.shuffle(moments)
    size = _log(source, 1.0, 10.0)
    omega = [size * each for each in _vector(source)]
    start = math.hypot(*omega)
    turns = _log(source, 1.0, MOST_TURNS)

    def torque(acceleration: float) -> Triple:
        x, y, z = (i * acceleration * a for i, a in zip(moments, _vector(source), strict=True))
        return x, y, z

    found, horizon = TorqueLaw(), 2.0 * math.pi * turns / start
    if law in ("constant torque", "ramp"):
        # By the end the torque alone would add `gain` times the initial |omega|. The mean |omega|
        # determines the time of the desired number of revolutions.
        gain = _log(source, 0.1, 30.0)
        constant = law == "constant torque"
        horizon /= 1.0 + gain / (2.0 if constant else 3.0)
        rate = gain * start / horizon
        found = TorqueLaw(torque(rate)) if constant else TorqueLaw(rate=torque(2 * rate / horizon))
    elif law in WAVES:
        waves = []
        for _ in range(WAVES[law]):
            # Each wave alone would make omega oscillate by a fraction of its initial value.
            frequency = start * _log(source, *SPEEDS[speed])
            waves.append((torque(frequency * start * _log(source, 0.01, 1.0)), frequency))
        sines = source.randint(0, len(waves))
        found = TorqueLaw(sines=waves[:sines], cosines=waves[sines:])
    return Scene(name, omega, moments, torque=found), horizon


def _flat(first: float, second: float, source: Random) -> list[float]:
    return [first, second, (first + second) * source.uniform(0.95, 1.0)]


def _needle(least: float, source: Random) -> list[float]:
    return [least, 1.0, 1.0 + least * source.uniform(0.0, 1.0)]


def _log(source: Random, low: float, high: float) -> float:
    return float(low * (high / low) ** source.random())


def _vector(source: Random) -> list[float]:
    return [source.uniform(-1.0, 1.0) for _ in range(3)]
