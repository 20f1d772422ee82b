"""Reference solutions of scenes, with estimates of their errors.

A sphere, and a symmetric body without torque, have a closed form. Other scenes are solved by Taylor
series of equations 13-15 of the thesis in decimals, with exact Euler coefficients. No code is
shared with the checked methods.
"""

import decimal
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal

import numpy as np

from pyharness.model.constant_body import with_constant_body
from pyharness.model.errors import InputError
from pyharness.model.inertia_function import InertiaFunction
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque, of_law
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array
from pyharness.truth.decimal_functions import Row, sine_cosine, to_decimal, unit
from pyharness.truth.decimal_series import divisors, taylor_series

DIGITS = 40
# Order and local tolerance (relative to the solution) of the two Taylor series that are compared.
_QUICK = ((20, Decimal("1e-19")), (24, Decimal("1e-22")))
_PRECISE = ((32, Decimal("1e-31")), (37, Decimal("1e-35")))
_HALF_ULP = 2.0**-53
# Precise integrations differ by little more than rounding errors. Their difference may by chance be
# less than the error, by a factor of at most 2.5 in 1500 scenes (tests.campaigns.proved).
_BY_CHANCE = 4


@dataclass(frozen=True, eq=False)
class Reference:
    """The solution at requested times, rounded to binary64, and its estimated error."""

    time: Array  # shape (n,), s; the requested times, up to the last one with finite omega
    omega: Array  # shape (n, 3), rad/s
    # shape (n, 3), m/s; velocity of the scene's first mass under the scene's forces, or None
    velocity: Array | None
    source: str  # a text that states how the solution was computed
    estimate: float  # estimated error of any omega before rounding (rad/s)
    # shape (n, 3), rad/s; the part of omega that rounding removed, rounded to binary64
    remainder: Array | None = None
    attitude: Array | None = None  # shape (n, 4), unit quaternions; None if the scene has none
    angle_estimate: float = 0.0  # estimated error of any attitude before rounding (rad)

    @property
    def angle_error(self) -> float:
        """The attitude's estimated error (rad), including rounding."""
        return self.angle_estimate + 4.0 * _HALF_ULP

    @property
    def error(self) -> float:
        """Omega's estimated error (rad/s), including the largest rounding error."""
        largest = float(np.max(np.abs(self.omega), initial=0.0))
        return self.estimate + _HALF_ULP * largest


def reference(
    scene: Scene,
    times: Sequence[float],
    velocity: bool = False,
    precise: bool = False,  # errors of at most 1e-25 before rounding, unless amplified
    effort: float | None = None,  # factor on a limit of some ten seconds; None: up to 100 000 steps
) -> Reference:
    """Return the reference solution of a scene at `times` (s), in order away from 0.

    Raise InputError if none is found.
    """
    if scene.changing is not None:
        scene.changing.check(times)
        if isinstance(scene.changing, InertiaFunction):
            scene = with_constant_body(scene)
        # A recorded law has amplitudes of one frequency added in binary64, with rounding errors.
        if isinstance(scene.torque, TorqueLaw) and scene.torque.in_space:
            scene = replace(scene, torque=of_law(scene.torque))
    _check_torque(scene)
    check_order(times, "reference")
    with decimal.localcontext(prec=DIGITS, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN):
        exact = [Decimal(t) for t in times]
        known = known_solution(scene, exact)
        if known is not None and not velocity and scene.attitude is None:
            largest = max(abs(x) for row in known for x in (*row, *map(Decimal, scene.omega)))
            estimate = min(Decimal(1), largest).scaleb(3 - DIGITS)
            within = list(itertools.takewhile(lambda row: np.isfinite(_array([row])).all(), known))
            return _rounded(times[: len(within)], within, None, "known solution", estimate)
        coefficients = exact_coefficients(scene) if scene.changing is None else []
        coarse, fine = _PRECISE if precise else _QUICK
        first = taylor_series(scene, coefficients, exact, False, *coarse, effort)
        second = taylor_series(scene, coefficients, exact, velocity, *fine, effort)
        rows = min(len(first), len(second))
        omega = [row[:3] for row in second[:rows]]
        estimate = _largest_difference([row[:3] for row in first[:rows]], omega)
        if precise:
            estimate *= _BY_CHANCE
        speed = [row[3:6] for row in second[:rows]] if velocity else None
        source = f"Taylor series in {DIGITS}-digit arithmetic"
        if known is not None:
            estimate = max(estimate, _largest_difference(known[:rows], omega))
            omega, source = known[:rows], "known solution"
        found = _rounded(times[:rows], omega, speed, source, estimate)
        if scene.attitude is None:
            return found
        turned, coarser = ([unit(row[-4:]) for row in each[:rows]] for each in (second, first))
        angle = float(4 * _largest_difference(coarser, turned))
        return replace(found, attitude=_array(turned, 4), angle_estimate=angle)


def check_order(times: Sequence[float], who: str) -> None:
    """Raise InputError unless times are finite, on one side of 0, and lead away from it."""
    if not all(map(math.isfinite, times)):
        raise InputError(f"{who}: a time is not finite; allowed: finite numbers, in seconds")
    away = [abs(t) for t in times]
    one_side = bool(times) and (min(times) >= 0.0 or max(times) <= 0.0)
    if not (one_side and all(t1 < t2 for t1, t2 in itertools.pairwise(away))):
        raise InputError(
            f"{who}: allowed: times that are all positive or all negative, in order of increasing "
            "distance from 0"
        )


def _check_torque(scene: Scene) -> None:
    if not isinstance(scene.torque, StateTorque):
        return
    if scene.torque.tape is None:
        raise InputError(
            "an opaque torque has no Taylor series; allowed: a torque that can be recorded, or the "
            "methods of SciPy"
        )
    if scene.torque.needs_attitude and scene.attitude is None:
        raise InputError(
            "a torque that depends on the attitude needs it; give attitude=True, or --attitude FORM"
        )


def known_solution(scene: Scene, times: Sequence[Decimal]) -> list[Row] | None:
    """Return omega (rad/s) of a sphere or torque-free symmetric body in closed form, else None.

    The result has all digits of the decimal context.
    """
    if isinstance(scene.torque, StateTorque) or scene.changing is not None:
        return None
    with decimal.localcontext() as context:
        context.prec += _digits_before_the_point(scene, max(map(abs, times)))
        return _known_rows(scene, times)


def _digits_before_the_point(scene: Scene, time: Decimal) -> int:
    """Return a bound on the digits before the decimal point of all numbers up to `time` (s)."""
    law = scene.body_torque
    omega = max(Decimal(abs(w)) for w in scene.omega)
    rate = max(map(abs, exact_coefficients(scene))) * omega
    sizes = [omega, rate * time]
    least = min(map(Decimal, scene.moments or (1,)))
    pushes = [(law.constant, time), (law.rate, time * time)]
    for amplitude, frequency in law.sines + law.cosines:
        turns = Decimal(abs(frequency))
        sizes.append(turns * time)
        pushes.append((amplitude, 1 / turns if turns else time))
    sizes += [Decimal(max(map(abs, push))) * length / least for push, length in pushes]
    return max(0, max(sizes).adjusted() + 1)


def _known_rows(scene: Scene, times: Sequence[Decimal]) -> list[Row] | None:
    coefficients = exact_coefficients(scene)
    if not any(coefficients):
        return [_sphere(scene, t) for t in times]
    if not scene.torque.is_zero:
        return None
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        # With opposite coefficients, the two other components of omega move on a circle.
        if coefficients[axis] == 0 and coefficients[j] == -coefficients[k]:
            omega = [Decimal(w) for w in scene.omega]
            rate = coefficients[j] * omega[axis]
            rows = []
            for t in times:
                sine, cosine = sine_cosine(rate * t)
                row = list(omega)
                row[j] = omega[j] * cosine + omega[k] * sine
                row[k] = omega[k] * cosine - omega[j] * sine
                rows.append(row)
            return rows
    return None


def _sphere(scene: Scene, t: Decimal) -> Row:
    torque = scene.body_torque
    row = []
    for axis in range(3):
        total = Decimal(torque.constant[axis]) * t + Decimal(torque.rate[axis]) * t * t / 2
        for amplitude, frequency in torque.sines:
            if frequency:
                # 1 - cosine would have few digits for a small angle.
                sine, _ = sine_cosine(Decimal(frequency) * t / 2)
                total += Decimal(amplitude[axis]) * 2 * sine * sine / Decimal(frequency)
        for amplitude, frequency in torque.cosines:
            sine, _ = sine_cosine(Decimal(frequency) * t)
            rate = Decimal(frequency)
            total += Decimal(amplitude[axis]) * (sine / rate if frequency else t)
        row.append(Decimal(scene.omega[axis]) + total / to_decimal(divisors(scene)[axis]))
    return row


def exact_coefficients(scene: Scene) -> Row:
    """Return A, B, C to all digits of the decimal context."""
    if scene.coefficients is not None:
        return [Decimal(x) for x in scene.coefficients]
    i1, i2, i3 = divisors(scene)
    return [to_decimal(x) for x in ((i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3)]


def _array(rows: Sequence[Row], width: int = 3) -> Array:
    return np.array([[float(x) for x in row] for row in rows]).reshape(-1, width)


def _largest_difference(first: Sequence[Row], second: Sequence[Row]) -> Decimal:
    pairs = zip(itertools.chain(*first), itertools.chain(*second), strict=True)
    return max((abs(x - y) for x, y in pairs), default=Decimal(0))


def _rounded(
    times: Sequence[float],
    omega: Sequence[Row],
    velocity: Sequence[Row] | None,
    source: str,
    estimate: Decimal,
) -> Reference:
    remainder = _array([[x - Decimal(float(x)) for x in row] for row in omega])
    time, speed = np.array(times, dtype=float), None if velocity is None else _array(velocity)
    return Reference(time, _array(omega), speed, source, float(estimate), remainder)
