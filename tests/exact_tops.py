"""The torque-free top by mpmath; the initial phase is an elliptic integral of the first kind."""

from collections.abc import Sequence

import mpmath

DIGITS = 60


def exact_top(
    coefficients: Sequence[object], omega: Sequence[float], time: float
) -> list[mpmath.mpf]:
    """Return omega at `time` for non-zero coefficients of both signs, off the separatrix.

    The formulas are not the kernel's: the phase at 0 is computed and the time added to it, and the
    elliptic functions are mpmath's.
    """
    with mpmath.workdps(DIGITS):
        a = [mpmath.mpf(x) for x in coefficients]
        w = [mpmath.mpf(x) for x in omega]
        (odd,) = (i for i in range(3) if a[i] * a[i - 1] < 0 and a[i] * a[i - 2] < 0)
        first, last = (odd + 1) % 3, (odd + 2) % 3
        # x1' = -+ x2 x3 and so on; the sign for `odd` is opposite to the other two.
        scale = [mpmath.sqrt(abs(a[i - 1] * a[i - 2])) for i in range(3)]
        x = [w[i] * scale[i] for i in range(3)]
        if abs(x[first]) > abs(x[last]):
            first, last = last, first
        small = mpmath.hypot(x[first], x[odd])
        large = mpmath.sign(x[last]) * mpmath.hypot(x[last], x[odd])
        parameter = (small / large) ** 2
        phase = mpmath.ellipf(mpmath.atan2(x[odd], x[first]), parameter)
        phase += mpmath.sign(a[odd]) * large * mpmath.mpf(time)
        x[odd] = small * mpmath.ellipfun("sn", phase, m=parameter)
        x[first] = small * mpmath.ellipfun("cn", phase, m=parameter)
        x[last] = large * mpmath.ellipfun("dn", phase, m=parameter)
        return [x[i] / scale[i] for i in range(3)]


def exact_coefficients(moments: Sequence[float]) -> list[mpmath.mpf]:
    """Return A, B, C of equations 13-15 to all `DIGITS`."""
    with mpmath.workdps(DIGITS):
        i1, i2, i3 = (mpmath.mpf(x) for x in moments)
        return [(i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3]
