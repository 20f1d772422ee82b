"""Growth of errors with time: the Taylor method against the closed form, up to 1e5 s.

The errors are compared with the conditioning of the problem. A relative change of the time t, or of
any angular rate, by one rounding (2**-53) changes the solution by 2**-53 t |omega'|. This change
does not depend on the method.
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
    """The error of the Taylor method at one time, and the change of omega if this time is rounded.

    The change depends on the motion but not on the method. It is the scale with which the error is
    compared.
    """

    time: float  # s
    # Both are relative to the largest angular velocity. `error` is the largest difference between
    # the Taylor method and the closed form, over `_STARTS` initial states of the same motion.
    # `conditioning` is the change caused by one rounding of the time.
    error: float
    conditioning: float
    steps: int  # number of steps of the Taylor method in one integration


def growth(
    scene: Scene, horizons: Sequence[float] = HORIZONS, tolerance: float = 1e-15
) -> list[Growth]:
    """Measure the error of the Taylor method at several times of a torque-free motion.

    `horizons` are the times (s). The result has a `Growth` for each of them. The error is the
    difference from the closed form. `tolerance` is the relative tolerance of the Taylor method.
    Raise InputError if the scene has no closed form.
    """
    if closed_form(scene) is None:
        raise InputError(
            "growth: the scene has no closed form to compare with; give a scene without torque"
        )
    series = prepare(scene, "taylor", tolerance)
    exact = prepare(scene, "closed-form")
    rate = scene.right_hand_side()
    # Several initial states of one motion are used, so that the result does not depend on a
    # favourable phase.
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
