"""Sensitivity of a motion to rounding: the error amplification, and the error that it implies."""

import math
from dataclasses import replace

import numpy as np

from pyharness.methods.problem import closed_form, known, normalized
from pyharness.model.extension import extension
from pyharness.model.principal import PrincipalScene
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import ROUNDING
from pyharness.scenes.rescaled import rescaling_factor, scaled

# A result is sensitive if the unit roundoff times the error amplification exceeds this fraction of
# the tolerance. The fraction leaves a factor of three for the norm and for the number of
# perturbations that were propagated.
_SHARE = 0.3
# Relative error of a closed form in addition to an amplified rounding error: the bound that
# `tests/methods/test_closed_form.py` checks.
_CLOSED_FORM_ERROR = 16.0 * ROUNDING
# The Taylor series supplies only the error amplification. Therefore it needs few digits, and a
# twentieth of a second at most.
_COARSE = 1e-3
_LITTLE_WORK = 5e-3


def is_sensitive(growth: float | None, tolerance: float, noise: float = 0.0) -> bool:
    """Return whether amplified rounding errors are too large for the relative tolerance.

    This is the case if the unit roundoff times `growth`, the error amplification, exceeds a
    fraction of the tolerance. `noise` increases the product: it is the rounding error of the torque
    over the rounding error of omega. If `growth` is None, the result is False.
    """
    return growth is not None and ROUNDING * growth * (1.0 + noise) > _SHARE * tolerance


def torque_noise(
    scene: Scene,
    omega0: Triple,
    t_end: float,
    steps: float = math.inf,
    scale: float | None = None,
) -> float:
    """Return the rounding error of torques that nearly cancel, over the rounding error of omega.

    It is estimated by the sum of the omegas that the terms of the torque law would give one by one
    until `t_end` (s), over the largest omega, `scale` (rad/s). It is 0 if the terms do not cancel.
    The terms are rounded in each of `steps` steps. If `scale` is None, the largest omega is taken
    to be the larger of the initial one, `omega0` (rad/s), and the one that the whole torque gives.
    """
    if not (scene.torque.sines or scene.torque.cosines):
        return 0.0
    if scale is None:
        scale = -max(map(abs, omega0))
    return float(
        extension().torque_noise_ratio(*normalized(scene)[1:], t_end, min(steps, 1e300), scale)
    )


def closed_form_estimate(
    scene: Scene, omega0: Triple, t_end: float, noise: float = 0.0
) -> tuple[float | None, float | None]:
    """Return the estimated error of a closed form at `t_end` (s), and its error amplification.

    The motion begins with `omega0` (rad/s). The error of omega is relative to the largest omega
    from 0 to `t_end`. For a scene with an attitude the estimate includes the error of the
    attitude's angle (rad). Both results are None if there is no closed form. `noise` is the
    rounding error of the torque over the rounding error of omega, as `torque_noise` returns it.
    """
    growth: float | None = 1.0
    # A sphere does not amplify perturbations.
    if any(scene.euler_coefficients):
        growth = known(extension().torque_free_growth(scene.euler_coefficients, omega0, t_end))
    if growth is None:
        return None, None
    error = ROUNDING * growth * (1.0 + noise) + _CLOSED_FORM_ERROR
    if isinstance(scene, PrincipalScene) and scene.attitude is not None:
        # The initial omega was rounded about principal axes. The error of the speed makes the error
        # of the angle grow with time.
        error += ROUNDING * max(map(abs, omega0)) * abs(t_end)
    return error, growth


def motion_growth(scene: Scene, t_end: float) -> float | None:
    """Return the error amplification of a scene's motion from time 0 to `t_end` (s).

    It is a property of the motion and does not depend on the method that solves the scene.

    It is the largest norm of the state-transition matrices, the derivatives of omega at the end
    with respect to omega at any earlier time. It comes from a closed form if there is one, else
    from the Taylor series. The result is None if neither of the two can determine it.
    """
    if closed_form(scene):
        _, growth = closed_form_estimate(scene, scene.omega, t_end)
        if growth is not None:
            return growth
    factor = rescaling_factor(scene, t_end)
    near_one = scaled(replace(scene, step_size=1.0, steps=1), factor)
    work = np.array([_LITTLE_WORK, 0.0, -1.0, -1.0, 0.0])
    _, n_rows, _, _ = extension().taylor_rows(
        *normalized(near_one), near_one.omega, [t_end / factor], _COARSE, effort=work
    )
    return known(work[3]) if n_rows else None
