"""The steps of a motion, and the reason if it ends early."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

from pyharness.engine.steps.stepper import FINEST, Stepper
from pyharness.engine.system.recorded import is_recorded
from pyharness.engine.system.singular import SingularError
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory

_MOST_STEPS = 200_000
_STALLED = "no step is short enough for the tolerance; use another tolerance or method"


def steps_to(
    scene: Scene, attitude: bool, end: float, tolerance: float, most: int = _MOST_STEPS
) -> Iterator[tuple[float, Stepper]]:
    """Yield the beginning (s) of each step from 0 to `end` (s), and the stepper after it."""
    stepper = Stepper(scene, max(tolerance, FINEST), attitude=attitude)
    with suppress(SingularError):
        while abs(stepper.time) < abs(end) and stepper.steps < most:
            before = stepper.time
            stepper.step(end - before)
            yield before, stepper


def step_lengths(
    scene: Scene, attitude: bool, end: float, tolerance: float, bounds: Sequence[float]
) -> dict[float, float]:
    """Return each step's length (s) by its end (s), without steps that end at `bounds`."""
    cuts = frozenset(bounds)
    return {
        stepper.time: abs(stepper.time - before)
        for before, stepper in steps_to(scene, attitude, end, tolerance)
        if stepper.time not in cuts
    }


def with_reason(scene: Scene, found: Trajectory, end: float) -> Trajectory:
    """Return `found`, which ends early, with its reason.

    The ending is ``singular`` if the torque is undefined, ``overflow`` if it becomes infinite.
    """
    if not is_recorded(scene):
        return found
    try:
        stepper = Stepper(scene, attitude=scene.attitude is not None)
        while abs(stepper.time) < abs(end) and stepper.steps < _MOST_STEPS:
            stepper.step(end - stepper.time)
    except SingularError as error:
        if error.what:
            return replace(found, ended="singular", reason=str(error))
        return replace(found, ended="overflow")
    except InputError:
        return found
    # The method needs a Taylor series where the stepper needs none.
    return replace(found, ended="stalled", reason=_STALLED)
