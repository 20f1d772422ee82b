"""Trial of torques: waves (sine or cosine terms) too fast for the step, huge and tiny torques.

In resonance a wave has the frequency of precession.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.compare.candidates import (
    Candidate,
    method_candidate,
    prepared_candidate,
    unstopped,
)
from pyharness.checks.hold import (
    apart,
    check_methods,
    describe_programs,
    refusable,
    scene_of,
    truth_of,
)
from pyharness.checks.judge import AMPLIFIED, Truth, by_end, judge
from pyharness.checks.stress import LISTINGS, Trial, named
from pyharness.checks.theory import brouwer
from pyharness.checks.theory.conditioning import ROUNDING, Conditioning, conditioning
from pyharness.checks.tolerances import finest_and_middling
from pyharness.engine.plan.registry import FIXED_STEP
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw
from pyharness.truth.axial_top import axial_top
from pyharness.truth.reference import reference

_PREPARED = {"prepared-auto": "auto", "quick": "quick"}
_OURS = ("taylor", "gauss-2", "gauss-4", "gauss-8", "auto")
_ALL = (*_OURS, *_PREPARED, "dop853", "lsoda", "rk45", "radau")
# Methods that can integrate over a million radians of a wave within seconds.
_LONG = ("taylor", "auto", *_PREPARED)

_BODY = (40.0, 30.0, 20.0)
_SYMMETRIC = (40.0, 40.0, 20.0)
_START = (0.3, 1.0, 2.0)


@dataclass(frozen=True, eq=False)
class Circumstance:
    """A scene, its end time (s), and the methods to check."""

    scene: Scene
    time: float
    truth: Callable[[Scene, float], Truth] = truth_of
    methods: tuple[str, ...] = _ALL
    programs: bool = False


def axial(scene: Scene, time: float) -> Truth:
    """Return the true omega at `time` (s) of a symmetric body with a torque along its axis."""
    flow = conditioning(scene, time)
    waves = scene.law.sines + scene.law.cosines
    # A wave's phase has a rounding error in each of n evaluations, at least one in a period.
    # `conditioning` adds all n; because they are random, 4 sqrt(n) suffice (Hoeffding 1963).
    periods = max(frequency * time for _, frequency in waves) / (2.0 * math.pi)
    chance = min(1.0, 4.0 / math.sqrt(periods))
    omega = np.array([[float(w) for w in axial_top(scene, [time])[0]]])
    flow = replace(flow, rounding=flow.rounding * chance + 8.0 * ROUNDING * flow.amplification)
    return Truth(np.array([time]), omega, ROUNDING * flow.largest, flow)


def averaged(scene: Scene, time: float) -> Truth:
    """Return the true omega at `time` (s) without waves, with a bound on the waves' effect."""
    moments = np.array(scene.moments)
    waves = scene.law.sines + scene.law.cosines
    moved = sum(float((2.0 * np.abs(a) / moments).max()) / f for a, f in waves)
    free = truth_of(replace(scene, torque=replace(scene.law, sines=(), cosines=())), time)
    return replace(free, error=free.error + moved * free.flow.amplification)


def summed(scene: Scene, time: float) -> Truth:
    """Return the true omega of a sphere at `time` (s), with a bound on a method's rounding."""
    # Methods compute the phase of a wave in double-double, and round only the final sum.
    known = reference(scene, [time])
    largest = float(np.abs([known.omega[-1], scene.omega]).max())
    rounding = 16.0 * ROUNDING
    flow = Conditioning(1.0, rounding, ROUNDING, rounding, largest)
    return Truth(known.time, known.omega, known.error, flow)


def _wave(frequency: float) -> Circumstance:
    size = 10.0 * frequency
    sine, cosine = ((4.0 * size, 0.0, 2.0 * size), frequency), ((0.0, 3.0 * size, 0.0), frequency)
    law = TorqueLaw(sines=[sine], cosines=[cosine])
    return Circumstance(Scene("wave", _START, moments=_BODY, torque=law), 500.0 / frequency)


def _spun(frequency: float, time: float, programs: bool) -> Circumstance:
    sine, cosine = (((0.0, 0.0, factor * frequency), frequency) for factor in (3.0, 2.0))
    law = TorqueLaw(sines=[sine], cosines=[cosine])
    scene = Scene("axial wave", _START, moments=_SYMMETRIC, torque=law, steps=100)
    return Circumstance(scene, time, axial, _LONG, programs)


def _huge(size: float, start: Triple = _START) -> Circumstance:
    law = TorqueLaw((size, 0.7 * size, -0.5 * size))
    scene = Scene("huge torque", start, moments=_BODY, torque=law, steps=6)
    return Circumstance(scene, math.sqrt(4e3 / size), programs=size == 1e6)


def _tiny(size: float) -> Circumstance:
    law = TorqueLaw((size, -size, size), sines=(((size, size, 0.0), 3.0),))
    scene = Scene("tiny torque", _START, moments=_BODY, torque=law, steps=500)
    return Circumstance(scene, 5.0, programs=size == 1e-12)


def _resonant(moments: Triple) -> Circumstance:
    """Return a scene whose torque rotates with the precession of the top of Case 2."""
    law = TorqueLaw(sines=(((0.0, -40.0, 0.0), 5.0),), cosines=(((40.0, 0.0, 0.0), 5.0),))
    scene = Scene("resonance", (0.0, 1.0, 10.0), moments=moments, torque=law, steps=2000)
    return Circumstance(scene, 20.0, programs=True)


def _no_digits(frequency: float, size: float, sphere: bool) -> Circumstance:
    law = TorqueLaw(sines=(((size, 0.0, -size), frequency),))
    moments = (40.0, 40.0, 40.0) if sphere else _BODY
    scene = Scene("angle without digits", _START, moments=moments, torque=law)
    methods = ("closed-form", "auto", "prepared-auto") if sphere else _LONG
    return Circumstance(scene, 0.7, summed if sphere else averaged, methods)


CIRCUMSTANCES = {
    "fast-1e4": _wave(1e4),
    "fast-1e6": _wave(1e6),
    "axial-1e4": _spun(1e4, 1.0, programs=True),
    "axial-1e6": _spun(1e6, 1.0, programs=True),
    "axial-1e8": _spun(1e8, 0.02, programs=False),
    "no-digits-1e16": _no_digits(1e16, 2e17, sphere=True),
    "no-digits-1e22": _no_digits(1e22, 2e23, sphere=True),
    "averaged-1e16": _no_digits(1e16, 10.0, sphere=False),
    **{f"huge-{size:.0e}": _huge(size) for size in (1e6, 1e9, 1e12)},
    # Omega grows to 1e8 times its initial value without diverging.
    "huge-from-rest": _huge(1e4, (1e-6, 0.0, 0.0)),
    **{f"tiny-{size:.0e}": _tiny(size) for size in (1e-12, 1e-100, 1e-300, 5e-324)},
    "resonant": _resonant(_SYMMETRIC),
    "resonant-nearly": _resonant((40.0, 40.0 * (1.0 + 1e-7), 20.0)),
    "resonant-off": _resonant((41.0, 39.0, 20.0)),
}


POLICY = replace(AMPLIFIED, may_refuse=refusable)


def _attempts() -> Iterator[Attempt]:
    for circumstance, each in CIRCUMSTANCES.items():
        name = named("torque", "", circumstance, scene=each.scene)
        yield from check_methods(name, each.time, each.methods, each.truth, _tolerances, _judged)
        if each.programs and each.truth is axial:
            yield from _describe_axial(name)
        elif each.programs:
            yield from describe_programs(name)


def _tolerances(name: str, scene: Scene, time: float) -> list[float]:
    return finest_and_middling(_PREPARED.get(name, name), scene, time)


def _judged(truth: Truth, tolerance: float | None, name: Name) -> Iterator[Check]:
    assert tolerance is not None
    method = name.subject
    kind = prepared_candidate if method in _PREPARED else method_candidate
    candidate = kind(_PREPARED.get(method, method), tolerance)
    tried = by_end(method, candidate, tolerance, scene_of(name), truth.end)
    yield judge(name, tried, truth, POLICY)


def _describe_axial(name: Name) -> Iterator[Attempt]:
    """Yield deferred reports of errors with fixed steps of at least 100 rad of a wave's phase."""
    scene = scene_of(name)
    truth = cache(lambda: brouwer.floats(axial_top(scene, scene.times())))

    def describe(candidate: Candidate, name: Name) -> Check:
        omega = candidate.rows(scene).omega
        error = apart(omega, truth()) / float(np.abs(truth()).max())
        note = "" if len(omega) >= scene.steps else f"ended after {len(omega)} steps"
        return name.described(error, note)

    for listing in LISTINGS:
        own = replace(name, subject=listing.program, setting=listing.label)
        yield Attempt(own, partial(describe, unstopped(listing)))
    for method in FIXED_STEP:
        own = replace(name, subject=method, setting="own-steps")
        yield Attempt(own, partial(describe, method_candidate(method, 1.0)))


TRIAL = Trial(
    "torque",
    "torque waves of 1e4 rad/s and more, torques from 5e-324 to 1e12 N m, resonance",
    "The tolerance and rounding errors, amplified by the motion. The rounding error of a torque "
    "wave grows with its phase.",
    lambda only: _attempts(),
)
