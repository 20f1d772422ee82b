"""Regions of linear stability in the plane of z, as data for plots.

`amplification` defines z, the step size times an eigenvalue.
"""

from dataclasses import dataclass

import numpy as np

from pyharness.checks.theory.amplification import Amplification, amplification
from pyharness.model.listing import Listing, subset
from pyharness.model.trajectory import Array

# Samples of z: smallest value, largest value, and number of values. The rectangle of _REAL and
# _IMAGINARY contains all stability boundaries. _DISTANCES are distances of imaginary z from 0.
_REAL = (-4.6, 1.4, 301)
_IMAGINARY = (-3.6, 3.6, 361)
_DISTANCES = (1e-3, 4.0, 181)
_HIDDEN = 1e-13  # largest growth that is regarded as a rounding error


@dataclass(frozen=True, eq=False)
class Region:
    """The spectral radius of an amplification matrix on a grid of z and on the imaginary axis."""

    name: str  # a text that names the programs and methods that have this matrix
    # shape (imaginary, real); spectral radius on the grid, of the matrix from `moving`
    radius: Array
    # spectral radius minus 1 at `Regions.distances` on the imaginary axis; 0 if it is only rounding
    growth: Array


@dataclass(frozen=True, eq=False)
class Regions:
    """The stability regions, where the spectral radius is at most 1, on one grid of z."""

    # real and imaginary parts of z on the grid in the complex plane
    real: Array
    imaginary: Array
    distances: Array  # distances of samples of z from 0, along the imaginary axis
    regions: tuple[Region, ...]  # in the order in which they are drawn


def matrices() -> dict[str, Amplification]:
    """Return the distinct amplification matrices, by the names of programs and `rk4`.

    The Runge-Kutta program has two more, each with a single defect.
    """
    return {
        "two-term and four-term, original and corrected": amplification(
            Listing.corrected("two-term")
        ),
        "runge-kutta corrected, rk4": amplification(Listing.corrected("runge-kutta")),
        "runge-kutta original": amplification(Listing.original("runge-kutta")),
        "runge-kutta, stage-base alone": amplification(subset("runge-kutta", keep=["stage-base"])),
        "runge-kutta, base-not-restored alone": amplification(
            subset("runge-kutta", keep=["base-not-restored"])
        ),
    }


def regions() -> Regions:
    """Return the stability regions of all programs, original and corrected.

    The Runge-Kutta program also has regions with `stage-base` or `base-not-restored` alone. Gauss
    collocation is omitted; its region is the left half-plane.
    """
    real, imaginary = np.linspace(*_REAL), np.linspace(*_IMAGINARY)
    low, high, count = _DISTANCES
    distances = np.geomspace(low, high, count)
    plane = real[None, :] + 1j * imaginary[:, None]
    found = tuple(
        Region(name, matrix.moving().radius(plane), _growth(matrix, distances))
        for name, matrix in matrices().items()
    )
    return Regions(real, imaginary, distances, found)


def _growth(matrix: Amplification, distances: Array) -> Array:
    growth = matrix.radius(1j * distances) - 1.0
    return np.where(np.abs(growth) < _HIDDEN, 0.0, growth)
