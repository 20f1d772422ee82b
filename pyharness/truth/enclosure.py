"""Proved enclosures: balls (intervals with middle and radius) that contain the solution.

Torque-free motion is enclosed in closed form (`enclosure_free`), motion under torques of time alone
by Taylor steps in integers (`certificate`), other motion by Taylor steps in balls
(`enclosure_steps`). All but `certificate` need python-flint.
"""

from collections.abc import Sequence
from importlib.util import find_spec

from pyharness.model.constant_body import with_constant_body
from pyharness.model.errors import InputError
from pyharness.model.inertia_function import InertiaFunction
from pyharness.model.progress import Progress, no_progress
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.values import integer
from pyharness.truth.certificate import has_certificate, prove
from pyharness.truth.enclosed import Enclosure, with_energy
from pyharness.truth.reference import check_order

MOST_DIGITS = 1000


def can_enclose(scene: Scene) -> bool:
    """Return whether the installed libraries suffice to enclose a scene."""
    return _has_flint() or (has_certificate(scene) and scene.attitude is None)


def enclose(
    scene: Scene,
    times: Sequence[float],
    # A radius of omega is at most 10**-digits times the larger of 1 rad/s and the largest component
    # of omega (in closed form, of initial omega).
    digits: int = 30,
    *,
    velocity: bool = False,  # add the translational velocity (m/s)
    transition: bool = False,  # add the state-transition matrix
    effort: float = 1.0,  # factor on the work limit
    progress: Progress = no_progress,
) -> Enclosure:
    """Return balls that contain a scene's solution at `times` (s), in order away from 0.

    Raise InputError if no proof is found.
    """
    checked_scene(scene, any_axes=True, any_torque=True, any_state=True, changing=True)
    if not 1 <= integer("digits", digits) <= MOST_DIGITS:
        raise InputError(f"digits: {digits}; allowed: 1 to {MOST_DIGITS}")
    times = [float(t) for t in times]
    check_order(times, "prove")
    if scene.changing is not None:
        scene.changing.check(times)
        if isinstance(scene.changing, InertiaFunction):
            scene = with_constant_body(scene)
    free = scene.torque.is_zero and _is_bounded(scene) and not (velocity or transition)
    if free and _has_flint():
        found = _in_closed_form(scene, times, digits)
    elif has_certificate(scene) and scene.attitude is None and not (velocity or transition):
        found = prove(scene, times, digits, effort, progress).enclosure
    elif _has_flint():
        from pyharness.truth.enclosure_steps import enclose_steps

        found = enclose_steps(scene, times, digits, velocity, transition, effort, progress)
    else:
        raise InputError(
            "prove: this scene needs python-flint; install it with 'pip install python-flint'"
        )
    return with_energy(scene, found)


def _in_closed_form(scene: Scene, times: Sequence[float], digits: int) -> Enclosure:
    from pyharness.truth.balls import balls
    from pyharness.truth.enclosure_free import enclose_free

    turns = scene.attitude is not None
    rows = enclose_free(scene, times, digits, turns)
    omega, how = tuple(balls(row[:3]) for row in rows), "elliptic functions in ball arithmetic"
    attitude = tuple(balls(row[3:]) for row in rows) if turns else None
    return Enclosure(tuple(times), omega, how, attitude=attitude)


def _is_bounded(scene: Scene) -> bool:
    """Return whether torque-free motion is bounded, and has a closed form with its attitude."""
    if scene.coefficients is not None:
        signs = {(a > 0.0) - (a < 0.0) for a in scene.coefficients}
        return scene.attitude is None and (signs == {0} or signs >= {1, -1})
    return scene.moments is not None


def _has_flint() -> bool:
    return find_spec("flint") is not None
