"""Trial of angular velocities from 1e-300 to 1e300 rad/s, with rescaled time."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from pyharness.checks.check import BITS, REFUSED, Attempt, Check, Name
from pyharness.checks.compare.candidates import End, not_finite
from pyharness.checks.hold import ALL, check_all, check_methods, run_method, scene_of, truth_of
from pyharness.checks.judge import Truth
from pyharness.checks.scenes.extreme import ORDINARY, ORDINARY_TIME, TWOS, in_steps
from pyharness.checks.stress import Trial, named
from pyharness.checks.theory.conditioning import Conditioning, conditioning
from pyharness.checks.tolerances import MIDDLING
from pyharness.engine.plan.registry import FIXED_STEP, SCIPY_METHODS
from pyharness.engine.problem.rescaled import scaled
from pyharness.model.basis import Basis
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw

_LAW = TorqueLaw((10.0, -20.0, 15.0), (0.0, 0.0, 1.0), (((3.0, 0.0, 1.0), 4.0),))
_DRIVEN = replace(ORDINARY, torque=_LAW)
# Exponents of powers of two whose squares and cubes are in the range of binary64.
_DRIVEN_TWOS = (-320, -100, 100, 320)
_OVERFLOW = Basis(
    "derived",
    "no finite result if omega leaves the range of binary64",
    "omega of a sphere is the torque times the time over the moment (`checks/trials/scales.py`)",
)


def _bit_for_bit(method: str, kind: str, scene: Scene, powers: Sequence[int]) -> Iterator[Attempt]:
    """Yield deferred checks that scaling omega by a power of two changes no mantissa."""
    time = scene.step_size * scene.steps
    plain = cache(lambda: _tried(method, scene, time))

    def same(factor: float, name: Name) -> Check:
        first, run = plain(), _tried(method, scene_of(name), time / factor)
        with np.errstate(invalid="ignore"):
            wrong = float(np.abs(run.omega / factor - first.omega).max())
        passed = run.ended == first.ended and run.has_result and wrong == 0.0
        note = "" if run.has_result else run.ended
        return name.judged(passed, note, wrong, 0.0, BITS)

    for power in powers:
        factor = math.ldexp(1.0, power)
        name = named("scales", method, f"{kind}-2^{power}", scene=scaled(scene, factor))
        yield Attempt(name, partial(same, factor))


def _beyond(name: Name) -> Check:
    run = _tried(name.subject, scene_of(name), 1e300)
    note = "a silent wrong number" if run.has_result else run.ended
    return name.judged(not run.has_result, note, float(run.has_result), 0.0, _OVERFLOW)


def _tried(name: str, scene: Scene, time: float) -> End:
    try:
        return run_method(name, scene, time, None if name in FIXED_STEP else MIDDLING)
    except InputError as refusal:
        return not_finite(f"{REFUSED}{refusal}")


@cache
def _flow() -> Conditioning:
    return conditioning(ORDINARY, ORDINARY_TIME)


def _truth(scene: Scene, time: float) -> Truth:
    """Return a scaled motion's true omega at `time` (s), with the original error amplification."""
    size = max(map(abs, scene.omega)) / max(map(abs, ORDINARY.omega))
    return truth_of(scene, time, replace(_flow(), largest=_flow().largest * size))


def _attempts() -> Iterator[Attempt]:
    yield from check_all("scales", partial(check_methods, truth=_truth))
    free, driven = in_steps(ORDINARY, ORDINARY_TIME), in_steps(_DRIVEN, 3.0)
    for method in ALL:
        if method not in SCIPY_METHODS:
            yield from _bit_for_bit(method, "same", free, TWOS)
    for method in ALL:
        if method not in (*SCIPY_METHODS, "closed-form"):
            yield from _bit_for_bit(method, "same-driven", driven, _DRIVEN_TWOS)
    law = TorqueLaw((1e10, 2e10, -1e10))
    # A sphere, because in other bodies the coupling of the axes would change omega.
    scene = Scene("beyond", (0.0, 0.0, 0.0), moments=(2.0, 2.0, 2.0), torque=law, step_size=1e298)
    for method in ALL:
        yield Attempt(named("scales", method, "beyond", scene=scene), _beyond)


TRIAL = Trial(
    "scales",
    "omega from 1e-300 to 1e300 rad/s, with time rescaled by the inverse factor",
    "As in the trial separatrix, relative to omega. If omega is multiplied by a power of two, "
    "the methods of this package must return the same bits. If omega overflows, the status must "
    "say so.",
    lambda only: _attempts(),
)
