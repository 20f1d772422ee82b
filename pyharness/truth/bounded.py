"""Error bounds of the reference solution, proved where a proof is cheap, else estimated.

A proof encloses the solution in balls (intervals with middle and radius). The largest distance of
the reference from any point of a ball bounds the error.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from decimal import ROUND_CEILING, Decimal, localcontext
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.report import short
from pyharness.model.scene import Scene
from pyharness.model.trajectory import ROUNDING, Array
from pyharness.truth.enclosed import Balls
from pyharness.truth.reference import Reference

PROVED, ESTIMATED = "proved", "estimated"
# Factors on the work limits of the two provers that take steps, for about half a second each.
_INTEGER_WORK, _BALL_WORK = 0.05, 0.05
_MOST_TIMES = 30  # for the prover in ball arithmetic, which needs a step for each time
_SPARE_DIGITS = 2  # decimal digits by which a ball is smaller than the estimated error
_DIGITS, _MOST_DIGITS = 20, 60  # digits of a proof without an estimate; most digits of any proof
_ROUNDED_UP = 1.0 + 2.0**-49  # exceeds the rounding errors of a few operations

Row = Sequence[float | Fraction]


class ErrorBound(NamedTuple):
    """Bounds on the error of the reference at all its times, each "proved" or "estimated"."""

    value: float  # for any component of omega, rad/s
    basis: str
    angle: float | None = None  # for the attitude, rad
    angle_basis: str | None = None
    warning: str = ""  # not empty if the proof shows an error above the estimate

    def text(self, unit: str = "rad/s") -> str:
        return f"{' '.join(filter(None, (at_most(self.value), unit)))} ({self.basis})"

    def over(self, scale: float) -> "ErrorBound":
        return self._replace(value=self.value / scale) if scale else self

    @property
    def larger(self) -> "ErrorBound":
        if self.turned is None:
            return self
        return joined([self._replace(angle=None, angle_basis=None), self.turned])

    @property
    def turned(self) -> "ErrorBound | None":
        if self.angle is None or self.angle_basis is None:
            return None
        return ErrorBound(self.angle, self.angle_basis, warning=self.warning)

    def record(self) -> dict[str, Any]:
        found: dict[str, Any] = {"value": self.value, "basis": self.basis}
        if self.angle is not None:
            found |= {"angle": self.angle, "angle_basis": self.angle_basis}
        return found | {"warning": self.warning or None}


def at_most(x: float) -> str:
    """Return a positive number as text with two significant digits, rounded up."""
    if not math.isfinite(x):
        return short(x)
    with localcontext(rounding=ROUND_CEILING):
        return short(Decimal(x))


def bound_of(
    scene: Scene,
    known: Reference,
    *,
    before_rounding: bool = False,
    any_torque: bool = False,
    effort: float | None = None,
) -> ErrorBound:
    """Return the error bound of a scene's reference, `known`; options are as in `error_bound`.

    With `before_rounding`, omega includes `known.remainder`.
    """
    exact = before_rounding and known.remainder is not None
    largest = float(np.abs(known.omega).max(initial=0.0))
    return error_bound(
        scene,
        known.time,
        known.omega,
        known.estimate + ROUNDING**2 * largest if exact else known.error,
        known.attitude,
        known.angle_error,
        remainder=known.remainder if exact else None,
        any_torque=any_torque,
        effort=1.0 if effort is None else effort,
    )


def error_bound(
    scene: Scene,
    times: Array,
    omega: Array,  # shape (n, 3), rad/s
    claimed: float,
    attitude: Array | None = None,  # shape (n, 4)
    claimed_angle: float = 0.0,
    *,
    remainder: Array | None = None,  # added to omega
    any_torque: bool = False,  # prove bounds also under recorded torques of any kind
    effort: float = 1.0,  # factor on the work limit of a proof, about half a second
) -> ErrorBound:
    """Return the error bound of a reference at `times` (s).

    Estimates `claimed` (rad/s) and `claimed_angle` (rad) are returned where nothing is proved.
    """
    rows = _exact(omega, remainder)
    order = sorted(range(len(times)), key=lambda k: abs(times[k]))
    found = []
    for side in ([k for k in order if times[k] < 0.0], [k for k in order if times[k] >= 0.0]):
        if side:
            there, own = times[side].tolist(), [rows[k] for k in side]
            turned = None if attitude is None else attitude[side].tolist()
            stated = _Statement(scene, there, own, claimed, turned, claimed_angle)
            found.append(stated.bound(any_torque, effort))
    angle = (None, None) if attitude is None else (claimed_angle, ESTIMATED)
    return joined(found) if found else ErrorBound(claimed, ESTIMATED, *angle)


def _exact(omega: Array, remainder: Array | None) -> Sequence[Row]:
    rows: list[list[float]] = omega.tolist()
    if remainder is None:
        return rows
    pairs = zip(rows, remainder.tolist(), strict=True)
    return [[Fraction(x) + Fraction(rest) for x, rest in zip(*each, strict=True)] for each in pairs]


def joined(found: Sequence[ErrorBound]) -> ErrorBound:
    angles = [each.angle for each in found if each.angle is not None]
    bases = [each.angle_basis for each in found if each.angle_basis is not None]
    return ErrorBound(
        max(each.value for each in found),
        _common([each.basis for each in found]),
        max(angles, default=None),
        _common(bases) if bases else None,
        next((each.warning for each in found if each.warning), ""),
    )


def _common(bases: Sequence[str]) -> str:
    return PROVED if set(bases) == {PROVED} else ESTIMATED


class _Statement(NamedTuple):
    """The reference at times on one side of 0, in order away from 0."""

    scene: Scene
    times: list[float]  # s
    omega: Sequence[Row]  # rad/s
    claimed: float  # estimated error of omega, rad/s
    attitude: list[list[float]] | None
    claimed_angle: float  # rad

    def bound(self, any_torque: bool, effort: float) -> ErrorBound:
        value, basis, warnings = self.claimed, ESTIMATED, []
        angle = None if self.attitude is None else self.claimed_angle
        angle_basis = None if self.attitude is None else ESTIMATED
        omega, attitude = self._balls(any_torque, effort)
        if omega is not None:
            least, value = _extremes(self.omega, omega)
            basis = PROVED
            if least > self.claimed:
                warnings.append(_warning(self.claimed, value, "rad/s"))
        if attitude is not None and self.attitude is not None:
            rows = [[Fraction(x) for x in row] for row in self.attitude]
            least, angle = _extreme_angles(rows, attitude)
            angle_basis = PROVED
            if least > self.claimed_angle:
                warnings.append(_warning(self.claimed_angle, angle, "rad"))
        return ErrorBound(value, basis, angle, angle_basis, "; ".join(warnings))

    def _balls(
        self, any_torque: bool, effort: float
    ) -> tuple[Sequence[Balls] | None, Sequence[Balls] | None]:
        """Return balls that contain omega and the attitude; None where nothing is proved."""
        from pyharness.truth.certificate import has_certificate, prove

        digits = self._digits()
        if digits is None:
            return None, None
        omega: Sequence[Balls] | None = None
        attitude: Sequence[Balls] | None = None
        if has_certificate(self.scene):
            # Used even with python-flint, so that the bound of omega does not depend on it.
            bare = replace(self.scene, attitude=None)
            with suppress(InputError):
                omega = prove(bare, self.times, digits, effort * _INTEGER_WORK).enclosure.omega
            if self.attitude is None:
                return omega, None
        from pyharness.truth.enclosure import can_enclose, enclose

        is_free, is_short = self.scene.torque.is_zero, len(self.times) <= _MOST_TIMES
        if (is_free or (any_torque and is_short)) and can_enclose(self.scene):
            with suppress(InputError):
                found = enclose(self.scene, self.times, digits, effort=effort * _BALL_WORK)
                omega, attitude = omega or found.omega, found.attitude
        return omega, attitude

    def _digits(self) -> int | None:
        """Return how many digits a proof needs to improve the estimate; None if above 60."""
        largest = max(1.0, *(abs(float(x)) for row in self.omega for x in row))
        if not (0.0 < self.claimed < math.inf):
            # Omega is 0 at all times, or there is no estimate.
            return _DIGITS
        wanted = math.ceil(math.log10(largest) - math.log10(self.claimed)) + _SPARE_DIGITS
        return max(1, wanted) if wanted <= _MOST_DIGITS else None


def _extremes(rows: Sequence[Row], found: Sequence[Balls]) -> tuple[float, float]:
    least = most = 0.0
    for row, (middle, radius) in zip(rows, found, strict=True):
        apart = max(map(_distance, row, middle))
        # The distance, the radius and their sum are rounded to nearest.
        around = _up(float(radius))
        least = max(least, _down(_down(apart) - around))
        most = max(most, _up(_up(apart) + around))
    return least, most


def _distance(x: float | Fraction, y: Fraction) -> float:
    """Return abs(x - y) rounded to nearest; integers are faster than fractions."""
    n, d = x.as_integer_ratio()
    m, e = y.as_integer_ratio()
    return abs(n * e - m * d) / (d * e)


def _extreme_angles(
    rows: Sequence[Sequence[Fraction]], found: Sequence[Balls]
) -> tuple[float, float]:
    """Return a lower and an upper bound on the largest error (rad) of quaternions `rows`."""
    # The error is twice the angle between the lines of a row and of the true quaternion. This angle
    # is at most the sum of two. The first, between the row and the middle of its ball, has the sine
    # s; if s <= 1/2, it is less than s (1 + s**2). The second, between the middle and the true
    # quaternion, is at most arcsin(2 r) < 4 r, as each component differs by at most the radius r.
    least = most = 0.0
    for row, (middle, radius) in zip(rows, found, strict=True):
        inside = sum((x * y for x, y in zip(row, middle, strict=True)), Fraction(0))
        norm = sum((x * x for x in middle), Fraction(0))
        apart = [x - inside / norm * y for x, y in zip(row, middle, strict=True)]
        size = sum((x * x for x in row), Fraction(0))
        sine = math.sqrt(sum((x * x for x in apart), Fraction(0)) / size)
        around = 4.0 * float(radius) * _ROUNDED_UP
        least = max(least, 2.0 * (sine / _ROUNDED_UP - around) / _ROUNDED_UP)
        far = 2.0 * (sine * (1.0 + sine * sine) + around) * _ROUNDED_UP
        most = max(most, far if sine <= 0.5 and 2.0 * radius <= 1.0 else math.pi)
    return least, most


def _up(x: float) -> float:
    return math.nextafter(x, math.inf)


def _down(x: float) -> float:
    return math.nextafter(x, -math.inf)


def _warning(claimed: float, proved: float, unit: str) -> str:
    return (
        f"the estimate of the reference ({at_most(claimed)} {unit}) is below its proved error "
        f"({at_most(proved)} {unit})"
    )
