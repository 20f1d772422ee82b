"""Attitude of a torque-free body at any time in decimal arithmetic, to check other methods.

In each period of omega the body rotates about the angular momentum by the same angle. Therefore an
integration of omega and attitude over one period, by Taylor series, determines the attitude at any
time. This module shares no code with the closed form that it checks. It uses no theta function, and
it uses an elliptic integral only for the length of the period.
"""

import decimal
from decimal import Decimal
from fractions import Fraction

from pyharness.model.attitude import product
from pyharness.model.scene import Scene, checked_scene
from pyharness.truth.decimal_functions import pi, sine_cosine
from pyharness.truth.decimal_series import Row, taylor_series
from pyharness.truth.reference import exact_coefficients

# Digits of the arithmetic; thirty of them are correct after 1e6 periods.
_DIGITS = 50
_ORDER, _TOLERANCE = 44, Decimal("1e-44")


def free_attitude(scene: Scene, time: float) -> Row:
    """Return the attitude of a scene without torque at `time` (s), as a unit quaternion.

    The quaternion is a continuous function of time, which determines its sign. The scene must have
    moments and an attitude. The motion is integrated over at most one period of omega, which is
    long near the separatrix. On the separatrix omega has no period. There the motion is integrated
    from 0 to `time`. Raise InputError if the integration takes too many steps, or if the torque
    depends on the state.
    """
    checked_scene(scene)
    assert scene.attitude is not None
    with decimal.localcontext() as context:
        context.prec = _DIGITS
        context.Emax, context.Emin = decimal.MAX_EMAX, decimal.MIN_EMIN
        begin = _unit([Decimal(x) for x in scene.attitude])
        end = Decimal(time)
        if is_steady(scene):
            omega = [Decimal(w) for w in scene.omega]
            speed = sum((w * w for w in omega), Decimal(0)).sqrt()
            sine, cosine = sine_cosine(speed * end / 2)
            across = [w * sine / speed for w in omega] if speed else omega
            return list(product(begin, [cosine, *across]))
        period = period_of(scene)
        if period is None or abs(end) <= period:
            return _followed(scene, [end])[0]
        whole, rest = divmod(abs(end), period)
        period, rest = period.copy_sign(end), rest.copy_sign(end)
        after_rest, after_period = _followed(scene, [rest, period])
        # The rotation in space by which one period changes the attitude, whenever it begins.
        turn = list(product(after_period, conjugate(begin)))
        return _unit(list(product(_power(turn, int(whole)), after_rest)))


def period_of(scene: Scene) -> Decimal | None:
    """Return the period of omega (s) of a torque-free scene, or None on the separatrix.

    The period is accurate to nearly all digits of the current decimal arithmetic.
    """
    i, w = list(scene.exact_moments or ()), [Fraction(x) for x in scene.omega]
    low, middle, high = sorted(range(3), key=lambda axis: i[axis])
    energies = [moment * rate * rate for moment, rate in zip(i, w, strict=True)]
    lower, upper, both = i[middle] - i[low], i[high] - i[middle], i[high] - i[low]
    gap = energies[low] * lower - energies[high] * upper
    if not gap:
        return None
    # With T the kinetic energy and L the angular momentum these are 2 T I_high - L**2 and
    # L**2 - 2 T I_low; `gap` is 2 T I_middle - L**2.
    stays = energies[low] * both + energies[middle] * upper
    turns = energies[high] * both + energies[middle] * lower
    larger = lower * stays if gap > 0 else upper * turns
    mean, other = (_root(larger / (i[0] * i[1] * i[2])), _root(both * abs(gap) / larger))
    least, most = other, Decimal(1)
    while most - least > most.scaleb(3 - decimal.getcontext().prec):
        most, least = (most + least) / 2, (most * least).sqrt()
    return 2 * pi(decimal.getcontext().prec) / (mean * most)


def is_steady(scene: Scene) -> bool:
    """Return whether omega of a scene without torque is constant (steady rotation or rest)."""
    i, w = list(scene.exact_moments or ()), [Fraction(x) for x in scene.omega]
    return all((i[a - 1] - i[a - 2]) * w[a - 1] * w[a - 2] == 0 for a in range(3))


def conjugate(q: Row) -> Row:
    """Return the conjugate of a quaternion whose scalar component comes first.

    The conjugate of a unit quaternion represents the inverse rotation.
    """
    return [q[0], -q[1], -q[2], -q[3]]


def _followed(scene: Scene, times: Row) -> list[Row]:
    rows = taylor_series(scene, exact_coefficients(scene), times, False, _ORDER, _TOLERANCE, None)
    return [_unit(row[3:]) for row in rows]


def _power(turn: Row, count: int) -> Row:
    found = [Decimal(1), Decimal(0), Decimal(0), Decimal(0)]
    while count:
        if count % 2:
            found = list(product(found, turn))
        turn, count = list(product(turn, turn)), count // 2
    return found


def _unit(q: Row) -> Row:
    length = sum((x * x for x in q), Decimal(0)).sqrt()
    return [x / length for x in q]


def _root(x: Fraction) -> Decimal:
    return (Decimal(x.numerator) / x.denominator).sqrt()
