"""Torque: waves too fast for the step, huge and tiny torques, resonance with the precession."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pyharness.compare.candidates import called, solved, unstopped
from pyharness.compare.checks import Check, bounded, described, selected
from pyharness.methods.registry import FIXED_STEP
from pyharness.model.listing import PROGRAMS, corrected, original
from pyharness.model.scene import Scene, TorqueLaw, Triple
from pyharness.stress.hold import Truth, attempt, describe_programs, hold, truth_of
from pyharness.stress.run import Outcome, Trial, replay
from pyharness.theory import promises
from pyharness.theory.conditioning import ROUNDING, Conditioning, conditioning
from pyharness.truth.axial_top import axial_top
from pyharness.truth.reference import reference

_MIDDLING = 1e-6
# Prepared solvers have kernels of their own.
_PREPARED = {"prepared-auto": "auto", "quick": "quick"}
_ALL = (
    *("taylor", "gauss-2", "gauss-4", "gauss-8", "auto"),
    *_PREPARED,
    *("dop853", "lsoda", "rk45", "radau"),
)
# What follows a wave for a million radians in seconds.
_LONG = ("taylor", "auto", *_PREPARED)
_ONLY_MIDDLING = ("quick", "rk45", "radau")

_BODY = (40.0, 30.0, 20.0)
_START = (0.3, 1.0, 2.0)


@dataclass(frozen=True, eq=False)
class Circumstance:
    """A scene that is tried.

    Attributes
    ----------
    scene, time : Scene, float
        What, and until when (s).
    truth : callable
        Of both: the solution and what the flow makes of errors.
    methods : tuple of str
        Those tried; the programs are, where `programs` says so, over the scene's steps.
    """

    scene: Scene
    time: float
    truth: Callable[[Scene, float], Truth] = truth_of
    methods: tuple[str, ...] = _ALL
    programs: bool = False


def axial(scene: Scene, time: float) -> Truth:
    """Return the truth of a symmetric body whose torque acts along its axis.

    Rounding of a wave's angle, frequency times t, is a matter of chance from one evaluation to
    the next: of n of them, at least one a period, 4 sqrt(n) remain of the n that
    `conditioning` counts (Hoeffding 1963).
    """
    flow = conditioning(scene, time)
    waves = scene.torque.sines + scene.torque.cosines
    periods = max(frequency * time for _, frequency in waves) / (2.0 * math.pi)
    chance = min(1.0, 4.0 / math.sqrt(periods))
    omega = np.array([float(w) for w in axial_top(scene, [time])[0]])
    flow = replace(flow, rounding=flow.rounding * chance + 8.0 * ROUNDING * flow.amplification)
    return Truth(time, omega, ROUNDING * flow.largest, flow)


def averaged(scene: Scene, time: float) -> Truth:
    """Return the truth of a wave so fast that it can't matter: what it moves is the error."""
    moments = np.array(scene.moments)
    waves = scene.torque.sines + scene.torque.cosines
    moved = sum(float((2.0 * np.abs(a) / moments).max()) / f for a, f in waves)
    free = truth_of(replace(scene, torque=replace(scene.torque, sines=(), cosines=())), time)
    return replace(free, error=free.error + moved * free.flow.amplification)


def summed(scene: Scene, time: float) -> Truth:
    """Return the truth of a sphere, whose closed form takes the angle in two words.

    It has then no rounding of the angle: what is left are those of the terms of one sum.
    """
    known = reference(scene, [time])
    largest = float(np.abs([known.omega[-1], scene.omega]).max())
    rounding = 16.0 * ROUNDING
    flow = Conditioning(1.0, rounding, ROUNDING, rounding, largest)
    return Truth(time, known.omega[-1], known.error, flow)


def _wave(frequency: float) -> TorqueLaw:
    """Return a torque on all axes that moves omega by about a radian per second in a period."""
    size = 10.0 * frequency
    return TorqueLaw(
        sines=(((4.0 * size, 0.0, 2.0 * size), frequency),),
        cosines=(((0.0, 3.0 * size, 0.0), frequency),),
    )


def _spun(frequency: float, steps: int = 100) -> Scene:
    law = TorqueLaw(
        sines=(((0.0, 0.0, 3.0 * frequency), frequency),),
        cosines=(((0.0, 0.0, 2.0 * frequency), frequency),),
    )
    return Scene("axial wave", _START, moments=(40.0, 40.0, 20.0), torque=law, steps=steps)


def _huge(size: float, start: Triple = _START) -> Circumstance:
    """Take a constant torque, for some fifty radians of the motion that it makes."""
    law = TorqueLaw((size, 0.7 * size, -0.5 * size))
    time = math.sqrt(4e3 / size)
    scene = Scene("huge torque", start, moments=_BODY, torque=law, steps=6)
    return Circumstance(scene, time, programs=size == 1e6)


def _tiny(size: float) -> Circumstance:
    law = TorqueLaw((size, -size, size), sines=(((size, size, 0.0), 3.0),))
    scene = Scene("tiny torque", _START, moments=_BODY, torque=law, steps=500)
    return Circumstance(scene, 5.0, programs=size == 1e-12)


def _resonant(moments: tuple[float, float, float]) -> Circumstance:
    """Take a torque across the axis that turns with the precession of Case 2, 5 rad/s."""
    law = TorqueLaw(
        sines=(((0.0, -40.0, 0.0), 5.0),),
        cosines=(((40.0, 0.0, 0.0), 5.0),),
    )
    scene = Scene("resonance", (0.0, 1.0, 10.0), moments=moments, torque=law, steps=2000)
    return Circumstance(scene, 20.0, programs=True)


def _no_digits(frequency: float, size: float, sphere: bool) -> Circumstance:
    law = TorqueLaw(sines=(((size, 0.0, -size), frequency),))
    moments = (40.0, 40.0, 40.0) if sphere else _BODY
    scene = Scene("angle without digits", _START, moments=moments, torque=law)
    if sphere:
        return Circumstance(scene, 0.7, summed, ("closed-form", "auto", "prepared-auto"))
    return Circumstance(scene, 0.7, averaged, _LONG)


CIRCUMSTANCES = {
    "fast-1e4": Circumstance(Scene("wave", _START, moments=_BODY, torque=_wave(1e4)), 0.05),
    "fast-1e6": Circumstance(Scene("wave", _START, moments=_BODY, torque=_wave(1e6)), 5e-4),
    "axial-1e4": Circumstance(_spun(1e4), 1.0, axial, _LONG, programs=True),
    "axial-1e6": Circumstance(_spun(1e6), 1.0, axial, _LONG, programs=True),
    "axial-1e8": Circumstance(_spun(1e8), 0.02, axial, _LONG),
    "no-digits-1e16": _no_digits(1e16, 2e17, sphere=True),
    "no-digits-1e22": _no_digits(1e22, 2e23, sphere=True),
    "averaged-1e16": _no_digits(1e16, 10.0, sphere=False),
    **{f"huge-{size:.0e}": _huge(size) for size in (1e6, 1e9, 1e12)},
    # Growth to 1e8 times the start, by the torque alone: no blow-up.
    "huge-from-rest": _huge(1e4, (1e-6, 0.0, 0.0)),
    **{f"tiny-{size:.0e}": _tiny(size) for size in (1e-12, 1e-100, 1e-300, 5e-324)},
    "resonant": _resonant((40.0, 40.0, 20.0)),
    "resonant-nearly": _resonant((40.0, 40.0 * (1.0 + 1e-7), 20.0)),
    "resonant-off": _resonant((41.0, 39.0, 20.0)),
}


def run(only: Sequence[str]) -> Iterator[Outcome]:
    """Try every circumstance by what can take it."""
    for name, each in CIRCUMSTANCES.items():
        yield from hold(
            "torque", name, each.scene, each.time, only, each.methods, each.truth, tolerances, held
        )
        if each.programs and each.truth is axial:
            yield from _describe_axial(name, each, only)
        elif each.programs:
            yield from describe_programs("torque", name, each.scene, only)


def tolerances(name: str, scene: Scene, truth: Truth) -> list[float]:
    """Return the tolerances at which a method is tried: its finest, and one in the middle."""
    known = _PREPARED.get(name, name)
    finest = _MIDDLING if name == "quick" else promises.finest(known, scene, truth.time)
    return [_MIDDLING] if name in _ONLY_MIDDLING else sorted({finest, max(finest, _MIDDLING)})


def held(
    id: str, scene: Scene, truth: Truth, name: str, tolerance: float | None
) -> Iterator[Check]:
    """Hold one method against the truth: tolerance and rounding, amplified by the flow."""
    assert tolerance is not None
    kind = called if name in _PREPARED else solved
    candidate = kind(_PREPARED.get(name, name), tolerance)
    end = attempt(id, name, scene, truth.time, partial(candidate.end, scene, truth.time))
    if isinstance(end, Check):
        yield end
        return
    error, note = math.inf, end.ended
    if end.ended == "complete":
        error, note = float(np.abs(end.omega - truth.omega).max()) / truth.flow.largest, ""
    limit = truth.flow.limit(tolerance) + truth.error / truth.flow.largest
    yield bounded(id, error, limit, replay(id), note)


def _describe_axial(name: str, each: Circumstance, only: Sequence[str]) -> Iterator[Outcome]:
    """Say what steps a hundred radians of a wave apart make of it."""
    scene = each.scene
    runs = [
        (f"torque/{program}/{name}/{listing.label}", unstopped(listing))
        for program in PROGRAMS
        for listing in (original(program), corrected(program))
    ]
    runs += [(f"torque/{m}/{name}/own-steps", solved(m, 1.0)) for m in FIXED_STEP]
    wanted = [(id, candidate) for id, candidate in runs if selected(id, only)]
    if not wanted:
        return
    truth = np.array([[float(w) for w in row] for row in axial_top(scene, scene.times())])
    scale = float(np.abs(truth).max())
    for id, candidate in wanted:
        omega = candidate.rows(scene).omega
        n = min(len(omega), len(truth))
        error = float(np.abs(omega[:n] - truth[:n]).max(initial=0.0)) / scale
        note = "" if n == len(truth) else f"ended after {n} steps"
        yield Outcome(described(id, error, replay(id), note), scene)


TRIAL = Trial(
    "torque",
    "waves of 1e4 rad/s and more, torques of 1e12 and of 5e-324, resonance with the precession",
    "tolerance and rounding, amplified by the flow; a wave's rounding counts with its angle",
    run,
)
