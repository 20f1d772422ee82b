"""Spin about the middle axis, disturbed by ever less and by nothing, over several flips."""

import math
from collections.abc import Iterator

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.hold import ALL, describe_programs, hold, in_steps, run_method
from pyharness.checks.stress import Trial, named
from pyharness.checks.tolerances import MIDDLING
from pyharness.methods.registry import FIXED_STEP
from pyharness.model.scene import Scene

# A = C = 1/2 hold in binary64: a disturbance that is the same about axes 1 and 3 lies on the
# separatrix, and the body turns over once and never again.
_MOMENTS = (6.0, 5.0, 2.0)
_A, _B = 0.5, 0.8
_DISTURBANCES = tuple(10.0**-k for k in range(1, 16))
_FLIPS = 5
_STAYS = 50.0  # s


def quarter(disturbance: float) -> float:
    """Return the time from a start (d, 1, 0) until axis 2 has no part in the spin (s)."""
    # K(k) over the frequency, by the arithmetic-geometric mean.
    mean, other = math.sqrt(_A * _A + _A * _B * disturbance**2), math.sqrt(_A * _B) * disturbance
    while mean - other > 1e-9 * mean:
        mean, other = 0.5 * (mean + other), math.sqrt(mean * other)
    return 0.5 * math.pi / mean


def circumstances() -> Iterator[tuple[str, Scene, float]]:
    """Return name, scene and time of each input."""
    for d in _DISTURBANCES:
        beside, on = (d, 1.0, 0.0), (d, 1.0, d)
        flip = quarter(d)
        # To the middle of a turn, where the motion is the fastest and errors are the largest.
        for name, omega, time in (
            ("early", beside, min(14.0, 0.75 * flip)),
            ("flip", beside, flip),
            ("flips", beside, (2.0 * _FLIPS - 1.0) * flip),
            ("on", on, flip),
        ):
            scene = Scene(f"middle axis, {name}, {d:.0e}", omega, moments=_MOMENTS)
            yield f"{name}-{d:.0e}", in_steps(scene, time), time


def _undisturbed() -> Iterator[Attempt]:
    """Hold every method to the exact answer: a disturbance of 0 stays 0 for ever."""
    scene = in_steps(Scene("middle axis, undisturbed", (0.0, 1.0, 0.0), moments=_MOMENTS), _STAYS)

    def stay(name: Name) -> Check:
        method = name.subject
        run = run_method(method, scene, _STAYS, None if method in FIXED_STEP else MIDDLING)
        wrong = float(np.abs(run.omega - scene.omega).max())
        # What is exactly zero keeps zero; the spin may be rounded where units are changed.
        limit = 2.0**-52 if method == "quick" else 0.0
        stays = run.omega[0] == run.omega[2] == 0.0 and run.has_result
        note = "" if stays else "it left the axis"
        return name.judged(bool(stays and wrong <= limit), note, wrong, limit)

    for method in ALL:
        yield Attempt(named("separatrix", method, "none", scene=scene), stay)


def _attempts() -> Iterator[Attempt]:
    for circumstance, scene, time in circumstances():
        name = named("separatrix", "", circumstance, scene=scene)
        yield from hold(name, time)
        if not circumstance.startswith("early"):
            yield from describe_programs(name)
    yield from _undisturbed()


TRIAL = Trial(
    "separatrix",
    "spin about the middle axis, disturbed by 1e-1 to 1e-15 and by 0, over several flips",
    "closed form: 1e-14 and what the rounding of A, B, C changes. Others: tolerance, or order "
    "times steps, and rounding, amplified by the flow; where that leaves less than two digits, "
    "energy and momentum, which the flow does not amplify. Undisturbed: exact.",
    lambda only: _attempts(),
)
