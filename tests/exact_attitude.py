"""Attitude of a torque-free body to some 45 digits, by two enclosures that share no formula.

`joint` integrates omega and the quaternion by a series with verified steps. `exact` evaluates
elliptic and theta functions in ball arithmetic, so that 1e6 s take no longer than one revolution.
"""

import warnings
from collections.abc import Sequence
from typing import Any

import mpmath

from pyharness import ImpossibleBodyWarning, Scene
from pyharness.model.attitude import IDENTITY
from pyharness.truth.balls import fraction
from pyharness.truth.enclosure_free import enclose_free
from pyharness.truth.enclosure_steps import enclose_steps

DIGITS = 60
_PROVED = 45  # digits of the enclosures

Quaternion = list[mpmath.mpf]


def times(p: Sequence[mpmath.mpf], q: Sequence[mpmath.mpf]) -> Quaternion:
    """Return the product of two quaternions, scalar first (Hamilton)."""
    return [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
    ]


def joint(
    moments: Sequence[float], omega: Sequence[float], attitude: Sequence[float], time: float
) -> tuple[list[mpmath.mpf], Quaternion]:
    """Return omega and attitude at `time` (s) by integrating both; for short times."""
    found: Any = enclose_steps(_scene(moments, omega), [time], _PROVED)
    return _rotated([*found.omega[0].middle, *found.attitude[0].middle], attitude)


def exact(
    moments: Sequence[float], omega: Sequence[float], attitude: Sequence[float], time: float
) -> tuple[list[mpmath.mpf], Quaternion]:
    """Return omega and attitude at any `time` (s)."""
    (row,) = enclose_free(_scene(moments, omega), [time], _PROVED, attitude=True)
    return _rotated([fraction(x) for x in row], attitude)


def _scene(moments: Sequence[float], omega: Sequence[float]) -> Scene:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ImpossibleBodyWarning)
        return Scene("exact", tuple(omega), moments=tuple(moments), attitude=IDENTITY)


def _rotated(row: Sequence[Any], attitude: Sequence[float]) -> tuple[list[mpmath.mpf], Quaternion]:
    """Return omega and the attitude, of which `row` has that from the identity."""
    with mpmath.workdps(DIGITS):
        found = [mpmath.mpf(x.numerator) / x.denominator for x in row]
        size = mpmath.sqrt(sum(mpmath.mpf(x) ** 2 for x in attitude))
        # The product is not of the numbers that a scene would round.
        return found[:3], times([mpmath.mpf(x) / size for x in attitude], found[3:])
