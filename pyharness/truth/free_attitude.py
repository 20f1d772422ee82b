"""Attitude of a torque-free body at any time in decimals.

In each period of omega the body rotates about the angular momentum by the same angle, so that
Taylor series integrate only one period. Near the separatrix, errors of omega grow exponentially;
each segment therefore starts from the omega of `elliptic.py`. No code is shared with the checked
closed form.
"""

import decimal
from decimal import Decimal
from fractions import Fraction

from pyharness.model.attitude import product
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, checked_scene
from pyharness.truth.decimal_functions import Row, pi, sine_cosine, to_decimal, unit
from pyharness.truth.decimal_series import taylor_series
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import exact_coefficients

_DIGITS = 50  # of the arithmetic; thirty are correct after 1e6 periods
_ORDER, _TOLERANCE = 44, Decimal("1e-44")
# Length of a segment in units of 1/rate; errors grow in it by a factor of some e**10 = 2e4.
_SEGMENT = 10
# On the separatrix omega counts as steady where sech(rate * time - u) is below some e**-_SETTLED.
_SETTLED = 120
_MOST_RADIANS = 1e5  # work limit of the integration; some three minutes


def free_attitude(scene: Scene, time: float) -> Row:
    """Return the torque-free attitude at `time` (s), a unit quaternion that is continuous in time.

    Raise InputError if the integration would take too long.
    """
    checked_scene(scene)
    assert scene.attitude is not None
    with decimal.localcontext(prec=_DIGITS, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN):
        begin = unit([Decimal(x) for x in scene.attitude])
        end = Decimal(time)
        if is_steady(scene):
            return _rotated(begin, [Decimal(w) for w in scene.omega], end)
        rate, period = _rate_and_period(scene)
        if period is None:
            # On the separatrix, integrate until omega is constant to all digits.
            settled = min(abs(end), _settling_time(scene, rate)).copy_sign(end)
            after = _followed(scene, [settled], rate)[0]
            return _rotated(after, torque_free(scene, settled), end - settled)
        if abs(end) <= period:
            return _followed(scene, [end], rate)[0]
        whole, rest = divmod(abs(end), period)
        period, rest = period.copy_sign(end), rest.copy_sign(end)
        after_rest, after_period = _followed(scene, [rest, period], rate)
        # Any period changes the attitude by this rotation in space.
        turn = list(product(after_period, conjugate(begin)))
        return unit(list(product(_power(turn, int(whole)), after_rest)))


def period_of(scene: Scene) -> Decimal | None:
    """Return the period of omega (s) to nearly all digits, or None on the separatrix."""
    return _rate_and_period(scene)[1]


def _rate_and_period(scene: Scene) -> tuple[Decimal, Decimal | None]:
    """Return the elliptic functions' rate (1/s), and omega's period (s; None on the separatrix)."""
    i, w = list(scene.exact_moments or ()), [Fraction(x) for x in scene.omega]
    low, middle, high = sorted(range(3), key=lambda axis: i[axis])
    energies = [moment * rate * rate for moment, rate in zip(i, w, strict=True)]
    lower, upper, both = i[middle] - i[low], i[high] - i[middle], i[high] - i[low]
    gap = energies[low] * lower - energies[high] * upper
    # With kinetic energy T and angular momentum L, `gap` is 2 T I_middle - L**2, `stays` is
    # 2 T I_high - L**2, and `turns` is L**2 - 2 T I_low.
    stays = energies[low] * both + energies[middle] * upper
    turns = energies[high] * both + energies[middle] * lower
    # Perturbations grow at most by a factor of some exp(rate * time).
    larger = lower * stays if gap > 0 else upper * turns
    if not larger:
        return Decimal(0), None
    mean, other = (_root(larger / (i[0] * i[1] * i[2])), _root(both * abs(gap) / larger))
    if not gap:
        return mean, None
    least, most = other, Decimal(1)
    while most - least > most.scaleb(3 - decimal.getcontext().prec):
        most, least = (most + least) / 2, (most * least).sqrt()
    return mean, 2 * pi(decimal.getcontext().prec) / (mean * most)


def _settling_time(scene: Scene, rate: Decimal) -> Decimal:
    """Return the time (s) from 0 after which separatrix motion is steady."""
    i, w = list(scene.exact_moments or ()), [Fraction(x) for x in scene.omega]
    low, middle, high = sorted(range(3), key=lambda axis: i[axis])
    energies = [moment * rate * rate for moment, rate in zip(i, w, strict=True)]
    # Omega is steady where its components about the axes of the least and the largest moment, both
    # proportional to sech(rate * time - u), are negligible; exp(abs(u)) is at most 2/sech(u). Where
    # the sech is 1, omega has no middle component, and `part` of the energy is about the low axis.
    part = (i[high] - i[middle]) / (i[high] - i[low])
    return ((2 * _root(sum(energies) * part / energies[low])).ln() + _SETTLED) / rate


def _rotated(q: Row, omega: Row, time: Decimal) -> Row:
    speed = sum((w * w for w in omega), Decimal(0)).sqrt()
    sine, cosine = sine_cosine(speed * time / 2)
    across = [w * sine / speed for w in omega] if speed else omega
    return list(product(q, [cosine, *across]))


def is_steady(scene: Scene) -> bool:
    i, w = list(scene.exact_moments or ()), [Fraction(x) for x in scene.omega]
    return all((i[a - 1] - i[a - 2]) * w[a - 1] * w[a - 2] == 0 for a in range(3))


def conjugate(q: Row) -> Row:
    return [q[0], -q[1], -q[2], -q[3]]


def _followed(scene: Scene, times: Row, rate: Decimal) -> list[Row]:
    """Return the attitude at each of `times` (s), in order away from 0, or raise InputError."""
    angle = max(map(abs, scene.omega)) * float(abs(times[-1]))
    if angle > _MOST_RADIANS:
        raise InputError(
            f"the attitude needs an integration over {angle:.2g} rad, above the limit of "
            f"{_MOST_RADIANS:.0e} rad; give a time closer to 0, or moments farther from symmetry"
        )
    coefficients = exact_coefficients(scene)
    q, begin, rows = unit([Decimal(x) for x in scene.attitude or ()]), Decimal(0), []
    for time in times:
        count = int(abs(time - begin) * rate / _SEGMENT) + 1
        ends = [begin + (time - begin) * k / count for k in range(1, count)]
        for end in [*ends, time]:
            state = [+w for w in torque_free(scene, begin)] + q
            series = taylor_series(
                scene, coefficients, [end - begin], False, _ORDER, _TOLERANCE, None, state
            )
            q, begin = unit(series[0][3:]), end
        rows.append(q)
    return rows


def _power(turn: Row, count: int) -> Row:
    found = [Decimal(1), Decimal(0), Decimal(0), Decimal(0)]
    while count:
        if count % 2:
            found = list(product(found, turn))
        turn, count = list(product(turn, turn)), count // 2
    return found


def _root(x: Fraction) -> Decimal:
    return to_decimal(x).sqrt()
