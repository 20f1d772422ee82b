"""Angular velocities from 1e-300 to 1e300 rad/s, time scaled to match."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness.compare.candidates import End, not_finite
from pyharness.compare.checks import Check, may_hold
from pyharness.methods.registry import FIXED_STEP, SCIPY_METHODS
from pyharness.model.errors import InputError
from pyharness.model.same_motion import scaled
from pyharness.model.scene import Scene, TorqueLaw
from pyharness.stress.hold import (
    ALL,
    describe_programs,
    hold,
    in_steps,
    run_method,
    truth_of,
)
from pyharness.stress.run import Outcome, Trial, replay
from pyharness.theory.conditioning import conditioning

_TIME = 15.0  # s
_FREE = Scene("scales", (0.5, 1.0, -0.7), moments=(40.0, 30.0, 20.0))
_DRIVEN = replace(
    _FREE, torque=TorqueLaw((10.0, -20.0, 15.0), (0.0, 0.0, 1.0), (((3.0, 0.0, 1.0), 4.0),))
)
_TENS = (-300, -250, -200, -160, -150, -100, -50, 0, 50, 100, 150, 200, 300)
_TWOS = (-996, -500, -100, 100, 498, 996)
# Squares and cubes of the scale have to be numbers too.
_DRIVEN_TWOS = (-320, -100, 100, 320)


def circumstances() -> Iterator[tuple[str, Scene, float]]:
    """Return name, scene and time of each input."""
    scene = in_steps(_FREE, _TIME)
    for power in _TENS:
        factor = float(f"1e{power}")
        yield f"1e{power}", replace(scaled(scene, factor), name=f"1e{power}"), _TIME / factor
    for power in _TWOS:
        factor = math.ldexp(1.0, power)
        yield f"2^{power}", replace(scaled(scene, factor), name=f"2^{power}"), _TIME / factor


def _bit_for_bit(only: Sequence[str]) -> Iterator[Outcome]:
    """Hold our methods to the same digits where a power of two scales the motion."""
    for kind, scene, powers in (
        ("same", in_steps(_FREE, _TIME), _TWOS),
        ("same-driven", in_steps(_DRIVEN, 3.0), _DRIVEN_TWOS),
    ):
        time = scene.step_size * scene.steps
        for name in ALL:
            if name in SCIPY_METHODS or not may_hold(f"scales/{name}", only):
                continue
            if name == "closed-form" and kind != "same":
                continue
            setting = None if name in FIXED_STEP else 1e-6
            plain = _tried(name, scene, time, setting)
            for power in powers:
                id = f"scales/{name}/{kind}-2^{power}"
                if not may_hold(id, only):
                    continue
                factor = math.ldexp(1.0, power)
                other = scaled(scene, factor)
                run = _tried(name, other, time / factor, setting)
                with np.errstate(invalid="ignore"):
                    wrong = float(np.abs(run.omega / factor - plain.omega).max())
                passed = run.ended == plain.ended == "complete" and wrong == 0.0
                note = "" if run.ended == "complete" else run.ended
                yield Outcome(Check(id, passed, wrong, 0.0, replay(id), note), other)


def _beyond(only: Sequence[str]) -> Iterator[Outcome]:
    """Hold every method to say so where omega leaves the range of numbers."""
    law = TorqueLaw((1e10, 2e10, -1e10))
    # Of a sphere, which no coupling makes turn ever faster on the way.
    scene = Scene("beyond", (0.0, 0.0, 0.0), moments=(2.0, 2.0, 2.0), torque=law, step_size=1e298)
    for name in ALL:
        id = f"scales/{name}/beyond"
        if not may_hold(id, only):
            continue
        run = _tried(name, scene, 1e300, None if name in FIXED_STEP else 1e-6)
        silent = run.ended == "complete"
        note = "a silent wrong number" if silent else run.ended
        yield Outcome(Check(id, not silent, float(silent), 0.0, replay(id), note), scene)


def _tried(name: str, scene: Scene, time: float, tolerance: float | None) -> End:
    try:
        return run_method(name, scene, time, tolerance)
    except InputError as refusal:
        return not_finite(f"refused: {refusal}")


def _run(only: Sequence[str]) -> Iterator[Outcome]:
    # The flow does to a scaled motion what it does to the motion.
    flow = conditioning(_FREE, _TIME)
    for name, scene, time in circumstances():
        size = max(map(abs, scene.omega)) / max(map(abs, _FREE.omega))
        truth = partial(truth_of, flow=replace(flow, largest=flow.largest * size))
        yield from hold("scales", name, scene, time, only, ALL, truth)
        yield from describe_programs("scales", name, scene, only)
    yield from _bit_for_bit(only)
    yield from _beyond(only)


TRIAL = Trial(
    "scales",
    "omega from 1e-300 to 1e300 rad/s, time scaled to match",
    "as of the separatrix, relative to omega; ours scaled by a power of two: the same bits. "
    "Where omega leaves the range of numbers: a status that says so.",
    _run,
)
