"""Random scenes of several kinds, on which no method was tuned.

A seed and a number determine a scene. Its motion, by the second reference (`integer_series`),
decides whether it is accepted.
"""

import math
from dataclasses import replace
from random import Random

import numpy as np

from pyharness.bench.measure import Workload
from pyharness.checks.scenes.by_torque import BODIES, LAWS, MOST_TURNS, SPEEDS, WAVES, by_torque
from pyharness.checks.theory.conditioning import along, conditioning
from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import Reference

MOST_GROWTH = 1e3  # limit of the error amplification of an accepted scene
_LENGTHS = {"1 to 10 turns": 10.0, "10 to 100 turns": 100.0, "100 to 300 turns": MOST_TURNS}
KINDS = ("all", *LAWS, *SPEEDS, *BODIES, *_LENGTHS)


def random_load(seed: str, number: int, attitude: bool = False) -> Workload:
    """Return the workload of a seed and a number (from 1).

    Kinds of torque alternate with the number. A scene is drawn again if its error amplification is
    `MOST_GROWTH` or more, or if the body makes less than 1 or more than 300 revolutions. With
    `attitude`, the body is initially aligned with the axes of space, and the workload has no
    `truth`, because `integer_series` propagates no attitude.
    """
    source = Random(f"bench/{seed}/{number}")
    place = number - 1
    law, place = LAWS[place % len(LAWS)], place // len(LAWS)
    # There are four bodies and three speeds, so that twelve successive draws of a kind of torque
    # contain all pairs.
    body = list(BODIES)[place % len(BODIES)]
    speed = list(SPEEDS)[place % len(SPEEDS)] if law in WAVES else ""
    name = ", ".join(filter(None, (f"{number}: {law}", speed.removesuffix(" waves"), body)))
    while True:
        scene, horizon = by_torque(source, name, law, speed, body)
        try:
            # This fast estimate rejects scenes with an amplification far above the limit. The
            # reference decides on scenes near the limit.
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
