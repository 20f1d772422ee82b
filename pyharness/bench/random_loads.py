"""Random scenes for `bench`, by kind: what no method was tuned on.

A seed and a number say which. The torque is measured against the motion, so that each kind stays
what it is in a slow body and in a fast one; what the second reference says of the motion decides
whether a draw counts.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from random import Random

import numpy as np

from pyharness.bench.measure import Workload
from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, TorqueLaw, Triple
from pyharness.theory.conditioning import along, conditioning
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import Reference

MOST_GROWTH = 1e3
_MOST_TURNS = 300.0
_WAVES = {"one wave": 1, "three waves": 3, "ten waves": 10}
LAWS = ("no torque", "constant torque", "ramp", *_WAVES)
# Frequencies over the body's speed at the start.
_SPEEDS = {"slow waves": (0.01, 0.1), "matched waves": (0.3, 3.0), "fast waves": (3.0, 10.0)}
_LENGTHS = {"1 to 10 turns": 10.0, "10 to 100 turns": 100.0, "100 to 300 turns": _MOST_TURNS}
# Moments in any unit, from the generator's uniform numbers.
_BODIES: dict[str, Callable[[Random], list[float]]] = {
    "compact": lambda source: [source.uniform(2.0, 3.0) for _ in range(3)],
    "flat": lambda source: _flat(source.uniform(1.0, 3.0), source.uniform(1.0, 3.0), source),
    "needle-like": lambda source: _needle(source.uniform(0.01, 0.1), source),
    "nearly symmetric": lambda source: [
        1.0,
        1.0 + _log(source, 1e-6, 1e-2),
        source.uniform(0.2, 1.9),
    ],
}
KINDS = ("all", *LAWS, *_SPEEDS, *_BODIES, *_LENGTHS)


def random_load(seed: str, number: int, attitude: bool = False) -> Workload:
    """Return what `number`, from 1 on, of a seed stands for; its kind of torque is next in turn.

    Moments in kg m2, omega in rad/s, torque in N m, horizon in s; its `truth` is the second
    reference's, its `kinds` are of `KINDS`. Drawn again where a small difference grows
    `MOST_GROWTH` times or more, or the body turns less than once or more than 300 times. With
    `attitude` it is the same scene, from the axes of space, and has no `truth`: the second
    reference carries no attitude.
    """
    source = Random(f"bench/{seed}/{number}")
    place = number - 1
    law, place = LAWS[place % len(LAWS)], place // len(LAWS)
    # Four bodies and three speeds: all pairs come up in twelve.
    body = list(_BODIES)[place % len(_BODIES)]
    speed = list(_SPEEDS)[place % len(_SPEEDS)] if law in _WAVES else ""
    name = ", ".join(filter(None, (f"{number}: {law}", speed.removesuffix(" waves"), body)))
    while True:
        scene, horizon = _drawn(source, name, law, speed, body)
        try:
            # Spares the reference what is far beyond; it decides what is near.
            if conditioning(scene, horizon).amplification > 2.0 * MOST_GROWTH:
                continue
            path = integer_series(scene, [horizon])
            found = along(scene, path.nodes, path.way)
        except InputError:  # more steps than the reference takes
            continue
        growth = found.amplification
        turning = np.linalg.norm(path.way, axis=1)
        means = 0.5 * (turning[1:] + turning[:-1])
        turns = float(means @ np.diff(path.nodes)) / (2.0 * math.pi)
        if growth < MOST_GROWTH and 1.0 <= turns <= _MOST_TURNS:
            break
    length = next(each for each, most in _LENGTHS.items() if turns <= most)
    estimate = 1e-29 * growth * found.largest
    truth = Reference(path.time, path.omega, None, "Taylor series in whole numbers", estimate)
    kinds = tuple(filter(None, ("all", law, speed, body, length)))
    load = Workload(str(number), scene, horizon, kinds, truth, growth, turns)
    return replace(load, scene=replace(scene, attitude=IDENTITY), truth=None) if attitude else load


def _drawn(source: Random, name: str, law: str, speed: str, body: str) -> tuple[Scene, float]:
    """Return a scene, and a time (s) in which it should turn 1 to 300 times."""
    mass = _log(source, 1.0, 50.0)
    moments = [mass * each for each in _BODIES[body](source)]
    source.shuffle(moments)
    size = _log(source, 1.0, 10.0)
    omega = [size * each for each in _vector(source)]
    start = math.hypot(*omega)
    turns = _log(source, 1.0, _MOST_TURNS)

    def torque(acceleration: float) -> Triple:
        x, y, z = (i * acceleration * a for i, a in zip(moments, _vector(source), strict=True))
        return x, y, z

    found, horizon = TorqueLaw(), 2.0 * math.pi * turns / start
    if law in ("constant torque", "ramp"):
        # What it would add to the start, alone, by the end; on the way the mean of that counts.
        gain = _log(source, 0.1, 30.0)
        constant = law == "constant torque"
        horizon /= 1.0 + gain / (2.0 if constant else 3.0)
        rate = gain * start / horizon
        found = TorqueLaw(torque(rate)) if constant else TorqueLaw(rate=torque(2 * rate / horizon))
    elif law in _WAVES:
        waves = []
        for _ in range(_WAVES[law]):
            # A part of the start is what each swings by, alone.
            frequency = start * _log(source, *_SPEEDS[speed])
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
