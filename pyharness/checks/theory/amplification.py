"""Linear stability: the amplification matrix of a step of each program of the thesis.

A perturbation x of a steady rotation, or the velocity during it, obeys x' = J x with a constant
Jacobian J. A step of size h multiplies x by a matrix of polynomials in z, where z is h times an
eigenvalue of J, or hJ itself. The matrix has a row for each propagated vector. The original
Runge-Kutta program propagates two: the result, and U(1), at which it evaluates the first stage. A
program is linearly stable for z where the spectral radius is at most 1.

A collocation program evaluates the right-hand side along its first estimate, a straight line, and
corrects once. At time s of the step, this right-hand side is F + s J F + s**2 Q(F), with its value
F at the start of the step and its quadratic part Q.
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.checks.theory.collocation_matrices import (
    PARTS,
    Exact,
    Fractions,
    collocation_matrix,
    inverse,
)
from pyharness.model.listing import Listing, subset
from pyharness.model.trajectory import Array

Complex = NDArray[np.complexfloating[Any, Any]]

_HIGHEST = 5
# A stability boundary nearer to z = 0 counts as being at 0.
NEAREST = 2.0**-4
_NOTHING = 1e-14
# Samples of z: smallest, largest, and number. The rectangle of _REAL and _IMAGINARY contains all
# stability boundaries; _DISTANCES are along the imaginary axis.
_REAL = (-4.6, 1.4, 301)
_IMAGINARY = (-3.6, 3.6, 361)
_DISTANCES = (1e-3, 4.0, 181)
_HIDDEN = 1e-13  # largest growth that counts as rounding


@dataclass(frozen=True, eq=False)
class Amplification:
    """The matrix of polynomials in z by which a step multiplies a perturbation."""

    # Fractions, shape (m, m, 5): coefficients of 1, z, ..., z**4. The last row is for the step's
    # result; a row before it is for U(1).
    coefficients: Fractions

    @property
    def size(self) -> int:
        return len(self.coefficients)

    def evaluate(self, z: Complex) -> Complex:
        """Return the matrix at each element of `z`, shape (..., m, m)."""
        powers = np.stack([z**k for k in range(_HIGHEST)], axis=-1)
        return np.asarray(np.einsum("...k,ijk->...ij", powers, self.coefficients.astype(float)))

    def radius(self, z: Complex) -> NDArray[np.float64]:
        """Return the spectral radius at each element of `z`."""
        return np.asarray(np.abs(np.linalg.eigvals(self.evaluate(z))).max(axis=-1))

    def moving(self) -> "Amplification":
        """Return the matrix without its last row and column, if these add a constant eigenvalue."""
        column = self.coefficients[:, -1]
        if self.size > 1 and not column[:-1].any() and not column[-1, 1:].any():
            return Amplification(self.coefficients[:-1, :-1])
        return self

    def exact_matrix(self, matrix: Exact) -> Fractions:
        """Return the exact matrix, shape (m n, m n), for n equations x' = J x; `matrix` is hJ."""
        power = np.eye(len(matrix), dtype=object)
        total = np.kron(self.coefficients[..., 0], power)
        for k in range(1, _HIGHEST):
            power = np.array(matrix, dtype=object) @ power
            total = total + np.kron(self.coefficients[..., k], power)
        return np.asarray(total)

    def text(self) -> str:
        rows = [", ".join(_polynomial_text(each) for each in row) for row in self.coefficients]
        return rows[0] if self.size == 1 else "[" + "; ".join(rows) + "]"


def amplification(listing: Listing, step: int = 1) -> Amplification:
    """Return the amplification matrix of step `step` (from 1) of a program.

    Steps differ only with the defect `dt-accumulates`.
    """
    if listing.program == "runge-kutta":
        return _runge_kutta(listing)
    points, weights = _quadrature(listing, step)
    nothing = Fraction(0)
    end = [Fraction(1), weights.sum(), weights @ points, nothing, nothing]
    return Amplification(np.array([[end]], dtype=object))


def weight_of_squares(listing: Listing, step: int) -> Fraction:
    """Return the weight of h**3 Q(F) in a collocation step; exact integration has 1/3."""
    points, weights = _quadrature(listing, step)
    return Fraction(weights @ points**2)


def _quadrature(listing: Listing, step: int) -> tuple[Fractions, Fractions]:
    """Return the collocation points and their weights, as fractions of the step size."""
    moved = step if listing.has("dt-accumulates") else 1
    points = [part * moved for part in PARTS[listing.program]]
    return np.array(points, dtype=object), inverse(collocation_matrix(points)).sum(axis=0)


def _runge_kutta(listing: Listing) -> Amplification:
    """Return the matrix of the Runge-Kutta program (cards 770-1200)."""
    # A stage, shape (2, 5), has polynomials in z that multiply U(1) and the previous result, the
    # base of the step.
    first, base = np.full((2, 2, _HIGHEST), Fraction(0), dtype=object)
    first[0, 0] = base[1, 0] = Fraction(1)
    stages, slopes = [first], []
    for length in (Fraction(1, 2), Fraction(1, 2), Fraction(1)):
        slopes.append(_times_z(stages[-1]))
        start = stages[-1] if listing.has("stage-base") else base
        stages.append(start + length * slopes[-1])
    k1, k2, k3, k4 = *slopes, _times_z(stages[-1])
    result = base + (k1 + 2 * (k2 + k3) + k4) / 6
    kept = stages[1] if listing.has("base-not-restored") else result
    matrix = np.array([kept, result], dtype=object)
    if listing.has("base-not-restored"):
        return Amplification(matrix)
    # U(1) and the base are the same vector, so add their columns.
    return Amplification(matrix[1:].sum(axis=1, keepdims=True))


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
    """Return the stability boundary's distance from z = 0, and the spectral radius's slope beyond.

    `direction` is -1 or 1j.
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


@dataclass(frozen=True, eq=False)
class Region:
    """The spectral radius of a matrix on a grid of z and on the imaginary axis."""

    name: str  # programs and methods with this matrix
    # Spectral radius of the matrix from `moving` on the grid, shape (imaginary, real).
    radius: Array
    # Spectral radius minus 1 at `Regions.distances` on the imaginary axis; 0 if only rounding.
    growth: Array


@dataclass(frozen=True, eq=False)
class Regions:
    # Real and imaginary parts of z on the grid.
    real: Array
    imaginary: Array
    distances: Array  # abs(z) of samples on the imaginary axis
    regions: tuple[Region, ...]  # in the order of drawing


def regions() -> Regions:
    """Return the stability regions of programs, and of two defects of the Runge-Kutta program."""
    real, imaginary = np.linspace(*_REAL), np.linspace(*_IMAGINARY)
    distances = np.geomspace(*_DISTANCES)
    plane = real[None, :] + 1j * imaginary[:, None]
    # The listings with distinct matrices.
    listings = {
        "two-term and four-term, original and corrected": Listing.corrected("two-term"),
        "runge-kutta corrected, rk4": Listing.corrected("runge-kutta"),
        "runge-kutta original": Listing.original("runge-kutta"),
        "runge-kutta, stage-base alone": subset("runge-kutta", keep=["stage-base"]),
        "runge-kutta, base-not-restored alone": subset("runge-kutta", keep=["base-not-restored"]),
    }
    found = []
    for name, listing in listings.items():
        matrix = amplification(listing)
        growth = matrix.radius(1j * distances) - 1.0
        growth = np.where(np.abs(growth) < _HIDDEN, 0.0, growth)
        found.append(Region(name, matrix.moving().radius(plane), growth))
    return Regions(real, imaginary, distances, tuple(found))
