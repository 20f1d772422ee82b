"""The error bound of a trajectory by the method `reference`."""

import math
from dataclasses import replace

import numpy as np

from pyharness.model.attitude import IDENTITY
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.truth.bounded import ErrorBound, error_bound


def trajectory_bound(scene: Scene, found: Trajectory, effort: float = 1.0) -> ErrorBound | None:
    """Return the proved or estimated error of a trajectory by `reference`; None if not finite."""
    start = None if found.attitude is None else scene.attitude or IDENTITY
    scene = replace(scene, attitude=start)
    largest = max(*map(abs, scene.omega), float(np.abs(found.omega).max(initial=0.0)))
    claimed = math.inf if found.error is None else found.error
    bound = error_bound(
        scene,
        found.time,
        found.omega,
        claimed * (largest or 1.0),
        found.attitude,
        claimed,
        any_torque=True,
        effort=effort,
    )
    if bound.angle is not None and not math.isfinite(bound.angle):
        bound = bound._replace(angle=None, angle_basis=None)
    return bound if math.isfinite(bound.value) else None
