"""The derivative of omega (rad/s2), in symbols or numbers, for a full or changing inertia."""

from typing import Any

from pyharness.model.changing import Changing, ChangingMoments


def rates_of_changing(changing: Changing, time: Any, omega: Any, torque: Any) -> list[Any]:
    """Return the derivative of omega for an inertia that changes with time."""
    matrix, rate, (x, y, z) = changing.matrix(time), changing.matrix_rate(time), omega
    if isinstance(changing, ChangingMoments):
        a, b, c = (matrix[k][k] for k in range(3))
        # Differences of nearly equal moments, unlike of products, have no rounding errors.
        products = (b - c) * (y * z), (c - a) * (z * x), (a - b) * (x * y)
        return [
            (torque[k] - rate[k][k] * omega[k] + products[k]) / moment
            for k, moment in enumerate((a, b, c))
        ]
    return rates_of_inertia(matrix, omega, [torque[k] - _dot(rate[k], omega) for k in range(3)])


def rates_of_inertia(matrix: Any, omega: Any, torque: Any) -> list[Any]:
    """Return the derivative of omega for a full inertia matrix."""
    (x, y, z), (u, v, w) = omega, (_dot(row, omega) for row in matrix)
    products = z * v - y * w, x * w - z * u, y * u - x * v
    return _solved(matrix, [torque[k] + products[k] for k in range(3)])


def _dot(first: Any, second: Any) -> Any:
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def _solved(matrix: list[list[Any]], right: list[Any]) -> list[Any]:
    """Return the solution by L D L^T (Golub and Van Loan 2013, Matrix Computations, 4.1)."""
    (a, f, e), (_, b, d), (_, _, c) = matrix
    l21, l31 = f / a, e / a
    second, below = b - l21 * f, d - l31 * f
    l32 = below / second
    third = c - l31 * e - l32 * below
    u = right[0]
    v = right[1] - l21 * u
    w = right[2] - l31 * u - l32 * v
    z = w / third
    y = v / second - l32 * z
    return [u / a - l21 * y - l31 * z, y, z]
