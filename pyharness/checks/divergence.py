"""Step sizes at which runs diverge: predicted by linear stability, and measured."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pyharness.checks.theory.amplification import Amplification
from pyharness.engine.solve import solve
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory

Runner = Callable[[Scene], Trajectory]

_SAMPLES = 20_000
DOUBLING = Basis(
    "derived",
    "smallest step size with which a run diverges",
    "linear stability, with the change of the spin until the wobble doubles "
    "(`checks/divergence.py`)",
)
"""Basis of the field `limit` of a `Divergence`."""


@dataclass(frozen=True)
class Divergence:
    """The smallest step size (s) for which runs diverge, measured (`found`) and predicted.

    A run diverges if it overflows or a component exceeds twice its true maximum; `found` is 0 if
    the smallest step tried diverges. With the step `predicted`, linear stability lets the wobble
    about axis 3 double. `limit` bounds the relative difference of the two.
    """

    found: float
    predicted: float
    limit: float


def divergence(
    scene: Scene, time: float, matrix: Amplification, runner: Runner, smallest: float
) -> Divergence:
    """Return the divergent step sizes of a body that spins about stable axis 3 for `time` (s)."""
    found = smallest_divergent(scene, time, runner, smallest)
    a, b, c = scene.euler_coefficients
    spin = abs(scene.omega[2])
    rate = math.sqrt(-a * b) * spin
    predicted = _doubling(matrix, rate, time, smallest)
    bounds = _bounds(scene, time)
    # omega3**2 - (C/A) omega1**2 and omega3**2 - (C/B) omega2**2 are constant. Until the wobble has
    # doubled, they allow the spin, and with it the rate, to change by this fraction at most.
    change = 0.0
    if c:
        wobble = 2.0 * max(bounds[:2])
        change = abs(c) / min(abs(a), abs(b)) * wobble**2 / (2.0 * spin * spin)
    low = _doubling(matrix, rate * (1.0 + change), time, smallest)
    # Between two steps, a peak may be missed by half the angle of a step.
    missed = -math.log(math.cos(min(1.5, 0.5 * rate * predicted)))
    high = _doubling(matrix, rate * (1.0 - change), time, smallest, missed)
    limit = max(predicted - low, high - predicted) / predicted + 2.0 * predicted / time
    return Divergence(found, predicted, limit)


def smallest_divergent(scene: Scene, time: float, runner: Runner, smallest: float) -> float:
    """Return the smallest step size (s) with which a run exceeds twice the largest true omega.

    Return 0 if it is at most `smallest` (s), and infinity if no run does.
    """
    bounds = 2.0 * np.array(_bounds(scene, time))

    def leaves(steps: int) -> bool:
        run = runner(replace(scene, step_size=time / steps, steps=steps))
        return run.ended != "complete" or bool((np.abs(run.omega) > bounds).any())

    low, high = 1, math.floor(time / smallest)
    if leaves(high):
        return 0.0
    if not leaves(low):
        return math.inf
    while high > low + 1:
        middle = (low + high) // 2 if high < 2 * low else round(math.sqrt(low * high))
        low, high = (middle, high) if leaves(middle) else (low, middle)
    return time / low


def _doubling(
    matrix: Amplification, rate: float, time: float, smallest: float, missed: float = 0.0
) -> float:
    """Return the smallest step (s) for which, by theory, a wobble grows 2 exp(`missed`)-fold.

    `missed` allows for a peak between two steps; `rate` is an angular frequency (1/s).
    """
    wanted = math.log(2.0) + missed

    def grown(step: float) -> float:
        growth = float(matrix.radius(np.array(1j * rate * step)))
        return time / step * math.log(growth)

    low, high = smallest, time
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if grown(middle) >= wanted else (middle, high)
    return high


def _bounds(scene: Scene, time: float) -> Sequence[float]:
    times = np.linspace(0.0, time, _SAMPLES + 1)[1:].tolist()
    omega: Array = solve(scene, times, "taylor", 1e-12).omega
    largest: list[float] = np.abs(np.vstack([scene.omega, omega])).max(axis=0).tolist()
    return largest
