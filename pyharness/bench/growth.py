"""How errors grow with time: the Taylor method against the closed form, up to 1e5 s.

The yardstick is the closed form's own conditioning: a relative change of time, or of any rate, by
one rounding (2**-53) turns the solution by 2**-53 t |omega'|, whatever the method.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pyharness.methods.prepared import prepare
from pyharness.methods.problem import closed_form
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene

HORIZONS = tuple(10.0 ** (k / 2.0) for k in range(11))
_ROUNDING = 2.0**-53
_STARTS = 8


@dataclass(frozen=True)
class Growth:
    """Error at one time (s)."""

    time: float
    # Largest difference of the Taylor method from the closed form over `_STARTS` starts of the same
    # motion, relative to the largest angular velocity; what one rounding of the time changes.
    error: float
    conditioning: float
    steps: int  # of the Taylor method in one run


def growth(
    scene: Scene, horizons: Sequence[float] = HORIZONS, tolerance: float = 1e-15
) -> list[Growth]:
    """Measure the growth of the error of the Taylor method at times (s) of a torque-free body.

    InputError where the scene has no closed form.
    """
    if closed_form(scene) is None:
        raise InputError("growth: the scene has no closed form to be held against")
    series = prepare(scene, "taylor", tolerance)
    exact = prepare(scene, "closed-form")
    rate = scene.right_hand_side()
    # Of one motion, so that no lucky phase decides.
    omega = np.array(scene.omega)
    starts = np.array([exact(omega, 0.37 * k).copy() for k in range(_STARTS)])
    found = []
    for time in horizons:
        errors, turns = [], []
        for start in starts:
            wanted = exact(start, time).copy()
            errors.append(np.abs(series(start, time) - wanted).max())
            turns.append(np.abs(rate(0.0, wanted.tolist())).max())
        size = float(np.abs(starts).max())
        conditioning = _ROUNDING * time * max(turns) / size
        found.append(Growth(time, float(max(errors)) / size, conditioning, series.steps))
    return found
