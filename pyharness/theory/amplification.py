"""Linear stability: the amplification matrix of a step of each program of the thesis.

A perturbation x of a steady rotation obeys a linear equation x' = J x with a constant matrix J. The
translational velocity of a body in steady rotation obeys such an equation too. Along an eigenvector
of J, a step of size h multiplies x by a matrix whose elements are polynomials in z. Here z is h
times the eigenvalue. The polynomials are derived in exact fractions from the formulas of each
program. The same polynomials are valid with the matrix hJ in place of z.

The original Runge-Kutta program propagates two vectors from step to step: the result of the step,
and U(1), at which the first stage is evaluated. Its amplification matrix therefore has two rows.
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
# If the stability boundary is nearer to z = 0 than this distance, it is regarded as being at z = 0.
NEAREST = 2.0**-4
_NOTHING = 1e-14


@dataclass(frozen=True, eq=False)
class Amplification:
    """The matrix by which one step of a program multiplies a perturbation.

    Its elements are polynomials in z, the step size times an eigenvalue of the Jacobian. The matrix
    has m rows and columns, for the m vectors that the program propagates from step to step.
    """

    # fractions, shape (m, m, 5): for element (i, j) the coefficients of 1, z ... z**4. The last row
    # belongs to the result of the step, the other rows to vectors such as U(1).
    coefficients: Fractions

    @property
    def size(self) -> int:
        """Return m, the number of vectors that the program propagates from step to step."""
        return len(self.coefficients)

    def at(self, z: Complex) -> Complex:
        """Return the amplification matrix for each element of the array `z`, shape (..., m, m).

        An element of `z` is the step size times an eigenvalue of the Jacobian, and m is `size`.
        """
        powers = np.stack([z**k for k in range(_HIGHEST)], axis=-1)
        return np.asarray(np.einsum("...k,ijk->...ij", powers, self.coefficients.astype(float)))

    def radius(self, z: Complex) -> NDArray[np.float64]:
        """Return the spectral radius of the amplification matrix for each element of `z`.

        An element of `z` is the step size times an eigenvalue of the Jacobian.
        """
        return np.asarray(np.abs(np.linalg.eigvals(self.at(z))).max(axis=-1))

    def moving(self) -> "Amplification":
        """Return the amplification matrix, if possible without the row and column of the result.

        Each row and column belongs to a vector that a step propagates. One of these vectors is the
        result of the step. Its row and column are left out if two conditions are satisfied. No
        other vector depends on the previous result, and the factor of the previous result in the
        new one does not depend on z. This factor is the eigenvalue that is lost. If a condition is
        not satisfied, the whole matrix is returned.
        """
        column = self.coefficients[:, -1]
        if self.size > 1 and not column[:-1].any() and not column[-1, 1:].any():
            return Amplification(self.coefficients[:-1, :-1])
        return self

    def of(self, matrix: Exact) -> Fractions:
        """Return the exact matrix by which a step advances a linear system x' = J x of n equations.

        `matrix` is hJ, the step size times J, with n rows and columns. It is inserted for z in the
        polynomials. The result has m n rows and columns, because each of the m vectors that a step
        propagates has n components.
        """
        power = np.eye(len(matrix), dtype=object)
        total = np.kron(self.coefficients[..., 0], power)
        for k in range(1, _HIGHEST):
            power = np.array(matrix, dtype=object) @ power
            total = total + np.kron(self.coefficients[..., k], power)
        return np.asarray(total)

    def text(self) -> str:
        """Return the elements of the amplification matrix, which are polynomials in z, as text.

        A matrix of one element is a single polynomial. Any other matrix is written row by row.
        """
        rows = [", ".join(_polynomial_text(each) for each in row) for row in self.coefficients]
        return rows[0] if self.size == 1 else "[" + "; ".join(rows) + "]"


def amplification(listing: Listing, step: int = 1) -> Amplification:
    """Return the matrix by which step number `step` of a program multiplies a perturbation.

    `listing` is the program with its active defects. `step` counts from 1, and has an effect only
    with the defect `dt-accumulates`, which moves the collocation points from step to step. The
    elements are polynomials in z, the step size times an eigenvalue of the Jacobian. In collocation
    the first estimate takes the right-hand side as constant, so that the estimate is a straight
    line. The one correction evaluates the right-hand side along that line.
    """
    if listing.program == "runge-kutta":
        return _runge_kutta(listing)
    points, weights = _quadrature(listing, step)
    nothing = Fraction(0)
    end = [Fraction(1), weights.sum(), weights @ points, nothing, nothing]
    return Amplification(np.array([[end]], dtype=object))


def weight_of_squares(listing: Listing, step: int) -> Fraction:
    """Return the integral of s**2 / h**3 over a step, by the quadrature of a collocation program.

    The exact integral is 1/3. Here h is the step size, s is the time since the beginning of the
    step, and `step` is the number of the step, from 1. `listing` is the program with its active
    defects. The program integrates the right-hand side along its first estimate of omega, a
    straight line. There the right-hand side is F + s J F + s**2 Q(F). F and J are the right-hand
    side and its Jacobian at the beginning of the step, and Q is the quadratic part of the
    right-hand side. Therefore the integral of s**2 is the weight of Q(F) in the result of the step.
    """
    points, weights = _quadrature(listing, step)
    found: Fraction = weights @ points**2
    return found


def _quadrature(listing: Listing, step: int) -> tuple[Fractions, Fractions]:
    """Return the collocation points and their quadrature weights, both in units of the step size.

    `listing` is a collocation program with its active defects, and `step` is the number of the
    step, from 1. With the defect `dt-accumulates` the points of step k are k times the points of
    the first step.
    """
    moved = step if listing.has("dt-accumulates") else 1
    points = [part * moved for part in PARTS[listing.program]]
    return np.array(points, dtype=object), inverse(collocation_matrix(points)).sum(axis=0)


def _runge_kutta(listing: Listing) -> Amplification:
    """Return the matrix by which a step of the Runge-Kutta program multiplies a perturbation.

    `listing` is the program with its active defects; its four stages are on cards 770-1200. They
    depend on two vectors: U(1), at which the first stage is evaluated, and the base of the step,
    which is the result of the previous step.
    """
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
    """Return the coefficients that represent vector number `place` at the start of a step.

    A step begins with `size` vectors, numbered from 0. Every vector that the step computes from
    them is a linear combination of them, with polynomials in z as factors. z is the step size
    times an eigenvalue of the Jacobian. For the vector itself the factor is 1, and for the others
    0. The result contains the coefficients of the factors, shape (size, number of powers of z).
    """
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
    """Return the distance of the stability boundary from z = 0 along `direction`, and a slope.

    z is the step size times an eigenvalue of the Jacobian. `matrix` is an amplification matrix.
    `direction` is -1 for the negative real axis or 1j for the imaginary axis. At smaller distances
    from z = 0 perturbations do not grow. The slope is the increase of the spectral radius per unit
    of distance just beyond the boundary. Return (0, 1) if perturbations grow at a distance of 1/16.
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
