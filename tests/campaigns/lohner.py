"""`python -m tests.campaigns.lohner --case 3 --times 1 3`: enclose omega by Lohner's method.

The balls are rigorous: they contain the true solution of Euler's equations, because every rounding
is outward and every truncation error is enclosed. Each step has three parts. The operator of Picard
and Lindelöf verifies an a priori box, which contains the solution during the whole step. The
Lagrange remainder of a Taylor series is evaluated over this box. The mean value form propagates the
set of solutions, a parallelepiped, whose new axes are from a QR factorisation.

Literature: R. J. Lohner, Enclosing the solutions of ordinary initial and boundary value problems,
1987. N. S. Nedialkov, K. R. Jackson and G. F. Corliss, Validated solutions of initial value
problems for ordinary differential equations, Applied Mathematics and Computation 105 (1999).
"""

import argparse
import contextlib
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import mul
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx

from pyharness import Scene, case_scene
from pyharness.truth.balls import ball
from tests.intervals import decimals

Times = tuple[Fraction, Fraction]  # the first and the last time of a range (s)
Vector = list[Any]  # of balls
Matrix = list[Vector]

GUARD_BITS = 64  # bits beyond the requested digits
TRIALS = 8  # candidates for the a priori box before the step size is reduced
ORDER_PER_DIGIT = 1.2  # order of the series for each digit; from 1.1 to 1.8, times differ little
SMALLEST = 2.0**-30  # smallest step size that is tried, as a ratio to the longest time


class NotEnclosedError(ArithmeticError):
    """The error if no box was verified, or if steps became too small."""


def dot(first: Sequence[Any], second: Sequence[Any]) -> Any:
    return sum(map(mul, first, second), arb(0))


def identity() -> Matrix:
    return [[arb(i == j) for j in range(3)] for i in range(3)]


class Euler:
    """Euler's equations of a scene, x_i' = a_i x_{i+1} x_{i+2} + m_i(t), with indices modulo 3.

    x is omega (rad/s), a_i are the exact coefficients A, B, C, and m_i(t) is the torque over the
    moment of inertia (1/s2). All Taylor coefficients are scaled: the coefficient of order k is
    multiplied by h**k, where h is the step size (s).
    """

    def __init__(self, scene: Scene, order: int) -> None:
        """Enclose the numbers of a scene whose torque is a law of time about the body axes."""
        law, moments = scene.body_torque, scene.exact_moments
        if moments is None:
            exact = [Fraction(x) for x in scene.euler_coefficients]
        else:
            exact = [(moments[i - 2] - moments[i - 1]) / moments[i] for i in range(3)]
        divisors = moments or (1, 1, 1)
        self.order, self.a = order, [ball(x) for x in exact]

        def over_moments(torque: Sequence[float]) -> Vector:
            return [ball(Fraction(torque[i]) / divisors[i]) for i in range(3)]

        self.constant, self.rate = over_moments(law.constant), over_moments(law.rate)
        # The k-th derivative of sine is element k modulo 4 of the list sine, cosine, -sine,
        # -cosine. For the derivatives of cosine the list begins with its element 1.
        self.waves = [
            (over_moments(amplitude), ball(Fraction(frequency)), first)
            for first, waves in enumerate((law.sines, law.cosines))
            for amplitude, frequency in waves
        ]

    def torque(self, times: Times, h: Any, count: int) -> Matrix:
        """Return for each axis `count` Taylor coefficients of m, valid at all times of a range."""
        when = ball(times[0]).union(ball(times[1]))
        series = [[arb(0)] * count for _ in range(3)]
        for i in range(3):
            series[i][:2] = [self.constant[i] + self.rate[i] * when, self.rate[i] * h][:count]
        for amplitude, frequency, first in self.waves:
            sine, cosine = (frequency * when).sin_cos()
            derivatives, factor = [sine, cosine, -sine, -cosine], arb(1)
            for k in range(count):  # factor: (frequency h)**k / k!
                for i in range(3):
                    series[i][k] += amplitude[i] * derivatives[(first + k) % 4] * factor
                factor *= frequency * h / (k + 1)
        return series

    def taylor(self, start: Vector, torque: Matrix, h: Any) -> Matrix:
        """Return for each axis one Taylor coefficient of x more than `torque` has of m."""
        x = [[each] for each in start]
        for k in range(len(torque[0])):
            products = [self.a[i] * dot(x[i - 2], x[i - 1][::-1]) for i in range(3)]
            for i in range(3):
                x[i].append(h * (products[i] + torque[i][k]) / (k + 1))
        return x

    def jacobian(self, x: Matrix, h: Any) -> Matrix:
        """Return the Jacobian matrix of the Taylor polynomial, as a function of its start value.

        `x` has the coefficients of the polynomial. The columns v of the matrix are sums of Taylor
        coefficients, too, with v_i' = a_i (x_{i+1} v_{i+2} + x_{i+2} v_{i+1}).
        """
        columns = []
        for column in identity():
            v = [[each] for each in column]
            for k in range(1, len(x[0])):
                rates = [
                    dot(x[i - 2][:k], v[i - 1][::-1]) + dot(x[i - 1][:k], v[i - 2][::-1])
                    for i in range(3)
                ]
                for i in range(3):
                    v[i].append(h * self.a[i] * rates[i] / k)
            columns.append([sum(each) for each in v])
        return [list(row) for row in zip(*columns, strict=True)]

    def picard_image(self, start: Vector, times: Times, h: Any, box: Vector) -> Vector:
        """Return start + [0, h] f(times, box), where f is the right-hand side."""
        torque, during = self.torque(times, h, 1), h.union(arb(0))
        return [
            start[i] + during * (self.a[i] * box[i - 2] * box[i - 1] + torque[i][0])
            for i in range(3)
        ]

    def verified_box(self, start: Vector, times: Times, h: Any, box: Vector) -> Vector:
        """Return the Picard image of the box, if it is a subset; else raise NotEnclosedError.

        By Schauder's fixed-point theorem, a solution from each point of `start` then exists during
        the step and remains in the box, hence in the image. The solution is unique, because f is
        locally Lipschitz continuous.
        """
        image = self.picard_image(start, times, h, box)
        if not all(old.contains(new) for old, new in zip(box, image, strict=True)):
            raise NotEnclosedError("the a priori box does not contain its Picard image")
        return image

    def a_priori_box(self, start: Vector, times: Times, h: Any) -> Vector:
        """Return a verified a priori box; raise NotEnclosedError if no candidate is verified."""
        box = start
        for _ in range(TRIALS):
            with contextlib.suppress(NotEnclosedError):
                return self.verified_box(start, times, h, box)
            box = [wider(x) for x in self.picard_image(start, times, h, box)]
        raise NotEnclosedError(f"no a priori box was verified in {TRIALS} trials")

    def remainder(self, start: Vector, times: Times, h: Any) -> Vector:
        """Return the Lagrange remainder of the Taylor polynomial, from an a priori box."""
        box = self.a_priori_box(start, times, h)
        return [x[-1] for x in self.taylor(box, self.torque(times, h, self.order), h)]


def wider(x: Any) -> Any:
    """Return a ball that is wider by an eighth on each side."""
    return arb(x.mid(), 1.25 * float(x.rad()) + 2.0 ** -(ctx.prec - 2))


@dataclass
class Parallelepiped:
    """The set of all centre + axes r, with r in the box `spread`; centre and axes are exact.

    `spread` contains 0. The hull thus contains the centre, as the mean value form requires.
    """

    centre: Vector
    axes: Matrix
    spread: Vector

    def hull(self) -> Vector:
        """Return a box that contains the set."""
        return [x + dot(row, self.spread) for x, row in zip(self.centre, self.axes, strict=True)]

    def advance(self, euler: Euler, begin: Fraction, h: Any, remainder: Vector) -> "Parallelepiped":
        """Return a set that contains all solutions one step later, by the mean value form."""
        torque = euler.torque((begin, begin), h, euler.order - 1)
        jacobian = euler.jacobian(euler.taylor(self.hull(), torque, h), h)
        polynomial = euler.taylor(self.centre, torque, h)
        point = [sum(x) + rest for x, rest in zip(polynomial, remainder, strict=True)]
        centre = [x.mid() for x in point]
        errors = arb_mat([[x - middle] for x, middle in zip(point, centre, strict=True)])
        images = arb_mat(jacobian) * arb_mat(self.axes)
        axes = arb_mat(orthogonal(images.tolist(), self.spread))
        back = axes.inv()
        spread = (back * images) * arb_mat([[x] for x in self.spread]) + back * errors
        return Parallelepiped(centre, axes.tolist(), [x for (x,) in spread.tolist()])


def orthogonal(images: Matrix, spread: Vector) -> list[list[float]]:
    """Return exact numbers near an orthogonal matrix, the axes of the next set.

    The first axis is along the longest edge of the image of the set, as Lohner recommends. Rounding
    errors are irrelevant here, because the inverse is enclosed.
    """
    middle = np.array([[float(x.mid()) for x in row] for row in images])
    lengths = np.linalg.norm(middle, axis=0) * [float(x.rad()) for x in spread]
    found: list[list[float]] = np.linalg.qr(middle[:, np.argsort(-lengths)])[0].tolist()
    return found


def enclosure(scene: Scene, times: Sequence[float], digits: int) -> list[Vector]:
    """Return balls of the three components of omega (rad/s) at times (s).

    All times have the same sign, and their distance from 0 never decreases. The sum of the
    remainders of all steps then has a radius of at most 10**-digits (rad/s). The motion amplifies
    the remainders. Raise InputError unless the torque of the scene is a `TorqueLaw` about the body
    axes and its inertia is constant, and NotEnclosedError if a step cannot be verified.
    """
    with ctx.workprec(math.ceil(digits * math.log2(10)) + GUARD_BITS):
        euler = Euler(scene, max(8, round(ORDER_PER_DIGIT * digits)))
        omega = [ball(Fraction(x)) for x in scene.omega]
        state = Parallelepiped([x.mid() for x in omega], identity(), [x - x.mid() for x in omega])
        now, longest = Fraction(0), max(abs(Fraction(x)) for x in times)
        size, rows = longest, []
        for target in map(Fraction, times):
            while now != target:
                if size < longest * SMALLEST:
                    raise NotEnclosedError(f"the steps became too small at {float(now):.3f} s")
                h = max(-size, min(size, target - now))
                allowed = float(2 * abs(h) / longest) * 10.0**-digits
                try:
                    remainder = euler.remainder(state.hull(), (now, now + h), ball(h))
                    ratio = max(2.0 * float(x.rad()) for x in remainder) / allowed
                except NotEnclosedError:
                    ratio = math.inf
                factor = 0.9 * max(ratio, 1e-300) ** (-1 / euler.order)
                proposed = Fraction(float(abs(h)) * min(2.0, max(0.5, factor)))
                if ratio <= 1.0:
                    state, now = state.advance(euler, now, ball(h), remainder), now + h
                    size = proposed if abs(h) == size else max(size, proposed)
                else:
                    size = proposed
            rows.append(state.hull())
        return rows


def main(arguments: Sequence[str]) -> int:
    """Print the enclosures of a case at some times; return exit status 0."""
    parser = argparse.ArgumentParser(description="Enclose omega.")
    parser.add_argument("--case", type=int, default=3, help="solve this case of Table 1 (1 to 7)")
    parser.add_argument("--times", type=float, nargs="+", default=[1.0], help="use these times (s)")
    parser.add_argument("--digits", type=int, default=30, help="bound remainders by 10**-DIGITS")
    options = parser.parse_args(arguments)
    start = time.perf_counter()
    rows = enclosure(case_scene(options.case), options.times, options.digits)
    print(f"Case {options.case}, {time.perf_counter() - start:.1f} s of computing time")
    for when, row in zip(options.times, rows, strict=True):
        print(f"t = {when:g} s")
        for axis, omega in enumerate(row, 1):
            low, high = decimals(omega, options.digits + 2)
            print(f"  omega{axis} in [{low}, {high}] rad/s, radius {float(omega.rad()):.1e}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
