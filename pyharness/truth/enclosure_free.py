"""Proved enclosures of torque-free motion, in ball arithmetic (python-flint).

Omega is given by Jacobi's elliptic functions, the attitude by a theta function (Jacobi 1850;
Whittaker, Analytical Dynamics, section 69). Formulas are chosen by exact comparison of fractions,
not of balls.
"""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction

from flint import acb, arb, ctx

from pyharness.model.attitude import product
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.truth.balls import ball
from pyharness.truth.integer_series import exact_body

Balls = list[arb]

# The working precision is doubled up to this number of bits.
_MOST_BITS = 20_000


def enclose_free(
    scene: Scene, times: Sequence[float], digits: int, attitude: bool = False
) -> list[Balls]:
    """Return balls that contain omega (rad/s) in bounded torque-free motion at each of `times` (s).

    With `attitude`, unit quaternions follow; the scene must then have moments.
    """
    scale = max(Fraction(1), *(abs(Fraction(w)) for w in scene.omega))
    bits = min(64 + math.ceil(digits * math.log2(10)), _MOST_BITS)
    while True:
        with ctx.workprec(bits):
            least = arb(10) ** -digits
            # Quaternions are from body to space, scalar first and continuous in time.
            limits = [ball(scale) * least] * 3 + [least] * 4 * attitude
            solution = _solution(scene, attitude)
            rows = [solution(Fraction(time)) for time in times]
            if all(x.rad() <= y for row in rows for x, y in zip(row, limits, strict=True)):
                return rows
        if bits == _MOST_BITS:
            raise InputError(
                f"{digits} digits need more than {_MOST_BITS} bits; give fewer digits or times "
                "closer to 0"
            )
        bits = min(2 * bits, _MOST_BITS)


def _solution(scene: Scene, attitude: bool) -> Callable[[Fraction], Balls]:
    a, w = exact_body(scene)[1], [Fraction(x) for x in scene.omega]
    moments = scene.exact_moments if attitude else None
    begin = _unit([Fraction(x) for x in scene.attitude or ()]) if attitude else []
    if not any(a[k] * w[k - 1] * w[k - 2] for k in range(3)):
        return lambda t: [*map(ball, w), *_rotated(begin, [x * t / 2 for x in w])]
    if all(a):
        orbit = Orbit(a, w)
        return orbit.omega if moments is None else _Attitude(orbit, moments, w, begin).row
    axis = a.index(Fraction(0))

    def symmetric(t: Fraction) -> Balls:
        omega = omega_on_ellipse(axis, a, w, t)
        if moments is None:
            return omega
        # Rotations about the angular momentum and about the symmetry axis make up the motion.
        about = list(w)
        about[axis] *= moments[axis] / moments[axis - 1]
        turned = _rotated(begin, [x * t / 2 for x in about])
        return omega + _rotated(turned, [(x - y) * t / 2 for x, y in zip(w, about, strict=True)])

    return symmetric


def omega_on_ellipse(axis: int, a: list[Fraction], w: list[Fraction], t: Fraction) -> Balls:
    """Return omega (rad/s) at `t` (s), initially `w`, if the coefficient of `axis` is 0."""
    # The component about `axis` is constant; the others move on an ellipse.
    j, k = axis - 2, axis - 1
    angle = ball(-a[j] * a[k] * (w[axis] * t) ** 2).sqrt()
    cosine, sine = angle.cos(), angle.sinc() * ball(w[axis] * t)
    row = [ball(x) for x in w]
    row[j] = ball(w[j]) * cosine + ball(a[j] * w[k]) * sine
    row[k] = ball(w[k]) * cosine + ball(a[k] * w[j]) * sine
    return row


class Orbit:
    """An unsteady torque-free motion, initially with omega `w` (rad/s).

    The coefficients `a` of Euler's equations are not 0.
    """

    # Omega about the three `axes` is `sizes` (signed amplitudes, rad/s) times cn(u), sn(u) and
    # dn(u), with u = `start` + `rate` t and `rate` in 1/s (DLMF Table 22.13.1). `m` is k**2, with
    # the modulus k; `square` is the square of the amplitude of dn. On the separatrix m = 1, cn = dn
    # = sech and sn = tanh.

    def __init__(self, a: list[Fraction], w: list[Fraction]) -> None:
        s = [abs(x) for x in a]
        # The coefficient of the axis of sn differs in sign from the others.
        y = next(k for k in range(3) if a[k] * a[k - 1] < 0 and a[k] * a[k - 2] < 0)
        x, z = (y + 1) % 3, (y + 2) % 3
        if s[x] * w[z] ** 2 < s[z] * w[x] ** 2:
            x, z = z, x
        self.axes = x, y, z
        first = w[x] ** 2 + s[x] / s[y] * w[y] ** 2
        self.square = w[z] ** 2 + s[z] / s[y] * w[y] ** 2
        squares = first, first * s[y] / s[x], self.square
        self.m = s[z] * first / (s[x] * self.square)
        self.rate = ball(s[x] * s[y] * self.square).sqrt()
        signs = [-1 if w[k] < 0 else 1 for k in self.axes]
        self.sign = signs[2]
        # sn increases where cn and dn are positive, as they are at u = `start`.
        increasing = signs[0] * signs[2] * (1 if a[y] > 0 else -1)
        self.sizes = [
            sign * ball(square).sqrt()
            for sign, square in zip((signs[0], increasing, signs[2]), squares, strict=True)
        ]
        c2, s2, d2 = (w[k] ** 2 / square for k, square in zip(self.axes, squares, strict=True))
        # Carlson's integral of the first kind, from -K to K (DLMF 19.25.5).
        self.start = increasing * signs[1] * ball(s2).sqrt() * carlson(c2, d2, Fraction(1))
        if self.m != 1:
            mean, other = (arb(1).agm(ball(x).sqrt()) for x in (1 - self.m, self.m))
            # 2K, half the period of sn and cn, and tau = i K'/K (DLMF 19.8.5).
            self.period, self.tau = arb.pi() / mean, acb(0, mean / other)
            self.constants = [x.real for x in acb.modular_theta(acb(0), self.tau)]

    def omega(self, t: Fraction) -> Balls:
        row = [arb(0)] * 3
        values = self._functions(self.start + self.rate * ball(t))
        for axis, size, value in zip(self.axes, self.sizes, values, strict=True):
            row[axis] = size * value
        return row

    def _functions(self, u: arb) -> tuple[arb, arb, arb]:
        """Return cn, sn and dn of `u` (DLMF 22.2.4 to 22.2.6)."""
        if self.m == 1:
            return u.sech(), u.tanh(), u.sech()
        whole = integer_near(u / self.period)
        z = acb(u / self.period - whole)
        one, two, three, four = (x.real for x in acb.modular_theta(z, self.tau))
        _, b, c, d = self.constants
        sign = -1 if whole % 2 else 1
        return sign * d * two / (b * four), sign * c * one / (b * four), d * three / (c * four)


def integer_near(x: arb) -> int:
    """Return an integer near `x`; any is right, because it counts subtracted periods."""
    mantissa, exponent = map(int, x.mid().man_exp())
    return round(mantissa * Fraction(2) ** exponent)


def carlson(x: Fraction, y: Fraction, z: Fraction) -> arb:
    """Return Carlson's R_F of nonnegative numbers, at most one of them 0."""
    return acb.elliptic_rf(ball(x), ball(y), ball(z)).real


class _Attitude:
    """The attitude along an orbit."""

    # In the body, let n be the direction of the angular momentum L, and e the axis of dn. Then
    # n e = c dn(u) with c > 0. The attitude is the product of a constant rotation, the rotation by
    # psi about e, and the smallest rotation from n to e.
    #
    # Euler's equations give psi' = (2 T/|L| + omega e)/(1 + n e), with the kinetic energy T. Like
    # dn, psi' has the periods 2K and 4iK' in complex u. Its poles, where dn(u) = -1/c, are at u =
    # 2iK' + iy and 2iK' - iy; the residues of psi'/(2 rate) are 1/2i and -1/2i, or opposite. The
    # derivative of the phase of theta4((u - iy)/2K | 2 tau), or of its conjugate, has the same
    # periods, poles and residues. The two therefore differ by a constant.

    def __init__(
        self, orbit: Orbit, moments: Sequence[Fraction], w: list[Fraction], begin: Balls
    ) -> None:
        self.orbit = orbit
        energy = sum((i * x**2 for i, x in zip(moments, w, strict=True)), Fraction(0))
        square = sum(((i * x) ** 2 for i, x in zip(moments, w, strict=True)), Fraction(0))
        along = moments[orbit.axes[2]]
        c2 = along**2 * orbit.square / square
        momentum, c, s = (ball(x).sqrt() for x in (square, c2, 1 - c2))
        self.weights = [ball(i) / momentum for i in moments]
        w0, x0, y0, z0 = self._tilt([ball(x) for x in w])
        self.begin = product(begin, (w0, -x0, -y0, -z0))
        # psi/2 is `pace` t/2 plus the change of the phase of `_turn`.
        self.pace = ball(energy) / momentum
        if orbit.m == 1:
            # The integral of 1/(1 + c sech u) is u - 2 c/s arctan(s/(1 + c) tanh(u/2)).
            self.factor = (momentum / ball(along) - self.pace) * c / (s * orbit.rate)
            self.slope = s / (1 + c)
        else:
            # sn(y | 1 - m)**2 = (1 - c2)/(1 - (1 - m) c2), by DLMF 22.6.1 and Table 22.6.1.
            y = s * carlson(c2 * orbit.m, orbit.m, 1 - c2 * (1 - orbit.m)) / orbit.period
            self.shift = acb(0, -y if energy * along > square else y)
            # At u = 0, where dn = 1, the derivative of the phase determines the constant.
            theta = [acb.modular_theta(self.shift, 2 * orbit.tau, r)[3] for r in (0, 1)]
            highest = (self.pace + ball(orbit.square).sqrt()) / (1 + c)
            self.pace = highest - 2 * orbit.rate * (theta[1] / theta[0]).imag / orbit.period
        self.first = self._turn(orbit.start).conjugate()

    def row(self, t: Fraction) -> Balls:
        orbit, omega = self.orbit, self.orbit.omega(t)
        turn = _direction(self.pace * ball(t / 2)) * self.first
        turn *= self._turn(orbit.start + orbit.rate * ball(t))
        about = [turn.real, arb(0), arb(0), arb(0)]
        about[1 + orbit.axes[2]] = orbit.sign * turn.imag
        return [*omega, *product(product(self.begin, about), self._tilt(omega))]

    def _turn(self, u: arb) -> acb:
        """Return exp(i psi/2) without the part of psi that is linear in time."""
        if self.orbit.m == 1:
            return _direction(self.factor * (self.slope * (u / 2).tanh()).atan())
        z = u / self.orbit.period
        value = acb.modular_theta(z - integer_near(z) + self.shift, 2 * self.orbit.tau)[3]
        return value / abs(value)

    def _tilt(self, omega: Balls) -> Balls:
        """Return the quaternion of the smallest rotation from n to e, below a right angle."""
        n = [x * y for x, y in zip(self.weights, omega, strict=True)]
        axis, sign = self.orbit.axes[2], self.orbit.sign
        row = [1 + sign * n[axis], arb(0), arb(0), arb(0)]
        row[1 + (axis + 1) % 3] = sign * n[axis - 1]
        row[1 + (axis + 2) % 3] = -sign * n[axis - 2]
        length = (2 * row[0]).sqrt()
        return [x / length for x in row]


def _rotated(q: Balls, half: list[Fraction]) -> Balls:
    """Return `q` times the rotation by the vector 2 `half` (rad), or [] if `q` is empty."""
    angle = ball(sum((x**2 for x in half), Fraction(0))).sqrt()
    vector = [ball(x) * angle.sinc() for x in half]
    return list(product(q, [angle.cos(), *vector])) if q else []


def _unit(q: list[Fraction]) -> Balls:
    length = ball(sum((x**2 for x in q), Fraction(0))).sqrt()
    return [ball(x) / length for x in q]


def _direction(angle: arb) -> acb:
    return acb(angle.cos(), angle.sin())
