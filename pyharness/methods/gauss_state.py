"""Gauss collocation with equal steps for torques that depend on omega or attitude, in Python.

It is the counterpart of `fortran/modern/gauss_collocation.f90`, after Hairer, McLachlan and
Razakarivony 2008: the stages of a step are iterated (fixed-point iteration) until rounding stops
the iteration, and the sum of the steps is compensated. The right-hand side is the tape of the
equations of motion, evaluated for all stages at once.
"""

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pyharness.dynamics.array_tape import outputs_at
from pyharness.methods.recorded import system
from pyharness.model.codes import Statuses
from pyharness.model.scene import Scene
from pyharness.model.tape import ATTITUDE, OMEGA
from pyharness.model.tape_derivative import with_derivatives
from pyharness.model.trajectory import Array

_MOST_ITERATIONS, _PATIENT = 60, 50
# Smaller relative changes may stop falling.
_ROUNDING = 1e-13
# Work limit (s), and the times in microseconds that an iteration and an operation of it take.
_MOST_SECONDS = 10.0
_WORK, _OPERATION_WORK = 100.0, 3.0


class Tables(NamedTuple):
    """The coefficients of Gauss collocation on [0, 1]; stages are rows, and columns of `matrix`."""

    nodes: Array
    weights: Array
    matrix: Array
    onward: Array  # from the slopes of a step to the changes until the nodes of the next step


@lru_cache(maxsize=8)
def tables(stages: int) -> Tables:
    """Return the coefficients of Gauss collocation with 1 to 8 stages, rounded to binary64.

    The nodes are the roots of a Legendre polynomial. Weights and matrices are integrals of the
    Lagrange polynomials of the nodes; they are computed without rounding.
    """
    roots, _ = np.polynomial.legendre.leggauss(stages)
    nodes = 0.5 * (1.0 + roots)
    exact = [Fraction(float(node)) for node in nodes]
    zero, one = Fraction(0), Fraction(1)
    rows = [_integrals(exact, zero, end) for end in exact]
    onward = [_integrals(exact, one, one + end) for end in exact]
    weights = np.array(_integrals(exact, zero, one))
    return Tables(nodes, weights, np.array(rows), np.array(onward))


def _integrals(nodes: list[Fraction], begin: Fraction, end: Fraction) -> list[float]:
    """Return the integrals of the Lagrange polynomials of `nodes` from `begin` to `end`."""
    found = []
    for own in nodes:
        basis = [Fraction(1)]  # coefficients in ascending order of the powers
        for other in nodes:
            if other != own:
                lower, higher = [Fraction(0), *basis], [*basis, Fraction(0)]
                basis = [
                    (x - other * y) / (own - other) for x, y in zip(lower, higher, strict=True)
                ]
        total = sum(
            (c * (end ** (k + 1) - begin ** (k + 1)) / (k + 1) for k, c in enumerate(basis)),
            Fraction(0),
        )
        found.append(float(total))
    return found


def step_counts(lengths: Array, step: float) -> Array:
    """Return the number of equal steps that the kernel takes in each interval between times.

    `lengths` are the lengths of the intervals (s). No step is longer than `step` (s), except for a
    relative excess of 1e-6.
    """
    with np.errstate(over="ignore", divide="ignore"):
        return np.maximum(1.0, np.floor(np.minimum(lengths / step, 1e18) + (1.0 - 1e-6)))


class GaussState:
    """The solutions of one scene with a recorded torque by Gauss collocation with equal steps.

    Attributes
    ----------
    most : float
        The work limit of all solutions together: a number of right-hand sides.
    rate : float
        A rate of change of the initial state (1/s), from which the first step follows.
    pushed : float
        The change of omega (rad/s) that the initial angular acceleration causes until the end.
    """

    def __init__(self, scene: Scene, stages: int, times: Sequence[float], effort: float) -> None:
        """Record the equations of motion of a scene, which is solved at `times` (s).

        The times are in order away from 0, and `effort` is the factor on the work limit. Raise
        InputError for an opaque torque.
        """
        self._tape = system(scene)
        self._times, end = times, times[-1]
        # The steps also end where a table of the torque changes, and the order is therefore kept.
        inside = {x for x in self._tape.breaks if 0.0 < x / (end or 1.0) < 1.0}
        self._stops = sorted({*times, *inside} - {0.0}, key=abs)
        self._first = 0.0
        self._tables, self._stages = tables(stages), stages
        self.start = np.array([*scene.omega, *(scene.attitude or ())])
        work = (_WORK + _OPERATION_WORK * len(self._tape.operations)) * 1e-6
        self.most = effort * _MOST_SECONDS / work * stages
        slots = (*OMEGA, *ATTITUDE)[: len(self.start)]
        m = len(slots)
        at = np.zeros(1), self.start[None, :]
        found = outputs_at(with_derivatives(self._tape, slots), *at)[0]
        slopes, matrix = found[:m], found[m:].reshape(m, m)
        omega = float(np.abs(self.start[:3]).max())
        self.pushed = float(np.abs(slopes[:3]).max()) * abs(end)
        units = np.array([omega or 1.0] * 3 + [1.0] * (m - 3))
        with np.errstate(all="ignore"):
            rate = float(np.abs(matrix * units / units[:, None]).sum(axis=1).max())
            if omega:
                rate = max(rate, float(np.abs(slopes[:3]).max()) / omega)
        self.rate = rate if math.isfinite(rate) else 0.0

    def counts(self, step: float) -> Array:
        """Return the numbers of equal steps between the times at which steps must end.

        `step` is the largest step size (s) at the first call. At later calls it is a fraction of
        the first step size, and all numbers grow by the same factor.
        """
        self._first = self._first or step
        lengths = np.abs(np.diff(np.array(self._stops), prepend=0.0))
        return step_counts(lengths, self._first) * round(self._first / step)

    def rows(self, step: float) -> tuple[Array, Array, int, int, int]:
        """Return the states at the requested times, with the steps of `counts`.

        The results are those of the compiled kernel: the states, shape (3, n) or (7, n), of which
        the first few are results; time and omega after the last successful step; the number of
        results, the status, and the number of right-hand sides. The status is that of an exceeded
        work limit if the iteration of a step does not converge.
        """
        times = self._times
        y, carry = self.start.copy(), np.zeros(len(self.start))
        rows = np.full((len(y), len(times)), math.nan)
        reached = np.array([0.0, *y[:3]])
        row, begin, evaluations = 0, 0.0, 0
        if times[0] == 0.0:
            rows[:, 0], row = y, 1
        counts = self.counts(step).astype(int).tolist()
        for end, count in zip(self._stops, counts, strict=True):
            h = (end - begin) / count
            slopes = np.zeros((self._stages, len(y)))
            for done in range(count):
                time = begin + done * h
                y, carry, slopes, iterations, status = self._advance(time, h, y, carry, slopes)
                evaluations += iterations * self._stages
                if status == Statuses.COMPLETE and evaluations > self.most:
                    status = Statuses.GAVE_UP
                if status != Statuses.COMPLETE:
                    return rows, reached, row, status, evaluations
                reached = np.array([time + h, *y[:3]])
            begin = end
            if end == times[row]:
                rows[:, row], row = y, row + 1
        return rows, reached, len(times), Statuses.COMPLETE, evaluations

    def _advance(
        self, time: float, h: float, y: Array, carry: Array, slopes: Array
    ) -> tuple[Array, Array, Array, int, int]:
        """Take one step from `time` (s), and return the state, its rounding error, and the slopes.

        `slopes` are the derivatives of the state at the stages of the last step, or 0 if there is
        none. The other results are the number of iterations, and the status.
        """
        one = self._tables
        at = time + one.nodes * h
        size = float(np.abs(y[:3]).max())
        with np.errstate(all="ignore"):
            change = h * (one.onward @ slopes)
            before, status, iteration = math.inf, Statuses.GAVE_UP, 0
            for iteration in range(1, _MOST_ITERATIONS + 1):
                slopes = outputs_at(self._tape, at, y + (change + carry))
                push = abs(h) * float(np.abs(slopes[:, :3]).max())
                units = np.array([size or push or 1.0] * 3 + [1.0] * (len(y) - 3))
                last, change = change, h * (one.matrix @ slopes)
                moved = float((np.abs(change - last) / units).max())
                if not math.isfinite(moved):
                    status = Statuses.OVERFLOW
                    break
                patience = 1.0 + push / units[0] if iteration > _PATIENT else 1.0
                if moved == 0.0 or before <= moved <= _ROUNDING * patience:
                    status = Statuses.COMPLETE
                    break
                before = moved
            step = h * (one.weights @ slopes) + carry
            total = y + step
            # Compensated summation: what the sum can't contain is added to the next step.
            carry = step - (total - y)
        if status == Statuses.COMPLETE and not np.isfinite(total).all():
            status = Statuses.OVERFLOW
        return total, carry, slopes, iteration, status
