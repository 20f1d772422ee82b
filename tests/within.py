"""The judge of accuracy: whether a result is within its tolerance of the true motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pyharness import ChangingInertia, Scene, TorqueLaw, solve
from pyharness.model.attitude import IDENTITY, angle_between
from pyharness.model.state_torque import of_law
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference

_ROUNDING = 4e-15  # of a result, for each unit of error amplification
# An estimate may be below the error, but not by more than this factor.
_ESTIMATE = 0.1


@dataclass(frozen=True, eq=False)
class Motion:
    """The true motion of a scene at some times, all with one sign and in order from 0."""

    scene: Scene
    times: list[float]
    omega: Array
    attitude: Array
    largest: float  # of all |omega| at these times and at 0
    growth: float  # error amplification, of omega and attitude


def true_motion(scene: Scene, times: Sequence[float]) -> Motion:
    """Solve a scene by the reference; without attitude, the scene begins with the axes of space."""
    turned = replace(scene, attitude=scene.attitude or IDENTITY)
    if isinstance(scene.torque, TorqueLaw) and scene.torque.in_space:
        # As a recorded torque it has a reference and an error amplification.
        turned = replace(turned, torque=of_law(scene.torque))
    exact = turned
    if scene.inertia is not None and scene.changing is None:
        # As a matrix that changes, if by nothing, it needs no principal axes.
        matrices: Any = ChangingInertia([scene.inertia, 1e-300 * np.eye(3)])
        exact = replace(turned, inertia=matrices)
    truth: Any = reference(exact, times)
    assert truth.time.tolist() == list(times)
    growth: Any = solve(turned, times, "taylor", 1e-13, attitude=True).growth
    largest = float(np.abs(np.vstack([truth.omega, scene.omega])).max())
    return Motion(scene, list(times), truth.omega, truth.attitude, largest, growth)


def check_error(
    motion: Motion,
    omega: Array,
    attitude: Array | None,
    tolerance: float,
    what: str,
    *,
    steps: float = 0.0,
    estimate: float | None = None,
) -> None:
    """Check the last rows of a result: one row, or as many as there are times."""
    rows = np.atleast_2d(omega)
    apart = np.abs(rows - motion.omega[-len(rows) :]).max()
    error = float(apart / motion.largest if apart else apart)
    if attitude is not None:
        turns = np.atleast_2d(attitude)
        assert np.abs((turns**2).sum(axis=1) - 1.0).max() < 1e-14, what
        error = max(error, float(angle_between(turns, motion.attitude[-len(turns) :]).max()))
    rounding = _ROUNDING * motion.growth * (1.0 + steps / 1000.0) ** 0.5
    assert error <= tolerance + rounding, f"{what}: {error:.2g} at {tolerance:g}"
    if estimate is not None:
        assert estimate >= _ESTIMATE * error - rounding, f"{what}: {error:.2g}, not {estimate:.2g}"
