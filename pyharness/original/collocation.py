"""One interval of the collocation of IV.2, for up to five terms.

Every unknown is a polynomial x(0) + c1 t + c2 t**2 + ... (eq. 34) whose derivative meets the
right-hand side at as many points as there are terms (eq. 36). The right-hand side needs the
unknowns themselves: a first estimate takes it constant, one correction takes it at the points.
"""

from collections.abc import Callable, Sequence

from pyharness.original.equations import Vector
from pyharness.original.linear_solver import leqt1f

Rates = Callable[[int, Vector], list[float]]
"""Right-hand sides of all unknowns at point k (0 is the interval's beginning)."""


def interval(
    start: Vector, points: Sequence[float], end: float, rates: Rates
) -> tuple[list[float], int]:
    """Advance all unknowns by one interval.

    Parameters
    ----------
    start : sequence of float
        The unknowns at the interval's beginning.
    points : sequence of float
        Times of collocation, from the interval's beginning (s).
    end : float
        The time at which the result is wanted, from the interval's beginning (s).
    rates : callable
        ``rates(k, x)``: right-hand sides at point k = 0 (the beginning), 1, 2, ...

    Returns
    -------
    list of float
        The unknowns at `end`.
    int
        IER of the second solution.
    """
    constant = rates(0, start)
    estimate, _ = fit(points, [constant] * len(points))
    at_points = [rates(k, values(start, estimate, t)) for k, t in enumerate(points, 1)]
    corrected, ier = fit(points, at_points)
    return values(start, corrected, end), ier


def fit(points: Sequence[float], rates: Sequence[Vector]) -> tuple[list[list[float]], int]:
    """Return the coefficients c1, c2, ... of every unknown whose derivative meets `rates`."""
    by_unknown = [list(column) for column in zip(*rates, strict=True)]
    return leqt1f(collocation_matrix(points), by_unknown)


def collocation_matrix(points: Sequence[float]) -> list[list[float]]:
    """Return the derivatives of t, t**2, ... at every point, a row for each (eq. 36)."""
    return [
        [1.0, 2.0 * t, 3.0 * (t * t), 4.0 * (t * t * t), 5.0 * (t * t * t * t)][: len(points)]
        for t in points
    ]


def values(start: Vector, coefficients: Sequence[Vector], t: float) -> list[float]:
    """Return x(0) + c1 t + c2 t**2 + ... for every unknown, added in this order."""
    t2 = t * t
    powers = [t, t2, t2 * t, t2 * t2, t2 * t2 * t]
    result = []
    for x, unknown in zip(start, coefficients, strict=True):
        total = x
        for c, power in zip(unknown, powers, strict=False):
            total = total + c * power
        result.append(total)
    return result
