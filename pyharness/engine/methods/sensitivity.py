"""Sensitivity of a solution to rounding errors."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.engine.methods.taylor import taylor
from pyharness.engine.problem.rescaled import rescaling_factor, scaled
from pyharness.engine.system.kernel_input import closed_form, estimate_or_none, normalized
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, extension
from pyharness.model.principal import PrincipalScene
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import ROUNDING, WITH_ALL_ROWS

# A result is sensitive if the unit roundoff times the error amplification exceeds this fraction of
# the tolerance. The computed amplification may be too small by a factor of three, because of the
# norm and of the number of perturbations.
_SHARE = 0.3
# Relative error of a closed form (checked by tests/engine/test_closed_form.py). Up to the error
# amplification _NEGLIGIBLE_TO, errors of double-double arithmetic, and so of the phase, are
# negligible.
_CLOSED_FORM_ERROR = 16.0 * ROUNDING
_NEGLIGIBLE_TO = 2.0**44
# Tolerance, and work limit (a twentieth of a second), of a Taylor series that supplies only the
# error amplification.
_COARSE = 1e-3
_LITTLE_WORK = 5e-3


def is_sensitive(growth: float | None, tolerance: float, noise: float = 0.0) -> bool:
    """Return whether amplified rounding errors exceed 0.3 times the tolerance.

    `growth` is the error amplification, and `noise` the result of `torque_noise`.
    """
    return growth is not None and ROUNDING * growth * (1.0 + noise) > _SHARE * tolerance


def torque_noise(
    scene: Scene, omega0: Triple, t_end: float, steps: float = math.inf, scale: float | None = None
) -> float:
    """Return the rounding error of nearly cancelling torque terms, in rounding errors of omega.

    `scale` is the largest |omega| (rad/s).
    """
    if isinstance(scene.torque, StateTorque) or not (scene.law.sines or scene.law.cosines):
        return 0.0
    # For a negative scale, the kernel takes the larger of -scale and the omega due to the torque.
    if scale is None:
        scale = -max(map(abs, omega0))
    return float(
        extension().torque_noise_ratio(*normalized(scene)[1:], t_end, min(steps, 1e300), scale)
    )


def growth_of_rounding(scene: Scene, growth: float | None) -> float | None:
    """Return a closed form's amplification of rounding errors, from the error amplification."""
    if growth is None or growth >= _NEGLIGIBLE_TO or isinstance(scene, PrincipalScene):
        return growth
    return 1.0


def calm_until(scene: Scene) -> float:
    """Return a time (s) until which a closed form without torque is certainly not sensitive."""
    if scene.moments is None or isinstance(scene, PrincipalScene):
        return 0.0
    # The energy bounds |omega|, and so the Jacobian, whose norm is the rate of perturbations.
    largest = math.hypot(*scene.omega) * math.sqrt(max(scene.moments) / min(scene.moments))
    rate = math.sqrt(2.0) * max(map(abs, scene.euler_coefficients)) * largest
    return math.log(_NEGLIGIBLE_TO) / rate if rate > 0.0 else math.inf


def is_calm(scene: Scene, omega0: Triple, t_end: float, tolerance: float) -> bool:
    """Return whether a closed form without torque is not sensitive at `t_end` (s)."""
    if not scene.torque.is_zero or not any(scene.euler_coefficients):
        return scene.torque.is_zero
    is_principal = isinstance(scene, PrincipalScene)
    most = _SHARE * tolerance / ROUNDING if is_principal else _NEGLIGIBLE_TO
    growth = extension().torque_free_growth(scene.euler_coefficients, omega0, t_end, most)
    return 0.0 <= float(growth) <= most


def closed_form_estimate(
    scene: Scene, omega0: Triple, t_end: float, noise: float = 0.0
) -> tuple[float | None, float | None]:
    """Return a closed form's estimated error at `t_end` (s), and error amplification.

    The error is relative (omega) or in rad (attitude).
    """
    growth: float | None = 1.0
    # A sphere does not amplify perturbations.
    if any(scene.euler_coefficients):
        growth = estimate_or_none(
            extension().torque_free_growth(scene.euler_coefficients, omega0, t_end)
        )
    amplified = growth_of_rounding(scene, growth)
    if amplified is None:
        return None, None
    error = ROUNDING * amplified * (1.0 + noise) + _CLOSED_FORM_ERROR
    if isinstance(scene, PrincipalScene) and scene.attitude is not None:
        # Rounding the initial omega about principal axes causes an angle that grows with time.
        error += ROUNDING * max(map(abs, omega0)) * abs(t_end)
    return error, growth


def motion_growth(scene: Scene, t_end: float) -> float | None:
    """Return the error amplification until `t_end` (s), or None if unknown."""
    if isinstance(scene.torque, StateTorque):
        with suppress(InputError):
            return taylor(scene, [t_end], _COARSE, _LITTLE_WORK).growth
        return None
    if closed_form(scene):
        _, growth = closed_form_estimate(scene, scene.omega, t_end)
        if growth is not None:
            return growth
    factor = rescaling_factor(scene, t_end)
    near_one = scaled(replace(scene, step_size=1.0, steps=1), factor)
    work = np.array([_LITTLE_WORK, 0.0, -1.0, -1.0, 0.0])
    _, n_rows, *_ = extension().taylor_rows(
        *normalized(near_one), near_one.omega, [t_end / factor], _COARSE, effort=work
    )
    return estimate_or_none(work[3]) if n_rows else None


def judge_ending(
    scene: Scene, kind: str, tolerance: float, ending: Any
) -> tuple[str, float | None, float | None]:
    """Return the status, error and error amplification of a prepared solver's last call."""
    number, steps, of_kernel, grown, _, omega0, t_end = ending
    status = ENDS[number]
    if status not in WITH_ALL_ROWS:
        return status, None, None
    error, growth = estimate_or_none(of_kernel), estimate_or_none(grown)
    if kind == "closed" and not steps:
        noise = torque_noise(scene, omega0, t_end)
        error, growth = closed_form_estimate(scene, omega0, t_end, noise)
        amplified = growth_of_rounding(scene, growth)
    elif kind == "gauss":
        growth = amplified = motion_growth(replace(scene, omega=omega0), t_end)
        noise = torque_noise(scene, omega0, t_end, abs(t_end) / scene.step_size)
    else:
        return status, error, growth
    return "sensitive" if is_sensitive(amplified, tolerance, noise) else status, error, growth
