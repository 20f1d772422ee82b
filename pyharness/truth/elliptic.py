"""Torque-free motion in decimal arithmetic by Jacobi's elliptic functions, to check other methods.

Unlike the solution by Taylor series, this solution loses no digits with time. Therefore a long time
with many flips near the separatrix takes no more work than a short time. The module shares no code
with the closed form that it checks. Unlike the closed form it uses decimal arithmetic and Landen's
transformation.
"""

import decimal
import itertools
from collections.abc import Sequence
from decimal import Decimal

from pyharness.model.scene import Scene, checked_scene
from pyharness.truth.decimal_functions import sine_cosine
from pyharness.truth.decimal_series import Row
from pyharness.truth.reference import exact_coefficients

# Digits of the arithmetic, in addition to the digits that the squares of small components need.
_DIGITS = 90


def torque_free(scene: Scene, time: float, rounded: bool = False) -> Row:
    """Return omega (rad/s) of a scene without torque at `time` (s).

    The motion must be bounded, as it is if the coefficients A, B and C belong to moments. If
    `rounded` is true, A, B and C rounded to binary64 are used instead of the exact coefficients.
    Raise InputError if the torque depends on the state.
    """
    checked_scene(scene)
    with decimal.localcontext() as context:
        context.prec = _DIGITS
        context.Emax, context.Emin = decimal.MAX_EMAX, decimal.MIN_EMIN
        omega = [Decimal(w) for w in scene.omega]
        coefficients = exact_coefficients(scene)
        context.prec += 2 * _decades(omega) + 2 * _decades(coefficients)
        coefficients = exact_coefficients(scene)
        if rounded:
            coefficients = [Decimal(x) for x in scene.euler_coefficients]
        return _solution(coefficients, omega, Decimal(time))


def _decades(values: Row) -> int:
    """Return the difference of the decimal exponents of the largest and the smallest magnitude.

    Zeros among `values` are ignored.
    """
    powers = [value.adjusted() for value in values if value]
    return max(powers) - min(powers) if powers else 0


def _solution(coefficients: Sequence[Decimal], start: Sequence[Decimal], time: Decimal) -> Row:
    if not any(coefficients):
        return list(start)
    # Permute the axes so that the coefficient whose sign differs from the two others is the second.
    # Make it negative by changing the signs of all coefficients and of all components of omega.
    for first, sign in itertools.product(range(3), (1, -1)):
        axes = [first, (first + 1) % 3, (first + 2) % 3]
        a = [sign * coefficients[axis] for axis in axes]
        if a[0] >= 0 > a[1] and a[2] >= 0:
            break
    else:
        raise ValueError("the motion is not bounded")
    omega = [sign * start[axis] for axis in axes]
    if not (a[0] and a[2]):
        found = _turned(a, omega, time)
    else:
        s1, s2, s3 = (abs(each) for each in a)
        factors = [(s2 * s3).sqrt(), (s1 * s3).sqrt(), (s1 * s2).sqrt()]
        scaled = [f * w for f, w in zip(factors, omega, strict=True)]
        found = [x / f for f, x in zip(factors, _normal(scaled, time), strict=True)]
    result = [Decimal(0)] * 3
    for axis, value in zip(axes, found, strict=True):
        result[axis] = sign * value
    return result


def _turned(a: Sequence[Decimal], omega: Row, time: Decimal) -> Row:
    """Return omega (rad/s) at `time` (s) of a motion in which the first or third coefficient is 0.

    The component of omega about the axis with coefficient 0 is constant, and the two other
    components move on an ellipse. `a` contains the three Euler coefficients, of which the second
    one is negative. `omega` contains the initial components (rad/s).
    """
    axis = 0 if not a[0] else 2
    other = 2 - axis
    # With u the component about the axis `other` and v the component about the second axis,
    # u' = a[other] v w and v' = a[1] u w, where w, the component about `axis`, is constant.
    w = omega[axis]
    upper, lower = a[other] * w, a[1] * w
    rate = (-upper * lower).sqrt()
    row = list(omega)
    if rate:
        sine, cosine = sine_cosine(rate * time)
        row[other] = omega[other] * cosine + upper * omega[1] * sine / rate
        row[1] = omega[1] * cosine + lower * omega[other] * sine / rate
    return row


def _normal(start: Row, time: Decimal) -> Row:
    """Return x, y, z at `time` (s), where x' = y z, y' = -z x, z' = x y.

    `start` contains x, y, z at time 0 (1/s). The solution uses the addition theorems of the
    elliptic functions sn, cn and dn.
    """
    x, y, z = start
    p, q = x * x + y * y, z * z + y * y
    if q < p:
        return _normal([z, y, x], time)[::-1]
    if not p:
        return list(start)
    sign = -1 if z < 0 else 1
    root_p, root_q = p.sqrt(), q.sqrt()
    # x = root_p cn, y = -sign root_p sn, z = sign root_q dn.
    s0, c0, d0 = -sign * y / root_p, x / root_p, abs(z) / root_q
    k2 = p / q
    s, c, d = jacobi(root_q * time, (q - p) / q)
    under = 1 - k2 * s0 * s0 * s * s
    sn = (s0 * c * d + s * c0 * d0) / under
    cn = (c0 * c - s0 * s * d0 * d) / under
    dn = (d0 * d - k2 * s0 * c0 * s * c) / under
    return [root_p * cn, -sign * root_p * sn, sign * root_q * dn]


def jacobi(u: Decimal, comodulus: Decimal) -> tuple[Decimal, Decimal, Decimal]:
    """Return Jacobi's elliptic functions sn, cn and dn of the argument `u`.

    `comodulus` is the square of the complementary modulus, 1 - k**2 with the modulus k. The method
    is the descending Landen transformation (Abramowitz and Stegun 16.12).
    """
    if not comodulus:
        e = (-abs(u)).exp()
        cn = 2 * e / (1 + e * e)
        return ((1 - e * e) / (1 + e * e)).copy_sign(u), cn, cn
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
    # The remaining modulus is so small that its square, which alone has an effect, is negligible.
    sn, cn = sine_cosine(u / (1 + k1))
    dn = Decimal(1)
    levels.append(k1)
    for k1 in reversed(levels):
        square = k1 * sn * sn
        sn, cn = (1 + k1) * sn / (1 + square), cn * dn / (1 + square)
        dn = (1 - square) / (1 + square)
    return sn, cn, dn
