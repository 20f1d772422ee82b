"""Error and error amplification over all macro-steps of the method `averaged`."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from pyharness.engine.averaged_coordinates import Coordinates
from pyharness.model.array_type import Array
from pyharness.model.scene import Triple

_PHASES = 8  # angles psi, in a revolution, of initial perturbations
_MOST_ENDS = 4  # ends of macro-steps at which the error is estimated


class Done(NamedTuple):
    """A completed macro-step."""

    start: Array  # shape (4,); the point at the start
    by_omega: Array  # shape (8, 3, 3); derivatives of the start by omega, at eight psi
    error: Array  # shape (4,); error of the point at the end
    transition: Array  # shape (4, 4); derivatives of the point at the end by that at the start

    @classmethod
    def from_start(
        cls, coordinates: Coordinates, start: Array, error: Array, transition: Array
    ) -> Self:
        """Return a completed macro-step, with `by_omega` computed at its start."""
        phases = 2.0 * math.pi / _PHASES * np.arange(_PHASES)
        cosine, sine = np.cos(phases), np.sin(phases)
        omega = coordinates.omega(start[:, None], cosine, sine)[0]
        by_omega = coordinates.by_omega(np.array(omega), cosine, sine)
        return cls(start, by_omega, error, transition)


def estimates(
    coordinates: Coordinates, coefficients: Triple, done: Sequence[Done], omega: Array, angle: float
) -> tuple[float, float]:
    """Return the largest error of omega (rad/s) and amplification, at up to five ends of steps."""
    count = len(done)
    error, growth = _estimate_end(coordinates, coefficients, done, omega, angle)
    for n in range(1, count, -(-count // _MOST_ENDS)):
        start = done[n].start[:, None]
        there = np.concatenate(coordinates.omega(start, np.ones(1), np.zeros(1))[0])
        other_error, other_growth = _estimate_end(coordinates, coefficients, done[:n], there, 0.0)
        error, growth = max(error, other_error), max(growth, other_growth)
    return error, growth


def _estimate_end(
    coordinates: Coordinates, coefficients: Triple, done: Sequence[Done], omega: Array, angle: float
) -> tuple[float, float]:
    """Return the error of omega (rad/s) and the amplification at the end of the last step."""
    a, b, c = coefficients
    x, y, z = omega
    cosine, sine = np.cos([angle]), np.sin([angle])
    # Derivatives of omega at the end by the point, and by the time at which it is reached.
    back = np.empty((3, 4))
    back[:, :3] = np.linalg.inv(coordinates.by_omega(omega[:, None], cosine, sine)[0])
    back[:, 3] = -a * y * z, -b * z * x, -c * x * y
    growth, measured = 1.0, np.zeros(3)
    for each in reversed(done):
        measured = measured + back @ each.error
        back = back @ each.transition
        amplified = np.abs(back[:, :3] @ each.by_omega)
        growth = max(growth, float(amplified.sum(axis=-1).max()))
    return float(np.abs(measured).max()), growth
