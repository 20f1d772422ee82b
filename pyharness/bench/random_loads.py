"""Random scenes of several kinds, on which no method was tuned.

Torques and frequencies scale with the initial angular velocity.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from random import Random

import numpy as np

from pyharness.bench.measure import Workload
from pyharness.checks.theory.conditioning import along, conditioning
from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import Reference

MOST_TURNS = 300.0
WAVES = {"one wave": 1, "three waves": 3, "ten waves": 10}
LAWS = ("no torque", "constant torque", "ramp", *WAVES)
# Ranges of frequencies, relative to the initial |omega|.
SPEEDS = {"slow waves": (0.01, 0.1), "matched waves": (0.3, 3.0), "fast waves": (3.0, 10.0)}
# Functions of a generator x that draw moments in an arbitrary unit.
BODIES: dict[str, Callable[[Random], list[float]]] = {
    "compact": lambda x: [x.uniform(2.0, 3.0) for _ in range(3)],
    "flat": lambda x: _flat(x, x.uniform(1.0, 3.0), x.uniform(1.0, 3.0)),
    "needle-like": lambda x: [low := x.uniform(0.01, 0.1), 1.0, 1.0 + low * x.uniform(0.0, 1.0)],
    "nearly symmetric": lambda x: [1.0, 1.0 + _log(x, 1e-6, 1e-2), x.uniform(0.2, 1.9)],
}
MOST_GROWTH = 1e3  # scenes with this error amplification or more are rejected
_LENGTHS = {"1 to 10 turns": 10.0, "10 to 100 turns": 100.0, "100 to 300 turns": MOST_TURNS}
KINDS = ("all", *LAWS, *SPEEDS, *BODIES, *_LENGTHS)


def random_load(seed: str, number: int, attitude: bool = False) -> Workload:
    """Return workload `number` (from 1) of a seed; with `attitude` it has no `truth`."""
    source = Random(f"bench/{seed}/{number}")
    place = number - 1
    law, place = LAWS[place % len(LAWS)], place // len(LAWS)
    # Twelve successive draws of the same kind of torque have all pairs of the four bodies and the
    # three speeds.
    body = list(BODIES)[place % len(BODIES)]
    speed = list(SPEEDS)[place % len(SPEEDS)] if law in WAVES else ""
    name = ", ".join(filter(None, (f"{number}: {law}", speed.removesuffix(" waves"), body)))
    while True:
        scene, horizon = by_torque(source, name, law, speed, body)
        try:
            # A fast estimate rejects scenes far above the limit.
            if conditioning(scene, horizon).amplification > 2.0 * MOST_GROWTH:
                continue
            path = integer_series(scene, [horizon])
            found = along(scene, path.nodes, path.way)
        except InputError:  # too many steps for the reference
            continue
        growth = found.amplification
        turning = np.linalg.norm(path.way, axis=1)
        means = 0.5 * (turning[1:] + turning[:-1])
        turns = float(means @ np.diff(path.nodes)) / (2.0 * math.pi)
        if growth < MOST_GROWTH and 1.0 <= turns <= MOST_TURNS:
            break
    length = next(each for each, most in _LENGTHS.items() if turns <= most)
    estimate = 1e-29 * growth * found.largest
    truth = Reference(path.time, path.omega, None, "Taylor series in whole numbers", estimate)
    kinds = tuple(filter(None, ("all", law, speed, body, length)))
    load = Workload(str(number), scene, horizon, kinds, truth, growth, turns)
    return replace(load, scene=replace(scene, attitude=IDENTITY), truth=None) if attitude else load


def by_torque(source: Random, name: str, law: str, speed: str, body: str) -> tuple[Scene, float]:
    """Return a random scene and the time (s) of roughly 1 to 300 revolutions."""
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
        # Until the end the torque alone would add `gain` times the initial |omega|. The mean
        # |omega| gives the time of the desired revolutions.
        gain = _log(source, 0.1, 30.0)
        constant = law == "constant torque"
        horizon /= 1.0 + gain / (2.0 if constant else 3.0)
        rate = gain * start / horizon
        found = TorqueLaw(torque(rate)) if constant else TorqueLaw(rate=torque(2 * rate / horizon))
    elif law in WAVES:
        waves = []
        for _ in range(WAVES[law]):
            # Each wave alone would make omega oscillate by 0.01 to 1 times its initial value.
            frequency = start * _log(source, *SPEEDS[speed])
            waves.append((torque(frequency * start * _log(source, 0.01, 1.0)), frequency))
        sines = source.randint(0, len(waves))
        found = TorqueLaw(sines=waves[:sines], cosines=waves[sines:])
    return Scene(name, omega, moments, torque=found), horizon


def _flat(source: Random, a: float, b: float) -> list[float]:
    return [a, b, (a + b) * source.uniform(0.95, 1.0)]


def _log(source: Random, low: float, high: float) -> float:
    return float(low * (high / low) ** source.random())


def _vector(source: Random) -> list[float]:
    return [source.uniform(-1.0, 1.0) for _ in range(3)]
