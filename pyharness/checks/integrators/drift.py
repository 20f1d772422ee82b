"""The drift of conserved quantities in a long torque-free motion, and its limit.

Drifts of energy and |L| are relative; the drift of the direction of the angular momentum L in space
is an angle (rad).
"""

import math
from dataclasses import dataclass

import numpy as np

from pyharness.checks.integrators.problem import LEVELS, Judged
from pyharness.checks.integrators.protocol import Motion
from pyharness.model.attitude import product
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

_BETWEEN = 8.0  # s from a row to the next
_ROWS, _FEWEST, _LEAST = 64, 16, 4
# The largest step size (1/32 s) and tolerance (1e-6) of the motion.
_FIRST = {"step_size": 4, "tolerance": 3}
_MARGIN, _WITHOUT_ATTITUDE = 16.0, 64.0  # the attitude has the larger error
_TOTAL = 3.0  # largest sum of the limits of all rows: the errors of explicit methods may grow
_MOST = 0.9  # a larger limit would pass a body that stops

CHANGE = Basis(
    "measured",
    "change of energy or angular momentum without torque (relative, or rad) in 8 s: 16 times the "
    "error in a short motion with the same step or tolerance, in proportion to time; 64 times "
    "without attitude",
    "`python -m tests.campaigns.integrator_campaign 40 1`, where the largest ratio to it is .23",
)


@dataclass(frozen=True, eq=False)
class Drift:
    """The drifts from time 0, shape (n,), and the largest `change` between neighbouring rows."""

    times: Array
    energy: Array
    momentum: Array
    direction: Array | None
    change: float

    def named(self) -> dict[str, Array]:
        """Return the drifts by name."""
        found = {"energy": self.energy, "momentum": self.momentum}
        return found if self.direction is None else {**found, "direction": self.direction}


def long_motion(free: Judged) -> tuple[int, Array, float | None]:
    """Return level and times (s) of the long motion, and the limit of the change between rows.

    The level is the first step size or tolerance whose limits allow enough rows, else the last. The
    limit is None if the errors are too large.
    """
    control = free.finest.control
    levels = range(_FIRST[control], LEVELS)
    margin = _WITHOUT_ATTITUDE if free.finest.attitude is None else _MARGIN
    limits = [margin * free.error(k) * _BETWEEN / free.problem.times[-1] for k in levels]
    number = next((n for n, limit in enumerate(limits) if _TOTAL / limit >= _FEWEST), -1)
    most = max(_FEWEST, _ROWS if control == "tolerance" or number < 0 else _ROWS >> number)
    if number < 0 and limits[-1] > 0.5 * limits[0]:
        # The errors do not decrease with the step size, so that small steps would be useless.
        return levels[0], _BETWEEN * np.arange(1.0, _FEWEST + 1.0), None
    limit = limits[number]
    rows = max(_LEAST, int(min(most, _TOTAL / limit)))
    return levels[number], _BETWEEN * np.arange(1.0, rows + 1.0), limit if limit <= _MOST else None


def drift_of(scene: Scene, times: Array, motion: Motion) -> Drift:
    """Return the drift in `motion`, whose rows are at `times` (s)."""
    omega = np.vstack([scene.omega, motion.omega])
    with np.errstate(all="ignore"):
        vectors = np.array(scene.moments) * omega
        energy, momentum = (vectors * omega).sum(axis=1), np.linalg.norm(vectors, axis=1)
        changes = [np.abs(each[1:] / each[:-1] - 1.0) for each in (energy, momentum)]
        direction = None
        if motion.attitude is not None:
            there = _in_space(np.vstack([[scene.attitude], motion.attitude]), vectors)
            direction = _angle(there[1:], there[:1])
            changes.append(_angle(there[1:], there[:-1]))
        # The change from a row that is 0 or not finite is NaN, which is ignored.
        change = np.fmax.reduce(np.concatenate(changes), initial=0.0)
        drifts = [each[1:] / each[0] - 1.0 for each in (energy, momentum)]
    return Drift(times, drifts[0], drifts[1], direction, float(change))


def _in_space(attitude: Array, vectors: Array) -> Array:
    q = attitude.T
    turned = product(product(q, (np.zeros(len(vectors)), *vectors.T)), (q[0], *-q[1:]))
    return np.array(turned[1:]).T


def _angle(first: Array, second: Array) -> Array:
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    return np.asarray(np.arctan2(sine, (first * second).sum(axis=1)))


def growth_power(times: Array, drift: Array) -> float | None:
    """Return the power of time with which the largest drift grows.

    Return None if the drift is 0 in the first quarter of the time, or not finite.
    """
    quarter = times <= times[-1] / 4.0
    early, late = float(np.abs(drift[quarter]).max()), float(np.abs(drift).max())
    if not math.isfinite(late) or early <= 0.0:
        return None
    return math.log(late / early) / math.log(4.0)
