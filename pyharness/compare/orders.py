"""Measured orders: the power of the step size with which the error against the reference falls."""

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pyharness.methods.solve import solve
from pyharness.model.effort import check_steps
from pyharness.model.errors import InputError
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.original.programs import Program
from pyharness.theory.conditioning import ROUNDING, conditioning
from pyharness.truth.reference import Reference

# A measured order may be below the expected one by at most this.
ORDER_SLACK = 0.5
# The order is measured once halving the step changes the result by less than `_SMALL_CHANGE`,
# relative to the largest value, and a step turns body and torque by at most `_SMALL_ANGLE` (rad).
# The angle is limited because steps that skip periods of the torque seem to converge too.
_SMALL_CHANGE = 1e-3
_SMALL_ANGLE = 0.5
# The step is halved until this many steps are taken, and at least eight times.
_MOST_STEPS = 2**18
_HALVINGS = 8
# If a textbook method of the same order converges with this many times fewer steps, a program that
# does not converge is at fault.
_MARGIN = 4
_TEXTBOOK = {2: "improved-euler", 4: "rk4"}
# Number of rounding errors of omega in a step.
_ROUNDINGS = 8.0
# A matrix with a larger condition number may be found singular.
_CONDITION = 1e15

State = Literal["as due", "rounding", "misses", "unsettled", "singular", "sensitive", "unbounded"]


@dataclass(frozen=True)
class Order:
    """The order of convergence measured by halving the step, or the reason why it is unknown."""

    due: int  # the expected order, which theory gives to the method
    # `as due`: the order was observed. `rounding`: the error was rounding error before the order
    # could be observed. `misses`: the error decreases more slowly. The last four leave the order
    # undecided: no step was small enough (`unsettled`), the program found its matrix singular
    # (`singular`), the motion amplifies rounding too much (`sensitive`), or the solution is
    # unbounded (`unbounded`).
    state: State
    value: float | None  # the measured order, if it could be measured
    step_size: float  # the smallest that was tried (s); if `singular`, the longest singular one
    steps: int = 0  # number of steps of the finest run that was compared with the reference
    error: float = math.inf  # the largest error of that run (rad/s)
    time: float = math.nan  # the time of that error (s)

    @property
    def is_judged(self) -> bool:
        """Return whether the measurement decides if the method has its expected order."""
        return self.state in ("as due", "rounding", "misses")

    def __str__(self) -> str:
        """Return the measured order as text, or in a few words why it is unknown."""
        if self.value is not None:
            return f"order {self.value:.2f}"
        return {
            "singular": f"IER = 129 at steps of {self.step_size:.1e} s",
            "sensitive": "the error may be rounding that the motion has multiplied",
            "unbounded": "the solution itself grows without bound",
            "rounding": "rounding from the start",
        }.get(self.state, f"does not settle down to steps of {self.step_size:.1e} s")


class _SingularError(Exception):
    """The signal that a run failed at a step size for which its matrix may be singular.

    If LEQT1F finds the collocation matrix singular, the program uses the right-hand sides in place
    of the solution. It is then another method, whose order is not measured.
    """


def measured_order(
    scene: Scene, program: Program, listing: Listing, truth: Reference, pairs: int = 2
) -> Order:
    """Measure the order with which omega of a listing's compiled program converges to `truth`.

    The measurement and the result are those of `order_of`, which explains `truth` and `pairs`. An
    error that may be amplified rounding counts as `sensitive`, not as `misses`. Failure to converge
    counts as `misses` if a textbook method of the same order converges.
    """

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
    pairs: int = 2,
    most_steps: int | None = None,
) -> Order:
    """Measure the order of a numerical solution by halving the step size until it is small.

    `scene` has the longest step, and `truth` is the reference solution at the times of `scene`.
    `solution` takes a scene and returns the judged `quantity` after each step of that scene, shape
    (n, 3), with fewer rows if it overflows. `due` is the expected order. The order is decided if it
    appears, or fails to appear, in `pairs` consecutive halvings. The step is halved as long as
    there are at most `most_steps` steps; by default until there are 2**18 steps, and at least eight
    times. The result is an Order, with the state that was found and the measured order.
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
        if len(found) < n:  # overflow: the step is far too large
            previous = None
            continue
        errors = np.abs(found - right).max(axis=1)
        error, worst = float(errors.max()), float(truth.time[errors.argmax()])
        if error <= _ROUNDINGS * ROUNDING * scale * steps + truth.error:
            shown = [each for each in orders if _shows(each, due)]
            value = shown[-1] if shown else None
            state = "as due" if shown else "rounding"
            return Order(due, state, value, step_size, steps, error, worst)
        settles = previous is not None and np.abs(found - previous).max() < _SMALL_CHANGE * scale
        if settles and finer.step_size * fastest <= _SMALL_ANGLE:
            order = math.log2(previous_error / error)
            if orders and _shows(order, due) != _shows(orders[-1], due):
                orders.clear()
            orders.append(order)
            if len(orders) == pairs:
                state = "as due" if _shows(order, due) else "misses"
                return Order(due, state, order, step_size, steps, error, worst)
        previous, previous_error = found, error
    if orders and _shows(orders[-1], due):
        return Order(due, "as due", orders[-1], step_size, steps, error, worst)
    return Order(due, state, None, step_size, steps, error, worst)


def _shows(order: float, due: int) -> bool:
    return order >= due - ORDER_SLACK


def _halved(scene: Scene, most_steps: int | None) -> Iterator[Scene]:
    """Yield the scene with its own step size, with half of it, with a quarter, and so on.

    All have the same last time, and at most `most_steps` steps.
    """
    most = max(_MOST_STEPS, scene.steps << _HALVINGS) if most_steps is None else most_steps
    for halvings in itertools.count():
        parts = 2**halvings
        if scene.steps * parts > most:
            return
        try:
            finer = replace(scene, step_size=scene.step_size / parts, steps=scene.steps * parts)
            check_steps(finer, "orders", "fortran", 1.0)
        except InputError:
            return  # does not fit in memory, or takes too long
        yield finer


def _fastest(scene: Scene, omega: Array) -> float:
    """Return the fastest rate (rad/s) that a step has to resolve.

    It is the largest angular frequency of the torque's waves, or a bound on the rate at which the
    equations change a perturbation of the solution `omega` (rad/s), whichever is larger.
    """
    sizes = np.abs(np.vstack([scene.omega, omega]))
    others = np.roll(sizes, -1, axis=1) + np.roll(sizes, -2, axis=1)
    waves = scene.torque.sines + scene.torque.cosines
    turning = float((np.abs(scene.euler_coefficients) * others).max())
    return max([turning, *(abs(frequency) for _, frequency in waves)])


def _is_grown_rounding(scene: Scene, found: Order) -> bool:
    """Return whether the error of a measured order may be rounding that the motion amplifies.

    `found` is the measurement. Its error may be rounding if it is not above the bound on amplified
    rounding errors, or if this bound can't be computed.
    """
    if not found.steps or not math.isfinite(found.error):
        return False
    try:
        flow = conditioning(scene, found.time)
    except InputError:
        return True
    return found.error <= flow.limit(0.0, _ROUNDINGS * found.steps) * flow.largest


def _may_be_singular(program: str, step_size: float) -> bool:
    """Return whether LEQT1F may find a program's collocation matrix at a step size (s) singular.

    It may if the matrix overflows, or if its condition number is not below 1e15.
    """
    from pyharness.theory.collocation_matrices import PARTS

    if program not in PARTS:
        return False
    points = np.array([[step_size * part] for part in map(float, PARTS[program])])
    powers = np.arange(len(points))
    with np.errstate(all="ignore"):
        matrix = (powers + 1) * points**powers
    return not (np.isfinite(matrix).all() and np.linalg.cond(matrix) < _CONDITION)
