"""Torque-free motion by Jacobi's elliptic functions in decimals.

Unlike Taylor series, the functions lose no digits with time, and flips (sign changes of omega near
the separatrix) take no more work. No code is shared with the checked closed form.
"""

import decimal
import itertools
from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction

from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, checked_scene
from pyharness.truth.decimal_functions import Row, sine_cosine, to_decimal

# Digits of the arithmetic; squares of small components need more.
_DIGITS = 90


def torque_free(scene: Scene, time: float | Decimal, rounded: bool = False) -> Row:
    """Return omega (rad/s) of a scene without torque at `time` (s).

    Raise InputError if an unsteady motion may be unbounded.
    """
    i = checked_scene(scene).exact_moments
    a, w = [Fraction(x) for x in scene.euler_coefficients], [Fraction(x) for x in scene.omega]
    # Unless `rounded` to binary64, A, B and C are exact.
    if i is not None and not rounded:
        a = [(i[k - 2] - i[k - 1]) / i[k] for k in range(3)]
    with decimal.localcontext(
        prec=_DIGITS, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN
    ) as context:
        if not any(a[k] * w[k - 1] * w[k - 2] for k in range(3)):
            return [Decimal(x) for x in scene.omega]
        context.prec += 2 * _decades(w) + 2 * _decades(a)
        return _solution(a, w, Decimal(time))


def _decades(values: Sequence[Fraction]) -> int:
    powers = [to_decimal(value).adjusted() for value in values if value]
    return max(powers) - min(powers) if powers else 0


def _solution(coefficients: Sequence[Fraction], start: Sequence[Fraction], time: Decimal) -> Row:
    # In the formulas, the second coefficient is negative and the others are not. The signs of all
    # coefficients and all components of omega may be changed together.
    for first, sign in itertools.product(range(3), (1, -1)):
        axes = [first, (first + 1) % 3, (first + 2) % 3]
        a = [sign * coefficients[axis] for axis in axes]
        if a[0] >= 0 > a[1] and a[2] >= 0 and (a[0] or a[2]):
            break
    else:
        raise InputError(
            "the motion is not bounded; allowed: a steady rotation, or coefficients of which one "
            "is above 0 and one below 0, or all 0"
        )
    omega = [sign * start[axis] for axis in axes]
    if a[0] and a[2]:
        found = _general(a, omega, time)
    else:
        found = _move_on_ellipse([to_decimal(x) for x in a], [to_decimal(x) for x in omega], time)
    result = [Decimal(0)] * 3
    for axis, value in zip(axes, found, strict=True):
        result[axis] = sign * value
    return result


def _general(a: Sequence[Fraction], omega: Sequence[Fraction], time: Decimal) -> Row:
    """Return omega (rad/s) at `time` (s) if no coefficient is 0 and the second is negative."""
    # The scaled components x, y, z (1/s) obey x' = y z, y' = -z x, z' = x y. Their integrals p =
    # x**2 + y**2 and q = z**2 + y**2 are compared as fractions: on the separatrix, where p = q,
    # a rounding error would cause flips.
    s1, s2, s3 = (abs(each) for each in a)
    squares = [s2 * s3, s1 * s3, s1 * s2]
    x2, y2, z2 = (f * w * w for f, w in zip(squares, omega, strict=True))
    p, q = x2 + y2, z2 + y2
    with decimal.localcontext() as context:
        if p != q:
            # Near the separatrix the solution loses digits by cancellation.
            context.prec += max(0, -to_decimal(abs(q - p) / max(p, q)).adjusted())
        factors = [to_decimal(f).sqrt() for f in squares]
        x, y, z = (f * to_decimal(w) for f, w in zip(factors, omega, strict=True))
        scaled = [x, y, z] if p <= q else [z, y, x]
        found = _normal(scaled, min(p, q), max(p, q), time)
        return [x / f for f, x in zip(factors, found if p <= q else found[::-1], strict=True)]


def _move_on_ellipse(a: Row, omega: Row, time: Decimal) -> Row:
    """Return omega (rad/s) at `time` (s) if the second coefficient is negative and another is 0."""
    axis = 0 if not a[0] else 2
    other = 2 - axis
    # Let u, v and w be the components about `other`, the second axis and `axis`. Then
    # u' = a[other] v w and v' = a[1] u w, and w is constant.
    w = omega[axis]
    upper, lower = a[other] * w, a[1] * w
    rate = (-upper * lower).sqrt()
    row = list(omega)
    if rate:
        sine, cosine = sine_cosine(rate * time)
        row[other] = omega[other] * cosine + upper * omega[1] * sine / rate
        row[1] = omega[1] * cosine + lower * omega[other] * sine / rate
    return row


def _normal(start: Row, p: Fraction, q: Fraction, time: Decimal) -> Row:
    """Return x, y, z (1/s) at `time` (s), where x' = y z, y' = -z x, z' = x y."""
    # The addition theorems of sn, cn and dn give the solution. `start` has z other than 0; p = x**2
    # + y**2 is not 0, and q = z**2 + y**2 is at least p.
    x, y, z = start
    sign = -1 if z < 0 else 1
    root_p, root_q, k2 = to_decimal(p).sqrt(), to_decimal(q).sqrt(), to_decimal(p / q)
    # x = root_p cn, y = -sign root_p sn, z = sign root_q dn.
    s0, c0, d0 = -sign * y / root_p, x / root_p, abs(z) / root_q
    s, c, d = jacobi(root_q * time, to_decimal(1 - p / q))
    under = 1 - k2 * s0 * s0 * s * s
    sn = (s0 * c * d + s * c0 * d0) / under
    cn = (c0 * c - s0 * s * d0 * d) / under
    dn = (d0 * d - k2 * s0 * c0 * s * c) / under
    return [root_p * cn, -sign * root_p * sn, sign * root_q * dn]


def jacobi(u: Decimal, comodulus: Decimal) -> tuple[Decimal, Decimal, Decimal]:
    """Return sn, cn and dn of `u` with the modulus k; `comodulus` is 1 - k**2."""
    if not comodulus:
        e = (-abs(u)).exp()
        cn = 2 * e / (1 + e * e)
        return ((1 - e * e) / (1 + e * e)).copy_sign(u), cn, cn
    # Descending Landen transformation (Abramowitz and Stegun 16.12).
    levels = []
    complement = comodulus.sqrt()
    least = Decimal(1).scaleb(-decimal.getcontext().prec - 5)
    while True:
        # k1 = (1 - k') / (1 + k'), from k**2 = 1 - k'**2 without cancellation.
        k1 = (1 - complement) / (1 + complement)
        if k1 * k1 < least:
            break
        levels.append(k1)
        u = u / (1 + k1)
        complement = 2 * complement.sqrt() / (1 + complement)
    # The square of the remaining modulus, on which the functions depend, is negligible.
    sn, cn = sine_cosine(u / (1 + k1))
    dn = Decimal(1)
    levels.append(k1)
    for k1 in reversed(levels):
        square = k1 * sn * sn
        sn, cn = (1 + k1) * sn / (1 + square), cn * dn / (1 + square)
        dn = (1 - square) / (1 + square)
    return sn, cn, dn
