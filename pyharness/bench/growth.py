"""Growth of the Taylor method's error with time, against the closed form, up to 1e5 s.

The error is compared with 2**-53 t |omega'|, the change of omega if the time t (s) is rounded.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pyharness.engine.prepared.solver import prepare
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene

HORIZONS = tuple(10.0 ** (k / 2.0) for k in range(11))
_ROUNDING = 2.0**-53
_STARTS = 8


@dataclass(frozen=True)
class Growth:
    """The Taylor method's error at one time, and the effect of rounding this time."""

    time: float  # s
    # Relative to the largest omega: `error` is the largest difference from the closed form, for
    # `_STARTS` initial states on one trajectory; `conditioning` is the change of omega from
    # rounding the time.
    error: float
    conditioning: float
    steps: int  # number of steps of one integration


def growth(
    scene: Scene, horizons: Sequence[float] = HORIZONS, tolerance: float = 1e-15
) -> list[Growth]:
    if closed_form(scene) is None:
        raise InputError(
            "growth: the scene has no closed form to compare with; give a scene without torque"
        )
    series = prepare(scene, "taylor", tolerance, attitude=False)
    exact = prepare(scene, "closed-form", attitude=False)
    rate = scene.right_hand_side()
    # Several initial states, because a single one might have a favourable phase.
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
