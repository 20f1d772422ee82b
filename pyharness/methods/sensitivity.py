"""What a motion makes of rounding: growth of small differences, and the error that it implies."""

import math
from dataclasses import replace

import numpy as np

from pyharness.methods.problem import closed_form, known, normalized
from pyharness.model.extension import extension
from pyharness.model.principal import PrincipalScene
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import ROUNDING
from pyharness.scenes.rescaled import rescaling_factor, scaled

# Of the tolerance: rounding times growth beyond it is told of. One third either way is left to the
# norm of the growth, and to how many differences were followed.
_SHARE = 0.3
# Beside the growth of one rounding, relative: the bound that `tests/methods/test_closed_form.py`
# holds the closed form to.
_CLOSED_FORM_ERROR = 16.0 * ROUNDING
# The series is asked for the growth alone: few digits, and a twentieth of a second at the most.
_COARSE = 1e-3
_LITTLE_WORK = 5e-3


def is_sensitive(growth: float | None, tolerance: float, noise: float = 0.0) -> bool:
    """Whether rounding times a known growth exceeds the tolerance (relative).

    `noise` is that of the torque, in roundings of omega.
    """
    return growth is not None and ROUNDING * growth * (1.0 + noise) > _SHARE * tolerance


def torque_noise(
    scene: Scene,
    omega0: Triple,
    t_end: float,
    steps: float = math.inf,
    scale: float | None = None,
) -> float:
    """Return the rounding of torques that nearly cancel, until `t_end` (s), in roundings of omega.

    That is what the terms of the torque law give one by one over the largest omega, `scale`
    (rad/s), and 0 where they do not cancel. They are rounded in each of so many steps. Without the
    scale it is the larger of the start, `omega0` (rad/s), and of what the whole torque gives.
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
    """Return error and growth of a closed form, started with omega0 (rad/s), at `t_end` (s).

    The error of omega is relative to the largest omega until then; with an attitude the error
    includes that of the angle (rad). Both are None where there is no closed form. `noise` is that
    of the torque, in roundings of omega.
    """
    growth: float | None = 1.0
    # A sphere's perturbations stay as they are.
    if any(scene.euler_coefficients):
        growth = known(extension().torque_free_growth(scene.euler_coefficients, omega0, t_end))
    if growth is None:
        return None, None
    error = ROUNDING * growth * (1.0 + noise) + _CLOSED_FORM_ERROR
    if isinstance(scene, PrincipalScene) and scene.attitude is not None:
        # The start was rounded about principal axes: a wrong speed, and so a growing angle.
        error += ROUNDING * max(map(abs, omega0)) * abs(t_end)
    return error, growth


def motion_growth(scene: Scene, t_end: float) -> float | None:
    """Return the growth of a small difference until `t_end` (s), whatever method solves the scene.

    That is the largest norm of the derivative of omega at the end by omega at any time before:
    from a closed form where there is one, else from the Taylor series; None where neither tells.
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
