"""Attitude of a torque-free body to some 45 digits by two Taylor series in integer arithmetic.

`joint` integrates omega and the quaternion by q' = q (0, omega)/2 and uses no other theory. `exact`
integrates omega and the angle psi of the rotation about the angular momentum (psi' is elementary)
over half a period at most. It adds whole periods at once, so that 1e6 s take no longer than one
revolution. Neither uses an elliptic or a theta function, except for the length of the period, which
the integration checks.
"""

from collections.abc import Callable, Sequence
from fractions import Fraction
from operator import mul

import mpmath

_BITS = 200
_ORDER = 44
_LAST = _BITS - 30  # bits that the last terms may not reach
MOST_STEPS = 3000
DIGITS = 60

Series = list[list[int]]
Quaternion = list[mpmath.mpf]


def times(p: Sequence[mpmath.mpf], q: Sequence[mpmath.mpf]) -> Quaternion:
    """Return the product of two quaternions, scalar first (Hamilton)."""
    return [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
    ]


def joint(
    moments: Sequence[float], omega: Sequence[float], attitude: Sequence[float], time: float
) -> tuple[list[mpmath.mpf], Quaternion]:
    """Return omega and attitude at `time` (s) by integrating both; for short times."""
    factors = _factors(moments)

    def grow(series: Series, h: int) -> None:
        q, (x, y, z) = series[3:], (w[::-1] for w in series[:3])
        k = len(x)
        _grow_omega(series, factors, h)
        half = h * (1 << 8) // (2 * k)

        def conv(i: int, w: list[int]) -> int:
            return sum(map(mul, q[i], w))

        # Compute all terms from the older ones before appending any.
        found = (
            -conv(1, x) - conv(2, y) - conv(3, z),
            conv(0, x) + conv(2, z) - conv(3, y),
            conv(0, y) + conv(3, x) - conv(1, z),
            conv(0, z) + conv(1, y) - conv(2, x),
        )
        for each, total in zip(q, found, strict=True):
            each.append((half * total) >> (2 * _BITS + 8))

    state = _march(_fixed([*omega, *attitude]), grow, _whole(time))
    with mpmath.workdps(DIGITS):
        found = [_real(x) for x in state]
        size = mpmath.sqrt(sum(mpmath.mpf(x) ** 2 for x in attitude))
        return found[:3], [x / size for x in found[3:]]


def exact(
    moments: Sequence[float], omega: Sequence[float], attitude: Sequence[float], time: float
) -> tuple[list[mpmath.mpf], Quaternion]:
    """Return omega and attitude at any `time` (s)."""
    with mpmath.workdps(DIGITS):
        i = [mpmath.mpf(x) for x in moments]
        w = [mpmath.mpf(x) for x in omega]
        t = mpmath.mpf(time)
        size = mpmath.sqrt(sum(mpmath.mpf(x) ** 2 for x in attitude))
        q0 = [mpmath.mpf(x) / size for x in attitude]
        steady = _steady(moments, omega)
        if steady:
            speed = mpmath.sqrt(sum(x * x for x in w))
            half = speed * t / 2
            along = [x / speed for x in w] if speed else w
            turn = [mpmath.cos(half), *(x * mpmath.sin(half) for x in along)]
            return w, times(q0, turn)
        first, second, third, half_period = _orbit(moments, omega)
        sign = mpmath.sign(w[third])
        hand = 1 if (first + 1) % 3 == second else -1
        momentum = mpmath.sqrt(sum((a * b) ** 2 for a, b in zip(i, w, strict=True)))
        energy = sum(a * b * b for a, b in zip(i, w, strict=True))
        # psi' = constant + numerator/(1 + share omega3), where share omega3 is positive.
        constant = momentum / i[third]
        numerator = (energy - momentum**2 / i[third]) / momentum
        share = sign * i[third] / momentum
        psi_factors = [_whole(constant), _whole(numerator), _whole(share)]
        factors = _factors(moments)

        def grow(series: Series, h: int) -> None:
            # omega, psi, and 1/(1 + share omega3).
            z, psi, inverse = series[third], series[3], series[4]
            k = len(z)
            extra = psi_factors[0] if k == 1 else 0
            slope = (psi_factors[1] * inverse[-1] >> _BITS) + extra
            psi.append((h * slope // k) >> _BITS)
            _grow_omega(series, factors, h)
            total = sum(map(mul, z[1:], inverse[::-1])) >> _BITS
            inverse.append(
                -((psi_factors[2] * total >> _BITS) << _BITS) // one_and(psi_factors[2], z[0])
            )

        def one_and(factor: int, z: int) -> int:
            return (1 << _BITS) + (factor * z >> _BITS)

        def run(start: list[int], span: int) -> list[int]:
            inverse = (1 << 2 * _BITS) // one_and(psi_factors[2], start[third])
            return _march([*start[:4], inverse], grow, span, renew=lambda s: [
                *s[:4], (1 << 2 * _BITS) // one_and(psi_factors[2], s[third])
            ])  # fmt: skip

        start = [*_fixed(omega), 0]
        if half_period is None or abs(t) < half_period:
            whole = 0
            state = run(start, _whole(time))
            psi = _real(state[3])
        else:
            whole = int(mpmath.floor(t / half_period))
            state = run(start, _whole(t - whole * half_period))
            rest = _whole(half_period) - _whole(t - whole * half_period)
            end = run(state, rest)
            psi = _real(state[3]) + whole * _real(end[3])
            for axis in range(3):
                closing = _real(end[axis]) * (1 if axis == third else -1)
                assert abs(closing - w[axis]) < mpmath.mpf(10) ** -40 * max(map(abs, w))
        found = [_real(x) for x in state[:3]]
        if whole % 2:
            found = [x if axis == third else -x for axis, x in enumerate(found)]

        def to_axis(w: list[mpmath.mpf]) -> Quaternion:
            # The shortest rotation from the momentum to the third axis.
            m = [a * b / momentum for a, b in zip(i, w, strict=True)]
            p = [mpmath.mpf(0)] * 4
            p[0] = 1 + sign * m[third]
            p[1 + first], p[1 + second] = hand * sign * m[second], -hand * sign * m[first]
            length = mpmath.sqrt(sum(x * x for x in p))
            return [x / length for x in p]

        before, after = to_axis(w), to_axis(found)
        turn = [mpmath.cos(psi / 2), mpmath.mpf(0), mpmath.mpf(0), mpmath.mpf(0)]
        turn[1 + third] = sign * mpmath.sin(psi / 2)
        back = [before[0], -before[1], -before[2], -before[3]]
        return found, times(times(q0, back), times(turn, after))


def _steady(moments: Sequence[float], omega: Sequence[float]) -> bool:
    i, w = [Fraction(x) for x in moments], [Fraction(x) for x in omega]
    return all((i[a - 1] - i[a - 2]) * w[a - 1] * w[a - 2] == 0 for a in range(3))


def _orbit(
    moments: Sequence[float], omega: Sequence[float]
) -> tuple[int, int, int, mpmath.mpf | None]:
    """Return the axes of the orbit, and half a period of omega or None on the separatrix."""
    i, w = [Fraction(x) for x in moments], [Fraction(x) for x in omega]
    low, second, high = sorted(range(3), key=lambda axis: i[axis])
    gap = i[low] * w[low] ** 2 * (i[second] - i[low])
    gap -= i[high] * w[high] ** 2 * (i[high] - i[second])
    first, third = (high, low) if gap >= 0 else (low, high)
    if not gap:
        return first, second, third, None
    d12, d13, d23 = (
        abs(i[a] - i[b]) for a, b in ((first, second), (first, third), (second, third))
    )
    e3 = d13 * i[third] * w[third] ** 2 + d12 * i[second] * w[second] ** 2
    frequency = mpmath.sqrt(_exact(d23 * e3 / (i[0] * i[1] * i[2])))
    comodulus = mpmath.sqrt(_exact(d13 * abs(gap) / (d23 * e3)))
    return first, second, third, mpmath.pi / mpmath.agm(1, comodulus) / frequency


def _exact(x: Fraction) -> mpmath.mpf:
    return mpmath.mpf(x.numerator) / x.denominator


def _factors(moments: Sequence[float]) -> list[int]:
    i1, i2, i3 = (Fraction(x) for x in moments)
    return [int(x * 2**_BITS) for x in ((i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3)]


def _fixed(values: Sequence[float]) -> list[int]:
    return [int(Fraction(x) * 2**_BITS) for x in values]


def _whole(x: object) -> int:
    return int(mpmath.floor(mpmath.ldexp(mpmath.mpf(x), _BITS)))


def _real(x: int) -> mpmath.mpf:
    return mpmath.ldexp(mpmath.mpf(x), -_BITS)


def _grow_omega(series: Series, factors: list[int], h: int) -> None:
    x, y, z = series[:3]
    k = len(x)
    zs = z[::-1]
    found = sum(map(mul, y, zs)), sum(map(mul, x, zs)), sum(map(mul, x, y[::-1]))
    for each, factor, total in zip((x, y, z), factors, found, strict=True):
        each.append(((factor * h >> _BITS) * total >> 2 * _BITS) // k)


def _march(
    state: list[int],
    grow: Callable[[Series, int], None],
    span: int,
    renew: Callable[[list[int]], list[int]] = lambda state: state,
) -> list[int]:
    """Integrate the state over `span`; the terms include the powers of the step."""
    sign, rest = (1 if span >= 0 else -1), abs(span)
    h = 1 << (_BITS - 2)
    for _ in range(MOST_STEPS):
        if not rest:
            return state
        h = min(h, rest)
        series = [[x] for x in state]
        for _ in range(_ORDER):
            grow(series, sign * h)
        size = max(abs(each[k]) for each in series for k in (-1, -2))
        factor = 2.0 ** ((_BITS - _LAST - max(1, size.bit_length())) / _ORDER)
        if factor < 0.999:
            h = int(h * factor * 0.98)
            continue
        state = renew([sum(each) for each in series])
        rest -= h
        h = int(h * min(4.0, factor * 0.95))
    raise ValueError("too many steps")
