"""Measurement of orders of convergence."""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pyharness.checks.theory.conditioning import ROUNDING, conditioning
from pyharness.engine.solve import solve
from pyharness.model.effort import check_steps
from pyharness.model.errors import InputError
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.thesis.programs import Program
from pyharness.truth.reference import Reference

# Largest allowed amount by which a measured order is below the theoretical one.
ORDER_SLACK = 0.5
# Conditions for a measurement. Halving the step size must change the result by less than
# `_SMALL_CHANGE`, relative to the largest value. In a step the phases of the body's motion and of
# the torque may change by at most `_SMALL_ANGLE` (rad), because steps that skip whole periods of
# the torque also seem to converge.
_SMALL_CHANGE = 1e-3
_SMALL_ANGLE = 0.5
# The step size is halved at least `_HALVINGS` times, and until a run takes `_MOST_STEPS` steps.
_MOST_STEPS = 2**18
_HALVINGS = 8
# A program that does not converge is incorrect if a textbook method of the same order converges
# with `_MARGIN` times fewer steps.
_MARGIN = 4
_TEXTBOOK = {2: "improved-euler", 4: "rk4"}
# Assumed number of rounding errors of omega per step.
_ROUNDINGS = 8.0
# The linear solver LEQT1F may report a matrix with a larger condition number as singular.
_CONDITION = 1e15

State = Literal["as due", "rounding", "misses", "unsettled", "singular", "sensitive", "unbounded"]


@dataclass(frozen=True)
class Order:
    """A method's measured order of convergence, or why it is undecided."""

    due: int  # order expected by theory
    # `as due`: as expected. `rounding`: the error reached rounding errors before the order showed.
    # `misses`: the error decreases too slowly. In the other states the order is undecided: no step
    # was small enough (`unsettled`), the program found its matrix singular (`singular`), the motion
    # amplifies rounding errors too much (`sensitive`), the solution is unbounded (`unbounded`).
    state: State
    value: float | None  # measured order, if any
    step_size: float  # smallest tried (s); if `singular`, the largest with a singular matrix
    steps: int = 0  # steps of the finest run compared with the reference
    error: float = math.inf  # largest error of that run (rad/s)
    time: float = math.nan  # time of that error (s)

    @property
    def is_judged(self) -> bool:
        return self.state in ("as due", "rounding", "misses")

    def __str__(self) -> str:
        if self.value is not None:
            return f"order {self.value:.2f}"
        return {
            "singular": f"IER = 129 at steps of {self.step_size:.1e} s",
            "sensitive": "the error may be rounding that the motion has multiplied",
            "unbounded": "the solution itself grows without bound",
            "rounding": "rounding from the start",
        }.get(self.state, f"does not settle down to steps of {self.step_size:.1e} s")


class _SingularError(Exception):
    """A run failed, perhaps because its collocation matrix is singular."""


def measured_order(
    scene: Scene, program: Program, listing: Listing, truth: Reference, pairs: int = 2
) -> Order:
    """Return the measured order with which a compiled program's omega converges to `truth`."""

    def omega(finer: Scene) -> Array:
        run = program.run(finer, listing, may_stop=False, velocity=False)
        failed = run.steps < finer.steps or (run.ier is not None and run.ier.any())
        if failed and _may_be_singular(program.name, finer.step_size):
            raise _SingularError
        return run.omega

    def textbook(finer: Scene) -> Array:
        return solve(finer, finer.times(), _TEXTBOOK[program.order], 1.0).omega

    found = order_of(scene, omega, program.order, truth, pairs=pairs)
    if found.state in ("misses", "unsettled", "singular") and _is_grown_rounding(scene, found):
        return replace(found, state="sensitive", value=None)
    if found.state in ("unsettled", "singular"):
        fewer = min(found.steps, _MOST_STEPS) // _MARGIN
        if order_of(scene, textbook, program.order, truth, most_steps=fewer).is_judged:
            return replace(found, state="misses")
    return found


def order_of(
    scene: Scene,
    solution: Callable[[Scene], Array],
    due: int,
    truth: Reference,
    quantity: Literal["omega", "velocity"] = "omega",
    pairs: int = 2,  # number of successive measured orders that must agree
    most_steps: int | None = None,
) -> Order:
    """Return the order of convergence of `solution`, measured by halving the step size.

    `solution` returns `quantity` after each step, until an overflow.
    """
    n = len(truth.time)
    if n < scene.steps:
        return Order(due, "unbounded", None, scene.step_size)
    right = truth.omega if quantity == "omega" else truth.velocity
    assert right is not None
    start = max(map(abs, scene.omega)) if quantity == "omega" else 0.0
    scale = float(np.abs(right).max(initial=start))
    fastest = _fastest(scene, truth.omega)
    state: State = "unsettled"
    step_size, steps = scene.step_size, 0
    error, previous_error, worst = math.inf, math.inf, math.nan
    previous: Array | None = None
    orders: list[float] = []

    def ended(state: State, value: float | None = None) -> Order:
        return Order(due, state, value, step_size, steps, error, worst)

    for finer in _halved(scene, most_steps):
        parts = finer.steps // n
        try:
            found = solution(finer)[parts - 1 :: parts]
        except _SingularError:
            if state != "singular":
                state, step_size = "singular", finer.step_size
            previous = None
            continue
        steps = finer.steps
        if state != "singular":
            step_size = finer.step_size
        if len(found) < n:  # overflow: the step size is far too large
            previous = None
            continue
        errors = np.abs(found - right).max(axis=1)
        error, worst = float(errors.max()), float(truth.time[errors.argmax()])
        if error <= _ROUNDINGS * ROUNDING * scale * steps + truth.error:
            shown = [each for each in orders if _shows(each, due)]
            return ended("as due", shown[-1]) if shown else ended("rounding")
        settles = previous is not None and np.abs(found - previous).max() < _SMALL_CHANGE * scale
        if settles and finer.step_size * fastest <= _SMALL_ANGLE:
            order = math.log2(previous_error / error)
            if orders and _shows(order, due) != _shows(orders[-1], due):
                orders.clear()
            orders.append(order)
            if len(orders) == pairs:
                return ended("as due" if _shows(order, due) else "misses", order)
        previous, previous_error = found, error
    return ended("as due", orders[-1]) if orders and _shows(orders[-1], due) else ended(state)


def _shows(order: float, due: int) -> bool:
    return order >= due - ORDER_SLACK


def _halved(scene: Scene, most_steps: int | None) -> Iterator[Scene]:
    most = max(_MOST_STEPS, scene.steps << _HALVINGS) if most_steps is None else most_steps
    parts = 1
    while scene.steps * parts <= most:
        try:
            finer = replace(scene, step_size=scene.step_size / parts, steps=scene.steps * parts)
            check_steps(finer, "orders", "fortran", 1.0)
        except InputError:
            return  # does not fit in memory, or takes too long
        yield finer
        parts *= 2


def _fastest(scene: Scene, omega: Array) -> float:
    sizes = np.abs(np.vstack([scene.omega, omega]))
    others = np.roll(sizes, -1, axis=1) + np.roll(sizes, -2, axis=1)
    waves = () if isinstance(scene.torque, StateTorque) else scene.law.sines + scene.law.cosines
    turning = float((np.abs(scene.euler_coefficients) * others).max())
    return max([turning, *(abs(frequency) for _, frequency in waves)])


def _is_grown_rounding(scene: Scene, found: Order) -> bool:
    """Return whether the error may be amplified rounding; True if no bound is known."""
    if not found.steps or not math.isfinite(found.error):
        return False
    with suppress(InputError):
        flow = conditioning(scene, found.time)
        return found.error <= flow.limit(0.0, _ROUNDINGS * found.steps) * flow.largest
    return True


def _may_be_singular(program: str, step_size: float) -> bool:
    from pyharness.checks.theory.collocation_matrices import PARTS

    if program not in PARTS:
        return False
    points = np.array([[step_size * part] for part in map(float, PARTS[program])])
    powers = np.arange(len(points))
    with np.errstate(all="ignore"):
        matrix = (powers + 1) * points**powers
    return not (np.isfinite(matrix).all() and np.linalg.cond(matrix) < _CONDITION)
