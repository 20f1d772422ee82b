"""Attitudes from a table of omega, such as a thesis program's output."""

import math

import numpy as np

from pyharness.model.attitude import IDENTITY, Quaternion, product
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

# Two Gauss points, at the fractions _EARLY and 1 - _EARLY of a step; weights of omega at these
# points in each exponential.
_EARLY = 0.5 - math.sqrt(3.0) / 6.0
_MORE, _LESS = 0.25 + math.sqrt(3.0) / 6.0, 0.25 - math.sqrt(3.0) / 6.0


@np.errstate(over="ignore", invalid="ignore")
def attitude_from_rows(scene: Scene, time: Array, omega: Array) -> Array:
    """Return the attitudes, (n, 4), at the times (s) of a table of omega (rad/s)."""
    times = np.concatenate([[0.0], time])
    rows = np.vstack([scene.omega, omega])
    slope = scene.right_hand_side()
    slopes = np.array([slope(t, row) for t, row in zip(times, rows.tolist(), strict=True)])
    span = np.diff(times)[:, None]
    first, second = (_between(rows, slopes, span, part) for part in (_EARLY, 1.0 - _EARLY))
    # Steps are commutator-free, of order 4 (Celledoni, Marthinsen and Owren 2003).
    turns = zip(
        _turn(span * (_MORE * first + _LESS * second)),
        _turn(span * (_LESS * first + _MORE * second)),
        strict=True,
    )
    q = scene.attitude or IDENTITY
    found = np.empty((len(time), 4))
    for n, (early, late) in enumerate(turns):
        q = product(product(q, early), late)
        length = math.hypot(*q)
        q = q[0] / length, q[1] / length, q[2] / length, q[3] / length
        found[n] = q
    return found


def _between(rows: Array, slopes: Array, span: Array, part: float) -> Array:
    """Return omega, (n, 3), at the fraction `part` of n steps, by Hermite's cubic."""
    rest = 1.0 - part
    ends = (
        rest * rest * (1.0 + 2.0 * part) * rows[:-1] + part * part * (1.0 + 2.0 * rest) * rows[1:]
    )
    found: Array = ends + span * part * rest * (rest * slopes[:-1] - part * slopes[1:])
    return found


def _turn(angle: Array) -> list[Quaternion]:
    """Return the quaternions of n rotation vectors (rad)."""
    half = 0.5 * np.linalg.norm(angle, axis=1)
    parts = np.column_stack([np.cos(half), 0.5 * np.sinc(half / np.pi)[:, None] * angle])
    return [(w, x, y, z) for w, x, y, z in parts.tolist()]
