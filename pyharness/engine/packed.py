"""The array by which a kernel of a prepared solver receives a scene."""

import numpy as np

from pyharness.engine.problem import normalized, remainders
from pyharness.engine.recorded import kernel_tape, system
from pyharness.model.codes import Methods, Places
from pyharness.model.constant_body import with_constant_body
from pyharness.model.principal import PrincipalScene
from pyharness.model.scene import Scene
from pyharness.model.tape import Tape
from pyharness.model.trajectory import Array


def packed_scene(scene: Scene, code: int, tolerance: float, effort: float) -> Array:
    """Return a scene and its method's settings as one array, in the order of `Places`."""
    packed = _settings(code, scene.step_size, tolerance, effort)
    if code == Methods.TAPE:
        return np.concatenate([packed, kernel_tape(system(with_constant_body(scene)))])
    coefficients, constant, rate, sines, cosines = normalized(scene)
    packed[Places.N_SINES] = sines.shape[1]
    packed[Places.N_COSINES] = cosines.shape[1]
    packed[Places.COEFFICIENTS : Places.CONSTANT] = coefficients
    packed[Places.CONSTANT : Places.RATE] = constant
    packed[Places.RATE : Places.EFFORT] = rate
    packed[Places.COEFFICIENTS_LOW : Places.MOMENTS] = remainders(scene)
    packed[Places.MOMENTS : Places.MOMENTS_LOW] = scene.moments or (1.0, 1.0, 1.0)
    packed[Places.MOMENTS_LOW : Places.ROUNDED] = scene.moments_low
    packed[Places.ROUNDED] = isinstance(scene, PrincipalScene)
    return np.concatenate([packed, sines.T.ravel(), cosines.T.ravel()])


def packed_tape(tape: Tape, step_size: float, tolerance: float, effort: float) -> Array:
    """Return equations of motion and settings as one array."""
    return np.concatenate(
        [_settings(Methods.TAPE, step_size, tolerance, effort), kernel_tape(tape)]
    )


def _settings(code: int, step_size: float, tolerance: float, effort: float) -> Array:
    packed = np.zeros(Places.WAVES)
    packed[Places.METHOD] = code
    packed[Places.TOLERANCE] = tolerance
    packed[Places.STEP] = step_size
    packed[Places.EFFORT] = effort
    return packed
