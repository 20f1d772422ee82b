"""Torque, and coordinates of omega that a weak torque changes slowly, for `averaged`.

The body rotates about principal axis a; axes b and c follow in cyclic order. Euler's equations are
w_b' = P w_c w_a + n_b, w_c' = Q w_a w_b + n_c and so on, where n is torque over moment (rad/s2),
and P Q < 0. Let x = |Q|^(1/2) w_b, y = +-|P|^(1/2) w_c, u = w_a^2 and psi' = |PQ|^(1/2) |w_a|.
Without torque, with a suitable sign of y, the exact period in psi is 2 pi:

    dx/dpsi = -y,  dy/dpsi = x,  du/dpsi = 2 k x y,  with a constant k.

Therefore x + i y = (p1 + i p2) exp(i psi) and u = p3 + k y^2 with constant p1, p2, p3. These
coordinates are regular at rotation about axis a, but undefined on the separatrix, where w_a reaches
0.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np

from pyharness.engine.system.kernel_input import normalized
from pyharness.engine.system.recorded import outputs_at
from pyharness.model.array_type import Array
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import N_INPUTS, TIME, Linear
from pyharness.model.torque_law import TorqueLaw

_MOST_DEGREE = 8.0

# A function of time (s) and omega (rad/s) that returns the torque over the moments (rad/s2).
Torque = Callable[[Array, list[Array]], list[Array] | Array]


class Coordinates(NamedTuple):
    """The constants in this module's equations between omega and a point (p1, p2, p3, t in s)."""

    axes: tuple[int, int, int]  # b, c, a
    on_b: float  # x divided by w_b
    on_c: float  # y divided by w_c, with the sign of y
    rate: float  # dpsi/dt divided by |w_a|
    bend: float  # k
    sign: float  # of w_a

    @classmethod
    def from_omega(cls, coefficients: Triple, omega: Triple) -> Self | None:
        """Return the coordinates for an omega (rad/s); None for a sphere or the separatrix."""
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
        """Return the point (p1, p2, p3, t) of an omega (rad/s) at psi = t = 0."""
        b, c, a = (omega[axis] for axis in self.axes)
        y = self.on_c * c
        return np.array([self.on_b * b, y, a * a - self.bend * y * y, 0.0])

    def modulus(self, point: Array) -> Array:
        """Return the squared elliptic modulus: 0 about axis a, 1 on the separatrix, inf beyond."""
        one = point[2]
        other = one + self.bend * (point[0] * point[0] + point[1] * point[1])
        low, high = np.minimum(one, other), np.maximum(one, other)
        found: Array = np.where(low > 0.0, (high - low) / np.where(low > 0.0, high, 1.0), np.inf)
        return found

    def scale(self, point: Array) -> Array:
        """Return the sizes to which errors of a point's components are relative."""
        size = math.sqrt(abs(point[2]) + point[0] * point[0] + point[1] * point[1])
        return np.array([size, size, size * size, 1.0 / (self.rate * size)])

    def largest(self, point: Array) -> float:
        """Return a bound on omega's components (rad/s) in torque-free motion through points."""
        square = point[0] * point[0] + point[1] * point[1]
        on_axis = np.maximum(point[2], point[2] + self.bend * square).max()
        on_others = square.max() / min(abs(self.on_b), abs(self.on_c)) ** 2
        return math.sqrt(max(float(on_axis), float(on_others)))

    def by_omega(self, omega: Array, cosine: Array, sine: Array) -> Array:
        """Return d(p1, p2, p3)/d(omega) at n fixed angles psi, (n, 3, 3)."""
        b, c, a = self.axes
        found = np.zeros((len(cosine), 3, 3))
        found[:, 0, b], found[:, 0, c] = cosine * self.on_b, sine * self.on_c
        found[:, 1, b], found[:, 1, c] = -sine * self.on_b, cosine * self.on_c
        found[:, 2, a] = 2.0 * omega[a]
        found[:, 2, c] = -2.0 * self.bend * self.on_c**2 * omega[c]
        return found

    def omega(self, point: Array, cosine: Array, sine: Array) -> tuple[list[Array], Array, Array]:
        """Return omega (rad/s), y and |w_a| at points, from the cosine and sine of psi."""
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
        """Return d/dpsi of points (p1, p2, p3, t), with `mean` (s/rad) subtracted from dt/dpsi."""
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


def torque_of(scene: Scene) -> tuple[Torque, bool]:
    """Return torque over moments (rad/s2) as a function, and whether it may depend on time."""
    given = scene.torque
    if isinstance(given, StateTorque):
        tape = given.tape
        if tape is None or given.needs_attitude:
            raise InputError(
                "averaged can't evaluate this torque; allowed: a torque that can be recorded and "
                "does not depend on the attitude"
            )
        moments = scene.moments or (1.0, 1.0, 1.0)

        def state_torque(time: Array, omega: list[Array]) -> list[Array]:
            shape = np.broadcast_shapes(time.shape, omega[0].shape)
            flat = [np.broadcast_to(each, shape).ravel() for each in (time, *omega)]
            found = outputs_at(tape, flat[0], np.array(flat[1:]).T) / moments
            return [each.reshape(shape) for each in found.T]

        return state_torque, True
    _, constant, rate, sines, cosines = normalized(scene)
    waves = [(np.sin, each) for each in sines.T] + [(np.cos, each) for each in cosines.T]
    if not (waves or rate.any()):
        return lambda time, omega: list(constant), False

    def torque(time: Array, omega: list[Array]) -> list[Array]:
        found = [c + r * time for c, r in zip(constant, rate, strict=True)]
        for function, (*amplitude, frequency) in waves:
            wave = function(frequency * time)
            found = [each + a * wave for each, a in zip(found, amplitude, strict=True)]
        return found

    return torque, True


class _Slot(NamedTuple):
    degree: float = 0.0  # of the polynomial factor; infinite if a factor is no sine or cosine
    fastest: float = 0.0  # highest frequency of the waves, rad/s
    rate: float | None = None  # 1/s, if linear in time alone


def fastest_of(torque: TorqueLaw | StateTorque) -> float:
    """Return the highest frequency (rad/s) of a torque's sines and cosines."""
    if isinstance(torque, TorqueLaw):
        return max((abs(f) for a, f in torque.sines + torque.cosines if any(a)), default=0.0)
    assert torque.tape is not None
    slots = [_Slot(1.0, rate=1.0) if slot == TIME else _Slot(1.0) for slot in range(N_INPUTS)]

    def combine(linear: Linear) -> _Slot:
        used = [(slots[slot], factor) for slot, factor in linear.terms]
        rates = [factor * each.rate for each, factor in used if each.rate is not None]
        return _Slot(
            max((each.degree for each, _ in used), default=0.0),
            max((each.fastest for each, _ in used), default=0.0),
            math.fsum(rates) if len(rates) == len(used) else None,
        )

    for kind, operands, linear, _ in torque.tape.operations:
        used = [slots[slot] for slot in operands]
        found = _Slot(math.inf)
        if linear is not None:
            found = combine(linear)
        elif kind == "product":
            found = _Slot(sum(each.degree for each in used), sum(each.fastest for each in used))
        elif kind in ("sine", "cosine") and used[0].rate is not None:
            found = _Slot(0.0, abs(used[0].rate))
        slots.append(found)
    outputs = [combine(output) for output in torque.tape.outputs]
    if max(each.degree for each in outputs) > _MOST_DEGREE:
        raise InputError(
            "averaged may miss changes of this torque; allowed: a recorded torque that is a "
            f"polynomial of degree {_MOST_DEGREE:.0f} at most in omega and time, times sines and "
            "cosines of low frequency, or another method"
        )
    return max(each.fastest for each in outputs)
