"""Orders: the power with which an error against the truth falls as the step is halved."""

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pyharness.errors import InputError
from pyharness.listing import Listing
from pyharness.methods import Program
from pyharness.reference import Reference
from pyharness.scene import Scene
from pyharness.trajectory import Array

# An order must come within half an order of the one that is due.
ORDER_SLACK = 0.5
# It is measured where halving the step moves the result by less than this, relative to the largest
# |omega|; torques that the steps skip can look like that, so that a miss has to come again.
_SMALL_CHANGE = 1e-3
_MISSES = 4
# A step far too long is halved until this many are taken, and eight times at least.
_MOST_STEPS = 2**18
_HALVINGS = 8
# Radians of a step in which nothing can be missed: who does not settle there will not.
_SMALL_ANGLE = 0.01
# Rounding: so many units in the last place of the largest |omega| per step.
_ROUNDING = 8.0 * 2.0**-53


@dataclass(frozen=True)
class Order:
    """What became of the error as the step was halved.

    Attributes
    ----------
    due : int
        The order that the method has.
    state : {"as due", "rounding", "misses", "not judged"}
        Whether it showed; `rounding`: the error was that of rounding from the start.
    value : float or None
        As measured, if it could be.
    note : str
        Why it is `not judged`, or that it does not settle.
    """

    due: int
    state: Literal["as due", "rounding", "misses", "not judged"]
    value: float | None = None
    note: str = ""


class _SingularError(Exception):
    """The matrix of a program is found singular, so that it is not the method it was."""


def measured_order(scene: Scene, program: Program, listing: Listing, truth: Reference) -> Order:
    """Measure the order of a program, by its runs without IER; see `order_of`."""

    def omega(finer: Scene) -> Array:
        run = program.run(finer, listing, may_stop=False, velocity=False)
        if run.ier is not None and run.ier.any():
            raise _SingularError(f"IER = {run.ier.max()} at steps of {finer.step_size:.1e} s")
        return run.omega

    return order_of(scene, omega, program.order, truth)


def order_of(scene: Scene, solution: Callable[[Scene], Array], due: int, truth: Reference) -> Order:
    """Halve the step until it is small, and measure the power with which the error falls.

    Parameters
    ----------
    solution : callable
        Returns omega, shape (n, 3), after each step of the scene that it is given.
    truth : Reference
        At the scene's own times.
    """
    n = len(truth.time)
    if n < scene.steps:
        return Order(due, "not judged", note="the solution itself leaves every bound")
    scale = float(np.abs(truth.omega).max(initial=max(map(abs, scene.omega))))
    previous: Array | None = None
    previous_error = math.inf
    misses: list[float] = []
    restless, note = False, "too few steps to tell"
    for finer in _halved(scene):
        try:
            omega = solution(finer)[finer.steps // n - 1 :: finer.steps // n]
        except _SingularError as found:
            note = note if restless else str(found)
            break
        note = f"does not settle down to steps of {finer.step_size:.1e} s"
        restless = finer.step_size * _fastest(scene, scale) <= _SMALL_ANGLE
        if len(omega) < n:
            continue  # overflow: the step is far too large
        error = float(np.abs(omega - truth.omega).max())
        if not misses and error <= _ROUNDING * scale * finer.steps + truth.error:
            return Order(due, "rounding")
        if previous is None:
            restless = False
        elif np.abs(omega - previous).max() < _SMALL_CHANGE * scale:
            order = math.log2(previous_error / error) if error else math.inf
            if order >= due - ORDER_SLACK:
                return Order(due, "as due", order)
            misses.append(order)
            if len(misses) == _MISSES:
                break
        previous, previous_error = omega, error
    if misses:
        return Order(due, "misses", misses[-1])
    return Order(due, "misses" if restless else "not judged", note=note)


def _halved(scene: Scene) -> Iterator[Scene]:
    """Yield the scene in its own steps, in half of them, and so on."""
    for halvings in itertools.count():
        parts = 2**halvings
        if halvings > _HALVINGS and scene.steps * parts > _MOST_STEPS:
            return
        try:
            yield replace(scene, step_size=scene.step_size / parts, steps=scene.steps * parts)
        except InputError:
            return  # does not fit in memory


def _fastest(scene: Scene, largest: float) -> float:
    """Return a rate (rad/s) that neither the motion nor the torque exceeds."""
    turning = 2.0 * largest * max(map(abs, scene.euler_coefficients))
    waves = scene.torque.sines + scene.torque.cosines
    return max([turning, *(abs(frequency) for _, frequency in waves)])
