"""Omega in torque-free motion by Jacobi's elliptic functions, in ball arithmetic.

Import this module only where python-flint is installed.
"""

from fractions import Fraction

from flint import acb, arb

from pyharness.truth.balls import ball

Balls = list[arb]


def omega_on_ellipse(axis: int, a: list[Fraction], w: list[Fraction], t: Fraction) -> Balls:
    """Return omega (rad/s) at `t` (s), initially `w`, if the coefficient of `axis` is 0.

    The component about `axis` is constant; the others move on an ellipse.
    """
    j, k = axis - 2, axis - 1
    angle = ball(-a[j] * a[k] * (w[axis] * t) ** 2).sqrt()
    cosine, sine = angle.cos(), angle.sinc() * ball(w[axis] * t)
    row = [ball(x) for x in w]
    row[j] = ball(w[j]) * cosine + ball(a[j] * w[k]) * sine
    row[k] = ball(w[k]) * cosine + ball(a[k] * w[j]) * sine
    return row


class Orbit:
    """A torque-free motion that is not steady, with nonzero coefficients.

    Omega about the three `axes` is `sizes` (rad/s) times cn(u), sn(u) and dn(u), where u = `start`
    + `rate` t, with `rate` in 1/s; see DLMF Table 22.13.1. `m` is k**2, and `square` the square of
    the size of dn. On the separatrix m = 1; cn and dn are then sech, and sn is tanh.
    """

    def __init__(self, a: list[Fraction], w: list[Fraction]) -> None:
        """Compute the constants for coefficients `a` and initial omega `w` (rad/s)."""
        s = [abs(x) for x in a]
        # The sign of the coefficient of the axis of sn differs from the two others.
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
        """Return omega (rad/s) at time `t` (s)."""
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
    """Return an integer near the middle of `x`; a reduction is exact with any integer."""
    mantissa, exponent = map(int, x.mid().man_exp())
    return round(mantissa * Fraction(2) ** exponent)


def carlson(x: Fraction, y: Fraction, z: Fraction) -> arb:
    """Return Carlson's R_F of nonnegative numbers, at most one of them 0."""
    return acb.elliptic_rf(ball(x), ball(y), ball(z)).real
