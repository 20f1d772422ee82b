"""Linear stability: the amplification matrix of a step of each program.

A perturbation of a steady rotation obeys a linear equation x' = J x, and so does the velocity of a
body in steady rotation. Along an eigenvector of J a step is a matrix whose elements are polynomials
in z = h times the eigenvalue. The algebra of each scheme gives them here in fractions. The same
polynomials hold for the matrix hJ in place of z. The original Runge-Kutta program keeps a second
vector, U(1), from step to step. Its matrix therefore has two rows, for U(1) and for the result.
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.listing import Listing
from pyharness.theory.collocation_matrices import PARTS
from pyharness.theory.rational import Exact, Fractions, collocation_matrix, inverse

Complex = NDArray[np.complexfloating[Any, Any]]

_HIGHEST = 5
# A stability boundary nearer to the origin than this is taken to be the origin.
NEAREST = 2.0**-4
_NOTHING = 1e-14


@dataclass(frozen=True, eq=False)
class Amplification:
    """The amplification matrix of one step."""

    # of Fraction, shape (m, m, 5): for element (i, j) the coefficients of 1, z ... z**4; the last
    # row belongs to the result
    coefficients: Fractions

    @property
    def size(self) -> int:
        """Return the number of vectors that are kept from step to step."""
        return len(self.coefficients)

    def at(self, z: Complex) -> Complex:
        """Return the matrices at many z, shape (..., m, m)."""
        powers = np.stack([z**k for k in range(_HIGHEST)], axis=-1)
        return np.asarray(np.einsum("...k,ijk->...ij", powers, self.coefficients.astype(float)))

    def radius(self, z: Complex) -> NDArray[np.float64]:
        """Return the spectral radius of the matrix at many z."""
        return np.asarray(np.abs(np.linalg.eigvals(self.at(z))).max(axis=-1))

    def moving(self) -> "Amplification":
        """Return the matrix without the result, if no other vector depends on the result.

        The result then only accumulates the other vectors, with an eigenvalue that does not depend
        on z.
        """
        column = self.coefficients[:, -1]
        if self.size > 1 and not column[:-1].any() and not column[-1, 1:].any():
            return Amplification(self.coefficients[:-1, :-1])
        return self

    def of(self, matrix: Exact) -> Fractions:
        """Return the exact matrix of a step for a linear system, from hJ with n rows.

        The matrix has m n rows.
        """
        power = np.eye(len(matrix), dtype=object)
        total = np.kron(self.coefficients[..., 0], power)
        for k in range(1, _HIGHEST):
            power = np.array(matrix, dtype=object) @ power
            total = total + np.kron(self.coefficients[..., k], power)
        return np.asarray(total)

    def text(self) -> str:
        """Return the polynomial, or the matrix row by row, as text."""
        rows = [", ".join(_polynomial_text(each) for each in row) for row in self.coefficients]
        return rows[0] if self.size == 1 else "[" + "; ".join(rows) + "]"


def amplification(listing: Listing, step: int = 1) -> Amplification:
    """Return the amplification matrix of a program's step number `step`, counted from 1.

    In collocation the first estimate takes the right-hand side z x as constant, so that the
    estimate is a straight line. The one correction evaluates the right-hand side along that line.
    """
    if listing.program == "runge-kutta":
        return _runge_kutta(listing)
    points, weights = _quadrature(listing, step)
    nothing = Fraction(0)
    end = [Fraction(1), weights.sum(), weights @ points, nothing, nothing]
    return Amplification(np.array([[end]], dtype=object))


def weight_of_squares(listing: Listing, step: int) -> Fraction:
    """Return a collocation program's integral of s**2 over a step, in units of the step cubed.

    Along the first estimate the right-hand side is F + s J F + s**2 Q(F), where s is the time since
    the beginning of the step. The exact integral is 1/3.
    """
    points, weights = _quadrature(listing, step)
    found: Fraction = weights @ points**2
    return found


def _quadrature(listing: Listing, step: int) -> tuple[Fractions, Fractions]:
    """Return the collocation points and the weights of a step, in units of the step.

    With `dt-accumulates` the points move from step to step.
    """
    moved = step if listing.has("dt-accumulates") else 1
    points = [part * moved for part in PARTS[listing.program]]
    return np.array(points, dtype=object), inverse(collocation_matrix(points)).sum(axis=0)


def _runge_kutta(listing: Listing) -> Amplification:
    """Return the matrix of the four stages, from U(1) and the base of the step (cards 770-1200)."""
    first, base = _one(2, 0), _one(2, 1)
    half = Fraction(1, 2)

    def stored(before: Fractions, slope: Fractions, length: Fraction) -> Fractions:
        start = before if listing.has("stage-base") else base
        return np.asarray(start + length * slope)

    k1 = _times_z(first)
    first = stored(first, k1, half)
    k2 = _times_z(first)
    second = stored(first, k2, half)
    k3 = _times_z(second)
    third = stored(second, k3, Fraction(1))
    k4 = _times_z(third)
    result = base + (k1 + 2 * (k2 + k3) + k4) / 6
    kept = first if listing.has("base-not-restored") else result
    matrix = np.array([kept, result], dtype=object)
    if listing.has("base-not-restored"):
        return Amplification(matrix)
    # U(1) and the base are the same vector, so that their columns are added.
    return Amplification(matrix[1:].sum(axis=1, keepdims=True))


def _one(size: int, place: int) -> Fractions:
    """Return the polynomials of vector number `place` itself, shape (size, powers of z)."""
    result = np.full((size, _HIGHEST), Fraction(0), dtype=object)
    result[place, 0] = Fraction(1)
    return result


def _times_z(x: Fractions) -> Fractions:
    assert not x[..., -1].any()
    return np.roll(x, 1, axis=-1)


def _polynomial_text(coefficients: Fractions) -> str:
    terms = []
    for k, c in enumerate(coefficients):
        if c:
            power = "" if k == 0 else "z" if k == 1 else f"z^{k}"
            size = str(c) if c != 1 or not k else ""
            terms.append(f"{size} {power}".strip())
    return " + ".join(terms) or "0"


def boundary(matrix: Amplification, direction: complex) -> tuple[float, float]:
    """Return the distance along a direction up to which perturbations do not grow, and a slope.

    The direction is -1 or 1j. The distance is 0 if perturbations grow from the origin on. The slope
    is that of the spectral radius just beyond the distance.
    """

    def grows(distance: float) -> bool:
        return float(matrix.radius(np.array(distance * direction))) > 1.0 + _NOTHING

    low = NEAREST
    if grows(low):
        return 0.0, 1.0
    while not grows(low + NEAREST):
        low += NEAREST
    high = low + NEAREST
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    beyond = high * (1.0 + 1e-6)
    rise = float(matrix.radius(np.array(beyond * direction))) - 1.0
    return high, rise / (beyond - high)
