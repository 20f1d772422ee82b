"""Independent implementations of the schemes of programs and fixed-step methods.

A scheme computes one step from `omega` under constant torque (equations 16-18 of the thesis). Its
argument `on` is a `Numbers` or, for the terms of the truncation error, a `Series` in the step size.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from pyharness.checks.theory.collocation_matrices import PARTS, collocation_matrix, inverse
from pyharness.model.fixed_steps import FIXED_STEPS
from pyharness.model.fixed_steps import FixedStep as Declared
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

# Number of powers of the step size, from 0.
TERMS = 24


class Numbers:
    """Euler's equations for numbers; omega (rad/s) has the shape (..., 3)."""

    def __init__(self, scene: Scene, step: float = 1.0, sizes: bool = False) -> None:
        """Store step size (s), coefficients and torque, the last two as magnitudes if `sizes`."""
        self._step = step
        size = np.abs if sizes else np.positive
        self._coefficients = size(np.array(scene.euler_coefficients))
        self._torque = size(np.array(scene.normalized_torque(0.0)))

    def rate(self, omega: Array) -> Array:
        """Return the right-hand sides (rad/s2) at `omega`."""
        turned, onward = np.roll(omega, -1, axis=-1), np.roll(omega, -2, axis=-1)
        return np.asarray(self._torque + self._coefficients * turned * onward)

    def times_step(self, x: Array) -> Array:
        return self._step * x


class Series(Numbers):
    """Euler's equations for power series in the step size.

    Omega has the shape (TERMS, ..., 3), powers first.
    """

    def rate(self, omega: Array) -> Array:
        """Return the power series of the right-hand sides, by Cauchy products."""
        turned, onward = np.roll(omega, -1, axis=-1), np.roll(omega, -2, axis=-1)
        result = np.zeros(omega.shape)
        for k in range(TERMS):
            result[k] = (turned[: k + 1] * onward[k::-1]).sum(axis=0)
        result *= self._coefficients
        result[0] += self._torque
        return result

    def times_step(self, x: Array) -> Array:
        """Return the series times the step size, truncated."""
        return np.concatenate([np.zeros_like(x[:1]), x[:-1]])

    def solution(self, omega: Array) -> Array:
        """Return the exact solution after a step from `omega` (rad/s), as a power series."""
        result = constant(omega)
        for k in range(TERMS - 1):
            result[k + 1] = self.rate(result)[k] / (k + 1)
        return result


Scheme = Callable[[Numbers, Array], Array]


@dataclass(frozen=True)
class FixedStep:
    name: str
    order: int  # order of the global error
    scheme: Scheme  # ``scheme(arithmetic, omega)`` returns omega after a step
    # Bound on the rounding error of a step's last additions, in units of 2**-53 times omega.
    roundings: float = 1.0


def constant(omega: Array) -> Array:
    """Return a constant omega, shape (..., 3), as a power series, shape (TERMS, ..., 3)."""
    result = np.zeros((TERMS, *omega.shape))
    result[0] = omega
    return result


def collocation(program: str) -> Scheme:
    """Return the scheme of a collocation program: an estimate and one correction."""
    parts = PARTS[program]
    weights = inverse(collocation_matrix(parts)).sum(axis=0).astype(float)

    def scheme(on: Numbers, omega: Array) -> Array:
        slope = on.times_step(on.rate(omega))
        result = omega
        for part, weight in zip(parts, weights, strict=True):
            result = result + weight * on.times_step(on.rate(omega + float(part) * slope))
        return result

    return scheme


def collocation_singular(program: str) -> Scheme:
    """Return a collocation program's scheme if LEQT1F reports a singular matrix.

    LEQT1F then returns the right-hand sides as solutions.
    """
    parts = PARTS[program]

    def scheme(on: Numbers, omega: Array) -> Array:
        rates = []
        constant_rate = on.rate(omega)
        for part in parts:
            estimate, power = omega, constant_rate
            for _ in parts:
                power = float(part) * on.times_step(power)
                estimate = estimate + power
            rates.append(on.rate(estimate))
        result = omega
        for k, rate in enumerate(rates, 1):
            for _ in range(k):
                rate = on.times_step(rate)
            result = result + rate
        return result

    return scheme


def runge_kutta_4(on: Numbers, omega: Array, punched: bool = False) -> Array:
    """Return omega after a classical Runge-Kutta step (eq. 31).

    If `punched`, it is the first step of the original program.
    """
    first = on.times_step(on.rate(omega))
    at = omega + 0.5 * first
    second = on.times_step(on.rate(at))
    at = (at if punched else omega) + 0.5 * second
    third = on.times_step(on.rate(at))
    fourth = on.times_step(on.rate((at if punched else omega) + third))
    return np.asarray(omega + (first + 2.0 * (second + third) + fourth) / 6.0)


runge_kutta_punched = partial(runge_kutta_4, punched=True)


def _advance(omega: Array, weights: Iterable[Any], changes: Sequence[Array]) -> Array:
    terms = (float(a) * change for a, change in zip(weights, changes, strict=True) if a)
    return np.asarray(omega + sum(terms))


def tableau(method: Declared) -> Scheme:
    """Return the scheme of a method that has a Runge-Kutta matrix."""

    def scheme(on: Numbers, omega: Array) -> Array:
        changes: list[Array] = []
        for row in method.matrix:
            changes.append(on.times_step(on.rate(_advance(omega, row, changes))))
        return _advance(omega, method.weights, changes)

    return scheme


def taylor_3(on: Numbers, omega: Array) -> Array:
    """Return omega after a Taylor step with three terms (eq. 30)."""
    rate = on.rate(omega)
    # Derivative of the quadratic right-hand side along itself, exact except for rounding.
    along = 0.5 * (on.rate(omega + rate) - on.rate(omega - rate))
    return omega + on.times_step(rate + 0.5 * on.times_step(along))


def gauss(stages: int) -> Scheme:
    """Return the scheme of Gauss collocation, with 24 fixed-point iterations."""
    nodes, weights = legendre.leggauss(stages)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    powers = np.array([[node**k for k in range(stages)] for node in nodes])
    integrals = np.array([[node ** (k + 1) / (k + 1) for k in range(stages)] for node in nodes])
    matrix = integrals @ np.linalg.inv(powers)

    def scheme(on: Numbers, omega: Array) -> Array:
        slopes = [on.times_step(on.rate(omega))] * stages
        for _ in range(TERMS):
            slopes = [on.times_step(on.rate(_advance(omega, row, slopes))) for row in matrix]
        return _advance(omega, weights, slopes)

    return scheme


SCHEMES = {
    "two-term": FixedStep("two-term", 2, collocation("two-term"), 2.0),
    "four-term": FixedStep("four-term", 2, collocation("four-term"), 4.0),
    "runge-kutta": FixedStep("runge-kutta", 4, runge_kutta_4),
    **{
        each.name: FixedStep(each.name, each.order, tableau(each) if each.matrix else taylor_3)
        for each in FIXED_STEPS
    },
    **{f"gauss-{n}": FixedStep(f"gauss-{n}", 2 * n, gauss(n)) for n in (1, 2, 4)},
}


def local_error(scheme: Scheme, scene: Scene, omega: Array) -> Array:
    """Return truncation errors of a step from n omegas (rad/s), a series of shape (TERMS, n, 3)."""
    on = Series(scene)
    return scheme(on, constant(omega)) - on.solution(omega)


def spacing(count: int) -> Sequence[Fraction]:
    """Return weights of a central difference for f'(0), exact for polynomials of degree 2 `count`.

    Weight i, from 1, multiplies f(i) - f(-i).
    """
    middle = math.comb(2 * count, count)
    return [
        (-1) ** (i + 1) * Fraction(math.comb(2 * count, count + i), i * middle)
        for i in range(1, count + 1)
    ]
