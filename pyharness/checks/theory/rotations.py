"""Steady rotations under constant torque, and their linear stability.

Grammel's method, equation 32 of the thesis (III.4.a), adds to a steady rotation (a, b, c) a small
perturbation proportional to exp(Q t). With Euler's coefficients A, B, C and the torque divided by
the moments, M, a rotation is steady if A bc = -M1, B ca = -M2, C ab = -M3. The rates Q (1/s) are
the roots of Q**3 - (BC a**2 + CA b**2 + AB c**2) Q - 2 ABC abc = 0.

`share` is the initial perturbation divided by the rotation. Of a continuous family, only some
rotations are reported.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pyharness.engine.methods.linearised import jacobians
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import ROUNDING, Array

Rates = tuple[complex, complex, complex]
Places = list[tuple[str, Triple]]  # description and omega (rad/s) of steady rotations

_OVERFLOWS = (
    "rotations: a steady rotation or its rates overflow; use a smaller omega or torque, or moments "
    "nearer to each other"
)
# Points shown on a hyperbola of steady rotations: ratios of a component of omega to its value at
# the vertex.
_ALONG = (0.25, 0.5, 1.0, 2.0, 4.0)
_SHOWN = "shown, of one branch, the vertex and points of 1/4, 1/2, 2 and 4 times its"
# Error at which the linear approximation becomes invalid: relative to the perturbation, or a phase
# (rad).
OFF = 0.1


@dataclass(frozen=True)
class SteadyRotation:
    """A steady rotation, and how a small perturbation of it develops."""

    place: str  # an axis, a point of a hyperbola, ...
    omega: Triple  # rad/s
    rates: Rates  # Q of equation 32 (1/s), the fastest growth first
    # True if no small perturbation grows, neither like exp(Q t) nor, if all Q are 0, like t.
    stable: bool
    # Shortest time (s) between flips of the perturbed motion, or None without flips.
    flip_interval: float | None
    # Earliest time (s) at which the linear approximation has the error `OFF`, or None if unknown.
    linear_until: float | None

    @property
    def doubling_time(self) -> float | None:
        """The doubling time (s) of the fastest growth, or None without growth."""
        rate = self.rates[0].real
        return math.log(2.0) / rate if rate > 0.0 else None

    @property
    def period(self) -> float | None:
        """The period of the fastest oscillation (s), or None without oscillation."""
        rate = max(abs(each.imag) for each in self.rates)
        return 2.0 * math.pi / rate if rate > 0.0 else None


@dataclass(frozen=True)
class SteadyRotations:
    told: str  # text: which steady rotations exist, and which are shown
    disturbance: float  # initial perturbation divided by the rotation
    rotations: tuple[SteadyRotation, ...]


def steady_rotations(scene: Scene, disturbance: float) -> SteadyRotations:
    """Return a scene's steady rotations under the relative perturbation `disturbance`."""
    if scene.body_torque.varies:
        raise InputError(
            "rotations: the torque varies with time, so that no rotation is steady; "
            "allowed: a constant torque, or none"
        )
    told, places = _places(scene)
    if not np.isfinite([omega for _, omega in places]).all():
        raise InputError(_OVERFLOWS)
    found = tuple(_rotation(scene, place, omega, disturbance) for place, omega in places)
    return SteadyRotations(told, disturbance, found)


def rates(coefficients: Triple, omega: Triple) -> Rates:
    """Return the three rates Q of a steady rotation (1/s), the largest real part first."""
    size = max(map(abs, omega))
    if size == 0.0:
        return 0j, 0j, 0j
    # Components of at most 1, whose products do not overflow.
    (a, b, c), (x, y, z) = coefficients, (w / size for w in omega)
    terms = (b * c * x * x, c * a * y * y, a * b * z * z)
    slope, half = sum(terms), a * b * c * x * y * z
    if abs(slope) <= 16.0 * ROUNDING * sum(map(abs, terms)):
        slope = 0.0  # the terms cancel to rounding
    roots = sorted(_roots(slope, half), key=lambda q: (-q.real, -q.imag))
    first, second, third = (size * q + 0j for q in roots)  # no -0.0
    return first, second, third


def _roots(slope: float, half: float) -> Rates:
    """Return the roots of Q**3 - slope Q - 2 half = 0, accurate even if small."""
    if half == 0.0:
        root = cmath.sqrt(slope)
        return root, 0j, -root
    # The root with the sign of `half` is simple; its formula has no cancellation.
    unit = math.sqrt(abs(slope) / 3.0)
    ratio = abs(half) / unit**3 if unit**3 > 0.0 else math.inf
    if math.isinf(ratio):
        first = math.cbrt(2.0 * abs(half))
    elif slope < 0.0:
        first = 2.0 * unit * math.sinh(math.asinh(ratio) / 3.0)
    elif ratio > 1.0:
        first = 2.0 * unit * math.cosh(math.acosh(ratio) / 3.0)
    else:
        first = 2.0 * unit * math.cos(math.acos(ratio) / 3.0)
    first = math.copysign(first, half)
    rest = slope - 0.75 * first * first
    if rest <= 0.0:
        pair = complex(-0.5 * first, math.sqrt(-rest))
        return complex(first), pair, pair.conjugate()
    second = -0.5 * first - math.copysign(math.sqrt(rest), first)
    return complex(first), complex(second), complex(2.0 * half / (first * second))


def _rotation(scene: Scene, place: str, omega: Triple, disturbance: float) -> SteadyRotation:
    with np.errstate(over="ignore", invalid="ignore"):
        matrix = jacobians(scene, np.array([omega]))[0]
    found = rates(scene.euler_coefficients, omega)
    if not np.isfinite([*matrix.flat, *found]).all():
        raise InputError(_OVERFLOWS)
    # The sum of the rates is 0. If all are 0 but the Jacobian is not, a perturbation grows like t.
    stable = found[0].real <= 0.0 and (any(found) or not matrix.any())
    flips: float | None = None
    until: float | None = None
    if found[0].real > 0.0:
        until = _growing(scene, omega, found[0], matrix, disturbance)
    if scene.torque.is_zero and any(omega):
        axis = max(range(3), key=lambda i: abs(omega[i]))
        coefficients = np.roll(scene.euler_coefficients, -axis).tolist()
        if stable:
            until = _phase(coefficients, found[0].imag, disturbance)
        elif found[0].real > 0.0:
            flips = _flip_interval(coefficients, abs(omega[axis]), disturbance)
    return SteadyRotation(place, omega, found, stable, flips, until)


@np.errstate(all="ignore")
def _growing(
    scene: Scene, omega: Triple, rate: complex, matrix: Array, share: float
) -> float | None:
    """Return the time (s) at which second-order terms reach a tenth of a growing perturbation."""
    # The eigenvector of `rate`, the complex rate (1/s) of fastest growth; `matrix` is the Jacobian.
    grows = np.linalg.svd(matrix - rate * np.eye(3))[2][-1].conj()
    second = 0.0
    for twice, other in ((2.0 * rate, grows), (2.0 * rate.real, grows.conj())):
        products = np.roll(grows, -1) * np.roll(other, -2) + np.roll(grows, -2) * np.roll(other, -1)
        forced = 0.5 * np.array(scene.euler_coefficients) * products
        try:
            answer = np.linalg.solve(twice * np.eye(3) - matrix, forced)
        except np.linalg.LinAlgError:
            return None
        second += 0.5 * float(np.linalg.norm(answer))
    if second == 0.0 or not math.isfinite(second):
        return None if second else math.inf
    return max(0.0, math.log(OFF / second / (share * math.hypot(*omega))) / rate.real)


def _phase(coefficients: Sequence[float], rate: float, share: float) -> float | None:
    """Return the time (s) at which the phase error about a stable axis reaches 0.1 rad."""
    # `coefficients` are in cyclic order from the axis; `rate` is the frequency (rad/s) by linear
    # theory. A tilt by `share` (rad) towards another axis changes the frequency by the fraction
    # `share`**2 / 4 times the ratio of the first coefficient to the other axis's.
    spun, *others = map(abs, coefficients)
    if spun != 0.0 and rate == 0.0:
        return None  # only the spin drifts
    shift = 0.25 * share**2 * spun * rate / min(others) if spun else 0.0
    return OFF / shift if shift else math.inf


def _flip_interval(coefficients: Sequence[float], spin: float, share: float) -> float | None:
    """Return the shortest time (s) between flips about the middle axis, or None without flips."""
    # `coefficients` are in cyclic order from the middle axis, which requires opposite signs.
    first, second, third = coefficients
    if first * second >= 0.0 or first * third >= 0.0:
        return None
    scale = math.sqrt(abs(first)) * math.sqrt(abs(second)) * math.sqrt(abs(third))
    # Flips are most frequent for a perturbation along the axis with the smaller coefficient.
    tilt = share / math.sqrt(min(abs(second), abs(third)))
    high, low = scale * math.hypot(tilt, 1.0 / math.sqrt(abs(first))), scale * tilt
    # The time is 2 K / lambda, with lambda near the growth rate. The complete elliptic integral K
    # is pi / 2 divided by the arithmetic-geometric mean of 1 and the complementary modulus.
    while high - low > 4.0 * ROUNDING * high:
        high, low = 0.5 * (high + low), math.sqrt(high) * math.sqrt(low)
    return math.pi / high / spin


def _places(scene: Scene) -> tuple[str, Places]:
    coefficients, torque = scene.euler_coefficients, scene.normalized_torque(0.0)
    held = [axis for axis in range(3) if torque[axis] != 0.0]
    if not held:
        return _axes(coefficients, math.hypot(*scene.omega))
    for axis in held:
        if coefficients[axis] == 0.0:
            told = f"none: {'ABC'[axis]} = 0, so that nothing holds the torque about axis"
            return f"{told} {axis + 1}", []
    # The products w2 w3, w3 w1 and w1 w2 that balance the torque (rad2/s2).
    products = [-m / k if k else 0.0 for m, k in zip(torque, coefficients, strict=True)]
    if len(held) == 3:
        return _points(products)
    if len(held) == 1:
        return _hyperbola(coefficients, products[held[0]], held[0])
    (free,) = {0, 1, 2} - set(held)
    if coefficients[free] == 0.0:
        return _across(products, free)
    told = f"none: what holds torque about axes {held[0] + 1} and {held[1] + 1}"
    return f"{told} turns the body about axis {free + 1}", []


def _axes(coefficients: Triple, spin: float) -> tuple[str, Places]:
    if spin == 0.0:
        return "no torque, and a start at rest: shown is rest", [("rest", (0.0, 0.0, 0.0))]
    told = f"no torque: rotation about each axis, shown at the spin of the start, {spin:.6g} rad/s"
    zeros = [axis for axis in range(3) if coefficients[axis] == 0.0]
    if len(zeros) == 3:
        told += "; a sphere, for which every rotation is steady"
    elif len(zeros) == 2:
        (axis,) = {0, 1, 2} - set(zeros)
        one, other = (f"w{(axis + k) % 3 + 1}" for k in (1, 2))
        told += f"; every other with {one} = 0 or {other} = 0 is steady too"
    elif zeros:
        told += f"; about every axis across axis {zeros[0] + 1} as about the two shown"
    unit = [(spin, 0.0, 0.0), (0.0, spin, 0.0), (0.0, 0.0, spin)]
    return told, [(f"axis {number}", omega) for number, omega in enumerate(unit, 1)]


def _hyperbola(coefficients: Triple, product: float, held: int) -> tuple[str, Places]:
    """Return a text and points of a branch, for a torque about the axis `held` (from 0)."""
    # `product` is the product of the other two components of omega (rad2/s2).
    one, other = (held + 1) % 3, (held + 2) % 3
    told = (
        f"torque about axis {held + 1}: the hyperbola w{one + 1} w{other + 1} = {product:.6g}, "
        f"w{held + 1} = 0; {_SHOWN} w{one + 1}"
    )
    if coefficients[one] == coefficients[other] == 0.0:
        told += f"; to each any w{held + 1} may be added"
    along = dict.fromkeys(_ALONG, "hyperbola")
    # At the margin of stability Q**2 = C (B a**2 + A b**2) changes sign.
    if coefficients[one] * coefficients[other] < 0.0:
        along[(-coefficients[one] / coefficients[other]) ** 0.25] = "its margin"
        told += ", and the margin of stability"
    vertex = math.sqrt(abs(product))
    found = {f: {one: vertex * f, other: math.copysign(vertex / f, product)} for f in along}
    return told, [(along[factor], _three(found[factor])) for factor in sorted(along)]


def _three(components: dict[int, float]) -> Triple:
    x, y, z = (components.get(axis, 0.0) for axis in range(3))
    return x, y, z


def _across(products: Sequence[float], axis: int) -> tuple[str, Places]:
    """Return a text and points of a branch, for a torque across the axis of symmetry."""
    one, other = (axis + 1) % 3, (axis + 2) % 3
    # w_one w_axis and w_other w_axis.
    across = products[other], products[one]
    told = (
        f"torque across the axis of symmetry: the hyperbola w{one + 1} w{axis + 1} = "
        f"{across[0]:.6g}, w{other + 1} w{axis + 1} = {across[1]:.6g}; {_SHOWN} w{axis + 1}"
    )
    vertex = math.sqrt(math.hypot(*across))
    spins = [vertex * factor for factor in _ALONG]
    found = [{axis: spin, one: across[0] / spin, other: across[1] / spin} for spin in spins]
    return told, [("hyperbola", _three(each)) for each in found]


def _points(products: Sequence[float]) -> tuple[str, Places]:
    if sum(each < 0.0 for each in products) % 2:
        return "none: the square of a component would be below 0, for ABC M1 M2 M3 > 0", []
    roots = [math.sqrt(abs(each)) for each in products]
    if not all(roots):
        raise InputError(_OVERFLOWS)
    signs = [1.0, math.copysign(1.0, products[2]), math.copysign(1.0, products[1])]
    x, y, z = (signs[axis] * roots[axis - 2] * roots[axis - 1] / roots[axis] for axis in range(3))
    told = (
        "torque about all three axes: two rotations, opposite to each other, and so are their "
        "rates; neither is stable, for three rates whose sum is 0 and whose product is not have a "
        "real part above 0"
    )
    return told, [("first", (x, y, z)), ("second", (-x, -y, -z))]
