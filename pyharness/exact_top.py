"""Motions that are known at any time, however long: in decimal arithmetic, for the trials.

The torque-free top by Jacobi's elliptic functions, these by descending Landen transformations
(Abramowitz and Stegun, 16.12) and the addition theorems (16.17); a symmetric body whose torque
acts along its own axis, by the integral of the spin. Tested against mpmath and the reference.
"""

import decimal
from collections.abc import Sequence
from decimal import Decimal

from pyharness.decimal_functions import sine_cosine
from pyharness.errors import InputError
from pyharness.scene import Scene

DIGITS = 50

Row = list[Decimal]


def torque_free_top(
    coefficients: Sequence[float], omega: Sequence[float], times: Sequence[float]
) -> list[Row]:
    """Return omega of a body without torque, to some forty digits.

    Parameters
    ----------
    coefficients : sequence of three floats
        A, B, C of equations 13-15, taken as they are: of two signs, none zero.
    omega : sequence of three floats
        At time 0 (rad/s); not on the separatrix.
    times : sequence of float
        s, in any order and however large: the angle keeps its digits.

    Returns
    -------
    list of three Decimal for each time
        rad/s.

    Raises
    ------
    InputError
        Where the motion is none of these functions.
    """
    with _arithmetic(times, omega, coefficients):
        a = [Decimal(x) for x in coefficients]
        odd = [i for i in range(3) if a[i] * a[i - 1] < 0 and a[i] * a[i - 2] < 0]
        if len(odd) != 1:
            raise InputError("exact top: allowed are A, B, C of two signs, none zero")
        middle = odd[0]
        first, last = (middle + 1) % 3, (middle + 2) % 3
        # In these units the three products have the coefficients 1 and -1.
        scale = [abs(a[i - 1] * a[i - 2]).sqrt() for i in range(3)]
        x = [Decimal(w) * s for w, s in zip(omega, scale, strict=True)]
        if abs(x[first]) > abs(x[last]):
            first, last = last, first
        small = (x[first] * x[first] + x[middle] * x[middle]).sqrt()
        large = (x[last] * x[last] + x[middle] * x[middle]).sqrt().copy_sign(x[last])
        if small == 0:
            return [[Decimal(w) for w in omega] for _ in times]
        rest = (x[last] - x[first]) * (x[last] + x[first]) / (large * large)
        if rest == 0:
            raise InputError("exact top: the motion is on the separatrix")
        start = x[middle] / small, x[first] / small, x[last] / large
        rows = []
        for time in times:
            phase = (large * Decimal(time)).copy_sign(large * Decimal(time) * a[middle])
            sn, cn, dn = _sum(start, jacobi(phase, rest), 1 - rest)
            row = [Decimal(0)] * 3
            row[middle] = small * sn / scale[middle]
            row[first] = small * cn / scale[first]
            row[last] = large * dn / scale[last]
            rows.append(row)
    return rows


def jacobi(u: Decimal, rest: Decimal) -> tuple[Decimal, Decimal, Decimal]:
    """Return sn, cn, dn of `u` at the parameter 1 - rest, with 0 < rest <= 1."""
    moduli = []
    complement = rest.sqrt()
    square = 1 - rest
    while square > Decimal(1).scaleb(-2 * decimal.getcontext().prec):
        # k1 = (1 - k') / (1 + k'), without the difference of neighbours.
        modulus = square / ((1 + complement) * (1 + complement))
        moduli.append(modulus)
        u = u / (1 + modulus)
        square = modulus * modulus
        complement = ((1 - modulus) * (1 + modulus)).sqrt()
    sn, cn = sine_cosine(u)
    dn = Decimal(1)
    for modulus in reversed(moduli):
        share = modulus * sn * sn
        sn, cn, dn = (
            (1 + modulus) * sn / (1 + share),
            cn * dn / (1 + share),
            (1 - share) / (1 + share),
        )
    return sn, cn, dn


def _sum(
    p: tuple[Decimal, Decimal, Decimal], q: tuple[Decimal, Decimal, Decimal], m: Decimal
) -> tuple[Decimal, Decimal, Decimal]:
    """Return sn, cn, dn of the sum of two arguments from those of each."""
    below = 1 - m * (p[0] * q[0]) ** 2
    return (
        (p[0] * q[1] * q[2] + q[0] * p[1] * p[2]) / below,
        (p[1] * q[1] - p[0] * q[0] * p[2] * q[2]) / below,
        (p[2] * q[2] - m * p[0] * q[0] * p[1] * q[1]) / below,
    )


def axial_top(scene: Scene, times: Sequence[float]) -> list[Row]:
    """Return omega of a body with I1 = I2 whose torque acts along axis 3 alone.

    The spin is the integral of the torque; the other two turn by the integral of the spin.

    Raises
    ------
    InputError
        For any other scene.
    """
    law, moments = scene.torque, scene.moments
    vectors = [law.constant, law.rate, *(a for a, _ in law.sines + law.cosines)]
    if moments is None or moments[0] != moments[1] or any(v[0] or v[1] for v in vectors):
        raise InputError("axial top: allowed are I1 = I2 and torque along axis 3 alone")
    waves = law.sines + law.cosines
    with _arithmetic(times, scene.omega, [f for _, f in waves] + [1.0]):
        moment = Decimal(moments[2])
        ratio = (Decimal(moments[0]) - moment) / Decimal(moments[0])
        first, second, third = (Decimal(w) for w in scene.omega)
        rows = []
        for each in times:
            t = Decimal(each)
            spin = Decimal(law.constant[2]) * t + Decimal(law.rate[2]) * t * t / 2
            angle = Decimal(law.constant[2]) * t**2 / 2 + Decimal(law.rate[2]) * t**3 / 6
            for sign, (amplitude, frequency) in (
                *((1, wave) for wave in law.sines),
                *((0, wave) for wave in law.cosines),
            ):
                size, rate = Decimal(amplitude[2]), Decimal(frequency)
                if rate == 0:
                    spin += 0 if sign else size * t
                    angle += 0 if sign else size * t * t / 2
                    continue
                sine, cosine = sine_cosine(rate * t)
                if sign:
                    spin += size * (1 - cosine) / rate
                    angle += size * (t - sine / rate) / rate
                else:
                    spin += size * sine / rate
                    angle += size * (1 - cosine) / (rate * rate)
            sine, cosine = sine_cosine(ratio * (third * t + angle / moment))
            rows.append(
                [
                    first * cosine + second * sine,
                    second * cosine - first * sine,
                    third + spin / moment,
                ]
            )
    return rows


def _arithmetic(*sizes: Sequence[float]) -> "decimal._ContextManager":
    """Return a context with digits enough for angles of the product of these sizes."""
    context = decimal.Context(Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN)
    largest = [max(map(abs, each), default=1.0) for each in sizes]
    context.prec = DIGITS + sum(max(0, Decimal(x).adjusted() + 1) for x in largest)
    return decimal.localcontext(context)
