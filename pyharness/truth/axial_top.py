"""Exact solution for a symmetric body with a torque along its axis, in decimals.

The spin (omega about this axis) is its initial value plus the integral of torque over moment. The
other components rotate by an angle proportional to the integral of the spin.
"""

import decimal
from collections.abc import Sequence
from decimal import Decimal

from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.truth.decimal_functions import Row, sine_cosine

DIGITS = 50


def axial_top(scene: Scene, times: Sequence[float]) -> list[Row]:
    """Return omega (rad/s) at `times` (s) of a body with I1 = I2 and its torque along axis 3."""
    law, moments = scene.body_torque, scene.moments
    vectors = [law.constant, law.rate, *(a for a, _ in law.sines + law.cosines)]
    if moments is None or moments[0] != moments[1] or any(v[0] or v[1] for v in vectors):
        raise InputError(
            "axial top: the scene has another body or torque; allowed: I1 = I2, and a torque "
            "about axis 3 only"
        )
    waves = law.sines + law.cosines
    # More digits for products of the largest time, omega and frequency.
    sizes = (*map(abs, times), 0.0), map(abs, scene.omega), (*(abs(f) for _, f in waves), 1.0)
    digits = DIGITS + sum(max(0, Decimal(max(each)).adjusted() + 1) for each in sizes)
    with decimal.localcontext(prec=digits, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN):
        moment = Decimal(moments[2])
        ratio = (Decimal(moments[0]) - moment) / Decimal(moments[0])
        first, second, third = (Decimal(w) for w in scene.omega)
        rows = []
        for each in times:
            t = Decimal(each)
            spin = Decimal(law.constant[2]) * t + Decimal(law.rate[2]) * t * t / 2
            angle = Decimal(law.constant[2]) * t**2 / 2 + Decimal(law.rate[2]) * t**3 / 6
            for amplitude, frequency in law.sines:
                if frequency:
                    size, rate = Decimal(amplitude[2]), Decimal(frequency)
                    sine, cosine = sine_cosine(rate * t)
                    spin += size * (1 - cosine) / rate
                    angle += size * (t - sine / rate) / rate
            for amplitude, frequency in law.cosines:
                size, rate = Decimal(amplitude[2]), Decimal(frequency)
                sine, cosine = sine_cosine(rate * t)
                spin += size * (sine / rate if rate else t)
                angle += size * ((1 - cosine) / (rate * rate) if rate else t * t / 2)
            sine, cosine = sine_cosine(ratio * (third * t + angle / moment))
            turned = [first * cosine + second * sine, second * cosine - first * sine]
            rows.append([*turned, third + spin / moment])
    return rows
