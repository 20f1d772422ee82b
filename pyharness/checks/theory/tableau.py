"""Weighted residual methods as Runge-Kutta tableaux.

The methods are collocation, subdomain, Galerkin and least squares, with the trial function omega(0)
+ c1 t + ... + cn t**n. Its derivative is a projection of the right-hand side f along the step on
the polynomials of degree n - 1, computed on the unit interval s = t / h in the Legendre basis.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.polynomial import legendre

from pyharness.checks.theory.collocation_matrices import fractions, inverse
from pyharness.model.trajectory import Array


@dataclass(frozen=True, eq=False)
class Tableau:
    """One correction of a step as a Runge-Kutta tableau."""

    # Shape (m,), in units of the step size h: the points at which f is evaluated (collocation
    # points, or quadrature nodes of the weighted integrals).
    nodes: Array
    matrix: Array  # shape (m, m); the next estimate at the nodes is omega(0) + h matrix f
    weights: Array  # shape (m,); the result of the step is omega(0) + h weights f


@cache
def tableau(weighting: str, terms: int, points: str | tuple[float, ...] | None = None) -> Tableau:
    """Return the tableau of a weighted residual method.

    `weighting` is "collocation", "subdomain", "galerkin" or "least-squares"; `points` is as in
    `grid`.
    """
    # Products of two omegas have degree 2n, and the weight functions n (Galerkin), n - 1 (least
    # squares) or 0 (subdomain). The quadrature is exact under constant torque; under other torques,
    # its error has the order 2n + 1 or higher, above the method's order.
    n = terms
    if weighting == "collocation":
        nodes = grid(points, n)
        tests, quadrature = np.eye(n), np.ones(n)
    elif weighting == "subdomain":
        part, quadrature = _gauss(n + 1)
        nodes = ((np.arange(n)[:, None] + part) / n).ravel()
        quadrature = np.tile(quadrature / n, n)
        tests = np.repeat(np.eye(n), n + 1, axis=0)
    else:
        degree = 3 * n if weighting == "galerkin" else 3 * n - 1
        nodes, quadrature = _gauss(degree // 2 + 1)
        # `tests` span the same space as the weight functions t ... t**n (Galerkin) or
        # 1 ... t**(n-1) (least squares).
        tests = basis(nodes, n)
        if weighting == "galerkin":
            tests = tests * nodes[:, None]
    weighted = fractions((tests * quadrature[:, None]).T)
    # In fractions, because in floats the tableau would depend on the installed LAPACK.
    projection = inverse(weighted @ fractions(basis(nodes, n))) @ weighted
    # Integrals of the `basis` polynomials from 0 to the nodes.
    antiderivatives = legendre.legint(np.eye(n), lbnd=-1.0, scl=0.5)
    integrals = legendre.legval(2.0 * nodes - 1.0, antiderivatives).T
    matrix = fractions(integrals) @ projection
    return Tableau(nodes, matrix.astype(float), projection[0].astype(float))


def grid(points: str | tuple[float, ...] | None, n: int) -> Array:
    """Return n collocation points in units of the step size, by default as in the thesis."""
    if points == "gauss":
        return _gauss(n)[0]
    if points is None or points == "thesis":
        return np.arange(1, n + 1) / (n + 1)
    return np.array(points, dtype=float)


def _gauss(m: int) -> tuple[Array, Array]:
    """Return m Gauss-Legendre nodes and weights on the unit interval."""
    nodes, weights = [], []
    for near in legendre.leggauss(m)[0].tolist():
        # One Newton step removes the error of the nodes, which leggauss computes as eigenvalues.
        value, slope = _legendre(m, Fraction(near))
        x = (Fraction(near) - value / slope).limit_denominator(10**36)
        _, slope = _legendre(m, x)
        nodes.append(float((x + 1) / 2))
        weights.append(float(1 / ((1 - x * x) * slope * slope)))
    return np.array(nodes), np.array(weights)


def _legendre(m: int, x: Fraction) -> tuple[Fraction, Fraction]:
    """Return the Legendre polynomial of degree m and its derivative at x, inside (-1, 1)."""
    before, value = Fraction(1), x
    for k in range(2, m + 1):
        before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
    return value, m * (x * value - before) / (x * x - 1)


def basis(s: Array, n: int) -> Array:
    """Return Legendre polynomials 0 to n - 1 on [0, 1] at m points `s`, shape (m, n)."""
    return np.asarray(legendre.legvander(2.0 * s - 1.0, n - 1), dtype=float)
