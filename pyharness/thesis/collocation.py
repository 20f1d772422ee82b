"""Collocation with up to five terms (section IV.2 of the thesis): a step and a run.

In a step, each unknown is a polynomial x(0) + c1 t + c2 t**2 + ... (eq. 34). With n terms after
x(0), its derivative equals the right-hand side at n collocation points (eq. 36). A first estimate
assumes a constant right-hand side; one correction evaluates it along this estimate.
"""

from collections.abc import Callable, Sequence
from functools import partial

from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.equations import Record, Vector, all_finite, initial_torque
from pyharness.thesis.linear_solver import leqt1f

Rates = Callable[[int, Vector], list[float]]
"""A function of k and the unknowns that returns the right-hand sides.

k is the number of a collocation point, or 0 for the start of the step.
"""


def integrate(
    scene: Scene,
    listing: Listing,
    points_of: Callable[[float], list[float]],
    rates: Callable[[Sequence[Vector], int, Vector], list[float]],
) -> Trajectory:
    """Run a collocation program, whose points (s) are `points_of(DT)`.

    `rates` takes the torques divided by moments (rad/s2), then the arguments of `Rates`.
    """
    h = scene.step_size
    dt = h
    time = 0.0
    state = [*scene.omega, 0.0, 0.0, 0.0]
    n_rates = 1 + len(points_of(dt))
    record = Record(scene, evaluations_per_step=n_rates)
    first = initial_torque(scene) if listing.has("initial-torque") else None

    for step in range(scene.steps):
        begin = step * h
        time = time + dt
        points = points_of(dt)
        if step == 0 and first is not None:
            torques: list[Vector] = [first] * n_rates
        elif listing.has("torque-held"):
            torques = [scene.normalized_torque(time)] * n_rates
        else:
            torques = [scene.normalized_torque(begin + t) for t in (0.0, *points)]
        state, ier = interval(state, points, h, partial(rates, torques))
        if not all_finite(state[:3]):
            return record.trajectory("overflow")
        record.add(time, state[:3], state[3:], ier)
        if listing.has("dt-accumulates"):
            dt = dt + h
    return record.trajectory()


def interval(
    start: Vector, points: Sequence[float], end: float, rates: Rates
) -> tuple[list[float], int]:
    """Return the unknowns at `end` (s after the start), and the correction's error code IER.

    `points` are the collocation points, in s after the start.
    """
    constant = rates(0, start)
    estimate, _ = fit(points, [constant] * len(points))
    at_points = [rates(k, values(start, estimate, t)) for k, t in enumerate(points, 1)]
    corrected, ier = fit(points, at_points)
    return values(start, corrected, end), ier


def fit(points: Sequence[float], rates: Sequence[Vector]) -> tuple[list[list[float]], int]:
    """Return each unknown's coefficients c1, c2, ... from its `rates` at `points` (s), and IER."""
    by_unknown = [list(column) for column in zip(*rates, strict=True)]
    return leqt1f(collocation_matrix(points), by_unknown)


def collocation_matrix(points: Sequence[float]) -> list[list[float]]:
    """Return the derivatives of t, t**2, ... at the points (s), a row for each point (eq. 36)."""
    return [
        [1.0, 2.0 * t, 3.0 * (t * t), 4.0 * (t * t * t), 5.0 * (t * t * t * t)][: len(points)]
        for t in points
    ]


def values(start: Vector, coefficients: Sequence[Vector], t: float) -> list[float]:
    """Return each unknown at `t` (s): x(0) + c1 t + c2 t**2 + ..., summed in this order."""
    t2 = t * t
    powers = [t, t2, t2 * t, t2 * t2, t2 * t2 * t]
    result = []
    for x, unknown in zip(start, coefficients, strict=True):
        total = x
        for c, power in zip(unknown, powers, strict=False):
            total = total + c * power
        result.append(total)
    return result
