"""Coordinates of omega that a weak torque changes slowly, for the method `averaged`.

The body rotates about principal axis a; b and c are the next axes in cyclic order. Euler's
equations are w_b' = P w_c w_a + n_b, and so on, where n is the torque over the moment. The
coefficients P and Q of axes b and c have opposite signs. Let x = |Q|^(1/2) w_b, y = +-|P|^(1/2)
w_c, u = w_a^2, and let psi be the angle with psi' = |PQ|^(1/2) |w_a|. Without torque the motion is
exactly 2 pi-periodic in psi:

    dx/dpsi = -y,  dy/dpsi = x,  du/dpsi = 2 k x y,  with a constant k.

Therefore x + i y = (p1 + i p2) exp(i psi) and u = p3 + k y^2 with constant p1, p2 and p3, which a
torque changes slowly. These coordinates need no elliptic function, and are regular where the body
rotates exactly about axis a. They end at the separatrix, where w_a reaches 0.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.scene import Triple

# Function of time (s) and three omegas (rad/s) that returns the torque over the moments (1/s2).
Torque = Callable[[Array, list[Array]], list[Array] | Array]


class Coordinates(NamedTuple):
    """The constants of the coordinates about one axis. A point is (p1, p2, p3, t), with t in s."""

    axes: tuple[int, int, int]  # b, c, a
    on_b: float  # x over w_b
    on_c: float  # y over w_c, with its sign
    rate: float  # dpsi/dt over |w_a|
    bend: float  # k
    sign: float  # of w_a

    @classmethod
    def from_omega(cls, coefficients: Triple, omega: Triple) -> Self | None:
        """Return the coordinates for an omega (rad/s); None for a sphere, or on a separatrix."""
        found: list[tuple[float, Self]] = []
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            p, q = coefficients[b], coefficients[c]
            if not -math.inf < p * q < 0.0 or omega[a] == 0.0:
                continue
            rate = math.sqrt(-p * q)
            sign = math.copysign(1.0, omega[a])
            on_c = math.copysign(math.sqrt(abs(p)), q * sign)
            bend = math.copysign(coefficients[a], coefficients[a] * q) / (rate * rate)
            each = cls((b, c, a), math.sqrt(abs(q)), on_c, rate, bend, sign)
            with np.errstate(all="ignore"):
                point = each.point(omega)
                modulus = float(each.modulus(point))
            if modulus < 1.0 and math.isfinite(rate * bend) and np.isfinite(point).all():
                found.append((modulus, each))
        return min(found)[1] if found else None

    def point(self, omega: Triple) -> Array:
        """Return the point with this omega (rad/s) at psi = 0 and t = 0."""
        b, c, a = (omega[axis] for axis in self.axes)
        y = self.on_c * c
        return np.array([self.on_b * b, y, a * a - self.bend * y * y, 0.0])

    def modulus(self, point: Array) -> Array:
        """Return the squared modulus of the orbit: 0 about axis a, 1 on the separatrix, or inf."""
        one = point[2]
        other = one + self.bend * (point[0] * point[0] + point[1] * point[1])
        low, high = np.minimum(one, other), np.maximum(one, other)
        found: Array = np.where(low > 0.0, (high - low) / np.where(low > 0.0, high, 1.0), np.inf)
        return found

    def scale(self, point: Array) -> Array:
        """Return the magnitudes of a point's components, to which errors are relative."""
        size = math.sqrt(abs(point[2]) + point[0] * point[0] + point[1] * point[1])
        return np.array([size, size, size * size, 1.0 / (self.rate * size)])

    def largest(self, point: Array) -> float:
        """Return an upper bound of the components of omega (rad/s) on the orbits of points."""
        square = point[0] * point[0] + point[1] * point[1]
        on_axis = np.maximum(point[2], point[2] + self.bend * square).max()
        on_others = square.max() / min(abs(self.on_b), abs(self.on_c)) ** 2
        return math.sqrt(max(float(on_axis), float(on_others)))

    def by_omega(self, omega: Array, cosine: Array, sine: Array) -> Array:
        """Return the derivatives d(p1, p2, p3)/d(omega) at n fixed angles psi, shape (n, 3, 3)."""
        b, c, a = self.axes
        found = np.zeros((len(cosine), 3, 3))
        found[:, 0, b], found[:, 0, c] = cosine * self.on_b, sine * self.on_c
        found[:, 1, b], found[:, 1, c] = -sine * self.on_b, cosine * self.on_c
        found[:, 2, a] = 2.0 * omega[a]
        found[:, 2, c] = -2.0 * self.bend * self.on_c**2 * omega[c]
        return found

    def omega(self, point: Array, cosine: Array, sine: Array) -> tuple[list[Array], Array, Array]:
        """Return omega (rad/s), y and |w_a| at a point, for the cosine and the sine of psi."""
        y = point[0] * sine + point[1] * cosine
        fast = np.sqrt(point[2] + self.bend * y * y)
        b, c, a = self.axes
        found = [y, y, y]
        found[b] = (point[0] * cosine - point[1] * sine) / self.on_b
        found[c] = y / self.on_c
        found[a] = self.sign * fast
        return found, y, fast

    def slopes(
        self, point: Array, time: Array, cosine: Array, sine: Array, torque: Torque, mean: float
    ) -> Array:
        """Return d/dpsi of a point, with `mean` (s) subtracted from dt/dpsi."""
        omega, y, fast = self.omega(point, cosine, sine)
        pace = 1.0 / (self.rate * fast)
        torques = torque(time, omega)
        b, c, a = (torques[axis] for axis in self.axes)
        x_slope, y_slope = (self.on_b * b) * pace, (self.on_c * c) * pace
        found = np.empty((4, *pace.shape))
        found[0] = cosine * x_slope + sine * y_slope
        found[1] = cosine * y_slope - sine * x_slope
        found[2] = (2.0 * self.sign / self.rate) * a - (2.0 * self.bend) * y * y_slope
        found[3] = pace - mean
        return found
