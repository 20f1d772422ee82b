"""Regions of linear stability, and growth of perturbations for imaginary z, as data for plots."""

from dataclasses import dataclass

import numpy as np

from pyharness.model.listing import corrected, original, subset
from pyharness.model.trajectory import Array
from pyharness.theory.amplification import Amplification, amplification

# The part of the plane that contains the boundaries: its limits, and the numbers of samples.
_REAL = (-4.6, 1.4, 301)
_IMAGINARY = (-3.6, 3.6, 361)
_DISTANCES = (1e-3, 4.0, 181)
_HIDDEN = 1e-13


@dataclass(frozen=True, eq=False)
class Region:
    """The spectral radius of one amplification matrix over the plane of z.

    z is the step size times an eigenvalue of the Jacobian. The imaginary axis has finer samples.
    """

    name: str  # of the programs and methods that have this matrix
    # shape (imaginary, real); spectral radius over the plane, without a result that only
    # accumulates other vectors
    radius: Array
    # spectral radius less 1 on the imaginary axis, at the distances; 0 where it is only rounding
    growth: Array


@dataclass(frozen=True, eq=False)
class Regions:
    """The stability regions of all programs on the same grids of z.

    z is the step size times an eigenvalue of the Jacobian. A region is where the spectral radius of
    the amplification matrix is at most 1.
    """

    # real and imaginary parts of z on the grid in the plane
    real: Array
    imaginary: Array
    distances: Array  # of z from 0, along the imaginary axis
    regions: tuple[Region, ...]  # in the order in which they are drawn


def matrices() -> dict[str, Amplification]:
    """Return the different amplification matrices, each under a name.

    The name lists the programs and methods that have this matrix.
    """
    return {
        "two-term and four-term, original and corrected": amplification(corrected("two-term")),
        "runge-kutta corrected, rk4": amplification(corrected("runge-kutta")),
        "runge-kutta original": amplification(original("runge-kutta")),
        "runge-kutta, stage-base alone": amplification(subset("runge-kutta", keep=["stage-base"])),
        "runge-kutta, base-not-restored alone": amplification(
            subset("runge-kutta", keep=["base-not-restored"])
        ),
    }


def regions() -> Regions:
    """Return the stability regions of all programs of the thesis, original and corrected.

    Gauss collocation is not among them: its region is the left half-plane.
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
