"""Regions of linear stability, and growth along the imaginary axis, as numbers to be drawn."""

from dataclasses import dataclass

import numpy as np

from pyharness.model.listing import corrected, original, subset
from pyharness.model.trajectory import Array
from pyharness.theory.amplification import Amplification, amplification

# The part of the plane in which the boundaries lie, and how fine it is sampled.
_REAL = (-4.6, 1.4, 301)
_IMAGINARY = (-3.6, 3.6, 361)
_DISTANCES = (1e-3, 4.0, 181)
_HIDDEN = 1e-13


@dataclass(frozen=True, eq=False)
class Region:
    """One matrix over the plane and along the imaginary axis."""

    name: str  # whose it is
    # shape (imaginary, real); largest eigenvalue over the plane, of what does not merely stay
    radius: Array
    # largest eigenvalue less 1 on the imaginary axis, at the distances; 0 where rounding hides it
    growth: Array


@dataclass(frozen=True, eq=False)
class Regions:
    """All regions on the same grids."""

    # of z, over the plane
    real: Array
    imaginary: Array
    distances: Array  # of z from 0, along the imaginary axis
    regions: tuple[Region, ...]  # in the order in which they are drawn


def matrices() -> dict[str, Amplification]:
    """Return the matrices that differ, by what they belong to."""
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
    """Return the regions of all programs; that of Gauss collocation is the left half-plane."""
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
