"""A scene packed for the kernels of prepared solvers."""

import numpy as np

from pyharness.methods.problem import normalized, normalized_in_space, remainders
from pyharness.model.codes import Places
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array


def packed_scene(scene: Scene, code: int, tolerance: float, effort: float) -> Array:
    """Return what a prepared kernel is given in every call: see `Places`."""
    coefficients, constant, rate, sines, cosines = _torque_of(scene)
    packed = np.zeros(Places.WAVES)
    packed[Places.METHOD] = code
    packed[Places.TOLERANCE] = tolerance
    packed[Places.STEP] = scene.step_size
    packed[Places.N_SINES] = sines.shape[1]
    packed[Places.N_COSINES] = cosines.shape[1]
    packed[Places.COEFFICIENTS : Places.CONSTANT] = coefficients
    packed[Places.CONSTANT : Places.RATE] = constant
    packed[Places.RATE : Places.EFFORT] = rate
    packed[Places.EFFORT] = effort
    packed[Places.COEFFICIENTS_LOW : Places.MOMENTS] = remainders(scene)
    packed[Places.MOMENTS : Places.MOMENTS_LOW] = scene.moments or (1.0, 1.0, 1.0)
    packed[Places.MOMENTS_LOW : Places.WAVES] = scene.moments_low
    return np.concatenate([packed, sines.T.ravel(), cosines.T.ravel()])


def _torque_of(scene: Scene) -> tuple[Array, ...]:
    if not scene.torque.in_space:
        return normalized(scene)
    # What the moments do is in the packed array too.
    coefficients, _, *torque = normalized_in_space(scene)
    return coefficients, *torque
