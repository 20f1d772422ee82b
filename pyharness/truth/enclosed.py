"""Balls (intervals, given by middle and radius) that contain the solution of a scene."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

from pyharness.model.scene import Scene

_LARGEST = 1e308  # largest radius of an energy, J
_LEAST = 1e-4  # least square of a unit of errors; the largest unit is 1


class Balls(NamedTuple):
    """Balls with exact middles and one common radius."""

    middle: tuple[Fraction, ...]
    radius: Fraction


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Balls that contain the solution of one scene; quantities not requested are None."""

    time: tuple[float, ...]  # s
    omega: tuple[Balls, ...]  # rad/s
    how: str  # names the method of the proof
    steps: int = 0  # 0 for a solution in closed form
    attitude: tuple[Balls, ...] | None = None  # unit quaternion, scalar first
    velocity: tuple[Balls, ...] | None = None  # m/s
    # State-transition matrix: by rows, derivatives of omega and of the unnormalised quaternion with
    # respect to omega at time 0.
    transition: tuple[Balls, ...] | None = None
    energy: tuple[Balls, ...] | None = None  # rotational energy, J

    @property
    def radius(self) -> float:
        return max((rounded_up(each.radius) for each in self.omega), default=0.0)

    def rows(self) -> list[dict[str, Any]]:
        rows = []
        for n, time in enumerate(self.time):
            row = row_of(time, self.omega[n])
            for name in ("attitude", "velocity", "transition", "energy"):
                found = getattr(self, name)
                if found is not None:
                    row[name], row[f"{name}_radius"] = decimals(found[n])
            rows.append(row)
        return rows


def with_energy(scene: Scene, found: Enclosure) -> Enclosure:
    if scene.moments is None:
        return found
    moments = scene.exact_moments or ()
    energies = []
    for middle, radius in found.omega:
        pairs = list(zip(moments, middle, strict=True))
        energy = sum((i * w * w / 2 for i, w in pairs), Fraction(0))
        error = sum((i * (abs(w) * radius + radius * radius / 2) for i, w in pairs), Fraction(0))
        if error > _LARGEST:  # a radius is a binary64 number
            return found
        energies.append(Balls((energy,), error))
    return replace(found, energy=tuple(energies))


def row_of(time: float, omega: Balls) -> dict[str, Any]:
    texts, radius = decimals(omega)
    return {"time": time, "omega": texts, "radius": radius}


def decimals(balls: Balls) -> tuple[list[str], float]:
    """Return middles as decimal strings, and a radius that includes their rounding errors."""
    digits = _digits(balls.radius)
    radius = rounded_up(balls.radius + Fraction(1, 2 * 10**digits))
    return [_decimal(x, digits) for x in balls.middle], radius


def rounded_up(x: Fraction) -> float:
    """Return a binary64 number, of four digits if possible, that is at least `x` >= 0."""
    # A factor above 1 compensates for rounding to a decimal string.
    candidates = (float(f"{float(x) * factor:.3e}") for factor in (1.0, 1.001, 1.01))
    # Near the least binary64 number, the factors may change nothing.
    above = math.nextafter(float(x), math.inf)
    return next((each for each in candidates if Fraction(each) >= x), above)


def largest_radius(omega: Sequence[Balls], digits: int) -> Fraction:
    """Return the largest ratio of a ball's radius to the radius allowed for `digits` digits."""
    largest = Fraction(0)
    for middle, radius in omega:
        largest = max(largest, radius * 10**digits / max(Fraction(1), *map(abs, middle)))
    return largest


def _digits(radius: Fraction) -> int:
    """Return the number of decimals with which rounding adds little to a radius."""
    if not radius:
        return 40
    excess = radius.denominator.bit_length() - radius.numerator.bit_length()
    return max(0, int(excess * 0.30103) + 3)


def _decimal(x: Fraction, digits: int) -> str:
    whole = (abs(x.numerator) * 10**digits * 2 + x.denominator) // (2 * x.denominator)
    sign = "-" if x < 0 and whole else ""
    text = str(whole).rjust(digits + 1, "0")
    return sign + (f"{text[:-digits]}.{text[-digits:]}" if digits else text)


def scales_of(coefficients: Sequence[Fraction]) -> list[float]:
    """Return the units in which proofs measure errors of omega's components.

    They are square roots of absolute Euler coefficients over the largest, at least 0.01.
    """
    # Unless a unit was raised to 0.01, the Jacobian's logarithmic norm is 0 for rotations about the
    # axes of largest and smallest moment.
    sizes = [abs(x) for x in coefficients]
    largest = max(sizes) or Fraction(1)
    return [math.sqrt(max(float(x / largest), _LEAST)) for x in sizes]
