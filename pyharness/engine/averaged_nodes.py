"""Chebyshev nodes of the slow variable, and equidistant angles, for the method `averaged`.

The formulas are in Trefethen 2000, Spectral Methods in MATLAB, chapters 3 and 6, and Berrut and
Trefethen 2004, SIAM Review 46.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.dense_output import points, to_coefficients


class Slow(NamedTuple):
    """The n Chebyshev points from 0 to 1, their weights, and matrices of shape (n, n)."""

    nodes: Array
    integral: Array  # from values to their integral from 0
    slope: Array  # from values to their derivative
    weights: Array  # of the barycentric formula


class Fast(NamedTuple):
    """Arrays of n equidistant angles in a period."""

    angles: Array
    cosine: Array
    sine: Array
    mean: Array  # weights of the mean; a product is faster than a sum along rows
    integral: Array  # from values, less their mean, to their integral from 0; from the right


@lru_cache(maxsize=16)
def slow_nodes(count: int) -> Slow:
    """Return `count` Chebyshev points and their matrices."""
    at = points(count)
    values = np.polynomial.chebyshev.chebvander(at, count)
    integrals = np.empty((count, count))
    for n in range(count):
        terms = np.polynomial.chebyshev.chebint(np.eye(count)[n], lbnd=-1.0)
        integrals[:, n] = values[:, : len(terms)] @ terms
    integral = 0.5 * integrals @ to_coefficients(count)
    integral[0] = 0.0
    weights = np.ones(count)
    weights[1::2] = -1.0
    weights[[0, -1]] *= 0.5
    slope = weights / weights[:, None] / (at[:, None] - at + np.eye(count))
    np.fill_diagonal(slope, 0.0)
    np.fill_diagonal(slope, -slope.sum(axis=1))
    return Slow(0.5 + 0.5 * at, integral, 2.0 * slope, weights)


@lru_cache(maxsize=16)
def fast_nodes(count: int) -> Fast:
    """Return an even number `count` of angles and their arrays."""
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    waves = np.fft.rfft(np.eye(count), axis=1)
    divided = np.zeros_like(waves)
    divided[:, 1:-1] = waves[:, 1:-1] / (1j * np.arange(1, waves.shape[1] - 1))
    integral = np.fft.irfft(divided, n=count, axis=1)
    return Fast(
        angles,
        np.cos(angles),
        np.sin(angles),
        np.full(count, 1.0 / count),
        integral - integral[:, :1],
    )


def between_nodes(count: int, at: Array) -> Array:
    """Return the matrix of barycentric interpolation from `count` nodes to `at`, from 0 to 1."""
    slow = slow_nodes(count)
    distance = at[:, None] - slow.nodes
    hit = np.abs(distance) < 1e-17
    distance[hit] = 1.0
    found = slow.weights / distance
    found /= found.sum(axis=1)[:, None]
    rows = hit.any(axis=1)
    found[rows] = hit[rows]
    return found


def between_angles(count: int, at: Array) -> Array:
    """Return the trigonometric interpolation matrix from `count` angles (even) to `at` (rad)."""
    half = 0.5 * (at[:, None] - fast_nodes(count).angles)
    sine = np.sin(half)
    hit = np.abs(sine) < 1e-17
    sine[hit] = 1.0
    found: Array = np.sin(count * half) * np.cos(half) / (count * sine)
    found[hit] = 1.0
    return found
