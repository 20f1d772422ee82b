"""Attitudes computed from a table of omega, such as the output of a program of the thesis."""

import math

import numpy as np

from pyharness.model.attitude import IDENTITY, Quaternion, product
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

# The Gauss points are at the fractions _EARLY and 1 - _EARLY of a step. Each exponential has
# a weighted sum of the omegas at these two points, with the weights _MORE and _LESS.
_EARLY = 0.5 - math.sqrt(3.0) / 6.0
_MORE, _LESS = 0.25 + math.sqrt(3.0) / 6.0, 0.25 - math.sqrt(3.0) / 6.0


@np.errstate(over="ignore", invalid="ignore")
def attitude_from_rows(scene: Scene, time: Array, omega: Array) -> Array:
    """Return the attitudes at the times of a table of omega, as quaternions, shape (n, 4).

    `omega` has shape (n, 3), rad/s, and `time` has shape (n,), s, in order. `scene` supplies omega
    and the attitude at time 0. Quaternions are from body to space, scalar first.

    From each row to the next the attitude is integrated by one commutator-free step of order 4
    (Celledoni, Marthinsen and Owren 2003). The step multiplies the attitude by two exponentials.
    The exponent of each is the step size times a weighted sum of omega at the two Gauss points of
    the step. Omega at a Gauss point is interpolated by a cubic polynomial through the two rows and
    their derivatives, which Euler's equations supply. After a rotation that overflows, all
    attitudes are NaN.
    """
    times = np.concatenate([[0.0], time])
    rows = np.vstack([scene.omega, omega])
    slope = scene.right_hand_side()
    slopes = np.array([slope(t, row) for t, row in zip(times, rows.tolist(), strict=True)])
    span = np.diff(times)[:, None]
    first, second = (_between(rows, slopes, span, part) for part in (_EARLY, 1.0 - _EARLY))
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
    """Return omega at the fraction `part` of each step, by cubic Hermite interpolation.

    `rows` is omega (rad/s) at the n + 1 ends of n steps, shape (n + 1, 3). `slopes` contains the
    derivatives of these omegas (rad/s2), and `span` the lengths of the steps (s), shape (n, 1). The
    result has shape (n, 3), rad/s.
    """
    rest = 1.0 - part
    ends = (
        rest * rest * (1.0 + 2.0 * part) * rows[:-1] + part * part * (1.0 + 2.0 * rest) * rows[1:]
    )
    found: Array = ends + span * part * rest * (rest * slopes[:-1] - part * slopes[1:])
    return found


def _turn(angle: Array) -> list[Quaternion]:
    """Return the quaternions, scalar first, of n rotation vectors.

    `angle` contains the vectors, shape (n, 3). The length of a vector is the angle of rotation
    (rad), and its direction is the axis.
    """
    half = 0.5 * np.linalg.norm(angle, axis=1)
    parts = np.column_stack([np.cos(half), 0.5 * np.sinc(half / np.pi)[:, None] * angle])
    return [(w, x, y, z) for w, x, y, z in parts.tolist()]
