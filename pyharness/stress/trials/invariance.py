"""Invariance: what must come out the same, or turned, when the problem is turned.

Where the operations of a method are those of the turned problem in another order of axes, with
other signs or other exponents, not a bit may differ; where they are not, the bound holds.
"""

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from pyharness.compare.candidates import called, solved, unstopped
from pyharness.compare.checks import Check, bounded, described, may_hold, selected
from pyharness.methods.registry import FIXED_STEP, METHODS
from pyharness.methods.solve import solve
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing, corrected, original
from pyharness.model.same_motion import scaled
from pyharness.model.scene import Scene, TorqueLaw, Triple
from pyharness.model.trajectory import Array
from pyharness.model.turned_scenes import shifted, turned
from pyharness.stress.hold import OURS
from pyharness.stress.run import Outcome, Trial, replay
from pyharness.theory import promises
from pyharness.theory.conditioning import Conditioning, conditioning

_GAUSS = ("gauss-2", "gauss-4", "gauss-8")
_ADAPTIVE = (*OURS, "quick", "auto", "dop853", "rk45", "lsoda", "radau")
_PREPARED = ("quick", "auto")
_MIDDLING = 1e-6
# At their finest these take minutes for what the others do in seconds.
_ONLY_MIDDLING = ("quick", "rk45", "radau")

_BODY = (40.0, 30.0, 20.0)
_START = (0.3, 1.1, 2.7)
_PUSHED = TorqueLaw(constant=(10.0, -20.0, 15.0))
_DRIVEN = TorqueLaw(
    (3.0, 2.0, -4.0), (0.0, 1.0, 2.0), (((20.0, 0.0, 5.0), 7.0),), (((0.0, 30.0, 0.0), 11.0),)
)


def _random_scene(seed: int) -> tuple[Scene, float]:
    """Return a body, a start and a torque that no one chose, and a time of some radians."""
    source = random.Random(seed)

    def vector(size: float) -> Triple:
        return (
            source.uniform(-size, size),
            source.uniform(-size, size),
            source.uniform(-size, size),
        )

    low, middle = source.uniform(5.0, 50.0), source.uniform(5.0, 50.0)
    moments = (source.uniform(abs(low - middle), low + middle), low, middle)
    law = TorqueLaw(vector(20.0), vector(5.0), ((vector(20.0), source.uniform(0.1, 20.0)),))
    scene = Scene(f"random-{seed}", vector(3.0), moments=moments, torque=law)
    return scene, 1.0


SCENES = {
    scene.name: (scene, time)
    for scene, time in (
        (Scene("free", _START, moments=_BODY, step_size=0.01, steps=300), 3.0),
        (Scene("pushed", _START, moments=_BODY, torque=_PUSHED, step_size=0.01, steps=200), 2.0),
        (Scene("driven", _START, moments=_BODY, torque=_DRIVEN, step_size=0.01, steps=200), 2.0),
        *map(_random_scene, range(8)),
    )
}


@dataclass(frozen=True)
class Symmetry:
    """A way to turn a problem.

    Attributes
    ----------
    turn : callable
        The turned scene.
    faster : float
        The turned motion takes the time over this.
    back : callable
        From the turned result to that of the scene itself.
    bitwise : tuple of str
        Methods and programs whose operations turn with it, so that no bit may differ.
    """

    turn: Callable[[Scene], Scene]
    faster: float
    back: Callable[[Array], Array]
    bitwise: tuple[str, ...]


def _onward(v: Triple) -> Triple:
    return v[1], v[2], v[0]


def _signs(first: float, second: float, third: float) -> Symmetry:
    def turn(v: Triple) -> Triple:
        return first * v[0], second * v[1], third * v[2]

    return Symmetry(
        lambda scene: turned(scene, turn, body=False),
        1.0,
        lambda omega: omega * [first, second, third],
        # Rounding to nearest knows no sign. Radau and LSODA difference their Jacobian in a
        # direction of their own.
        (*OURS, *_PREPARED, "dop853", "rk45", *FIXED_STEP, *PROGRAMS),
    )


def _faster(factor: float, bitwise: tuple[str, ...]) -> Symmetry:
    return Symmetry(
        lambda scene: scaled(scene, factor), factor, lambda omega: omega / factor, bitwise
    )


# Exponents alone change, and ours compare only what has the same unit. SciPy's first step is
# not so, and the implicit row scaling of LEQT1F compares powers of the step.
_POWERS_OF_TWO = (*OURS, *_PREPARED, *FIXED_STEP, "runge-kutta")
SYMMETRIES = {
    # Each axis does what the next does: products of the next two, in this order. The series of
    # Taylor and the sums of the others add over the axes, or multiply them, in a fixed order.
    "cyclic": Symmetry(
        lambda scene: turned(scene, _onward, body=True),
        1.0,
        lambda omega: np.asarray(np.roll(omega, 1)),
        ("closed-form", *_GAUSS, *FIXED_STEP, "runge-kutta"),
    ),
    "signs-12": _signs(-1.0, -1.0, 1.0),
    "signs-23": _signs(1.0, -1.0, -1.0),
    "times-2**7": _faster(2.0**7, _POWERS_OF_TWO),
    "times-2**-9": _faster(2.0**-9, _POWERS_OF_TWO),
    "times-1.7": _faster(1.7, ()),
}


def run(only: Sequence[str]) -> Iterator[Outcome]:
    """Turn each scene in each way, by each method and program."""
    for circumstance, (scene, _) in SCENES.items():
        for name in (*_ADAPTIVE, *FIXED_STEP):
            if not may_hold(f"invariance/{name}", only):
                continue
            if name == "closed-form" and circumstance != "free":
                continue
            for tolerance in tolerances(name, circumstance):
                for check in _checks(name, circumstance, tolerance, only):
                    yield Outcome(check, scene)
        for program in PROGRAMS:
            for listing in (original(program), corrected(program)):
                if may_hold(f"invariance/{program}", only):
                    for check in _program(listing, circumstance, only):
                        yield Outcome(check, scene)


def tolerances(name: str, circumstance: str) -> list[float]:
    """Return the tolerances at which a method is tried in a scene."""
    if name in FIXED_STEP:
        return [1.0]
    finest = promises.finest(name, *SCENES[circumstance]) if name in METHODS else _MIDDLING
    if name == "closed-form":
        return [finest]
    return [_MIDDLING] if name in _ONLY_MIDDLING else sorted({finest, max(finest, _MIDDLING)})


def end(scene: Scene, time: float, name: str, tolerance: float) -> Array:
    """Return omega at `time`; NaN where a prepared kernel did not get there."""
    return (called if name in _PREPARED else solved)(name, tolerance).end(scene, time).omega


def _checks(name: str, circumstance: str, tolerance: float, only: Sequence[str]) -> Iterator[Check]:
    scene, time = SCENES[circumstance]

    def asked(what: str) -> str | None:
        id = f"invariance/{name}/{what}/{circumstance}/{tolerance:.0e}"
        return id if selected(id, only) else None

    for what, symmetry in SYMMETRIES.items():
        if id := asked(what):
            yield turned_check(id, scene, time, name, tolerance, symmetry)
    if id := asked("back"):
        yield _back(id, circumstance, name, tolerance)
    if name not in FIXED_STEP and (id := asked("split")):
        yield _split(id, circumstance, name, tolerance)


def turned_check(
    id: str, scene: Scene, time: float, name: str, tolerance: float, symmetry: Symmetry
) -> Check:
    """Hold the turned problem against the problem itself."""
    try:
        plain = end(scene, time, name, tolerance)
        other = symmetry.back(end(symmetry.turn(scene), time / symmetry.faster, name, tolerance))
    except InputError as refusal:
        return Check(id, False, None, None, replay(id), f"refused: {refusal}")
    if name in symmetry.bitwise:
        return bounded(id, float(np.count_nonzero(plain != other)), 0.0, replay(id), "bits")
    flow = _flow(scene, time)
    difference = float(np.abs(plain - other).max()) / flow.largest
    if name in FIXED_STEP:
        return described(id, difference, replay(id))
    # Either may be wrong by what the method is allowed.
    return bounded(id, difference, 2.0 * flow.limit(tolerance), replay(id))


def _back(id: str, circumstance: str, name: str, tolerance: float) -> Check:
    scene, time = SCENES[circumstance]
    there = end(scene, time, name, tolerance)
    again = end(shifted(scene, there, time), -time, name, tolerance)
    flow, back = _flow(scene, time), _flow_between(circumstance, time, -time)
    difference = float(np.abs(again - scene.omega).max()) / flow.largest
    if name in FIXED_STEP:
        return described(id, difference, replay(id), "not reversible")
    # The error of the way there is an error of the start of the way back.
    limit = flow.limit(tolerance) * back.amplification + back.limit(tolerance)
    return bounded(id, difference, limit, replay(id))


def _split(id: str, circumstance: str, name: str, tolerance: float) -> Check:
    scene, time = SCENES[circumstance]
    cuts = cuts_of(time)
    omega = np.array(scene.omega)
    limit = _flow(scene, time).limit(tolerance)
    for begin, stop in zip([0.0, *cuts], [*cuts, time], strict=True):
        omega = end(shifted(scene, omega, begin), stop - begin, name, tolerance)
        piece = _flow_between(circumstance, begin, stop - begin)
        rest = 1.0 if stop == time else _flow_between(circumstance, stop, time - stop).amplification
        # What is left of the way carries on the error of each piece.
        limit += piece.limit(tolerance) * rest
    whole = end(scene, time, name, tolerance)
    difference = float(np.abs(omega - whole).max()) / _flow(scene, time).largest
    return bounded(id, difference, limit, replay(id), f"{len(cuts)} cuts")


def cuts_of(time: float) -> list[float]:
    """Return three times between 0 and `time`, always the same."""
    source = random.Random("cuts")
    return sorted(source.uniform(0.0, time) for _ in range(3))


def _flow(scene: Scene, time: float) -> Conditioning:
    return _flow_between(scene.name, 0.0, time)


@cache
def _flow_between(circumstance: str, begin: float, length: float) -> Conditioning:
    scene = SCENES[circumstance][0]
    omega = np.array(scene.omega)
    if begin > 0.0:
        omega = solve(scene, [begin], "taylor", METHODS["taylor"].finest).omega[-1]
    return conditioning(shifted(scene, omega, begin), length)


def _program(listing: Listing, circumstance: str, only: Sequence[str]) -> Iterator[Check]:
    scene, _ = SCENES[circumstance]
    for what, symmetry in SYMMETRIES.items():
        id = f"invariance/{listing.program}/{what}/{circumstance}/{listing.label}"
        if not selected(id, only):
            continue
        plain, other = (
            unstopped(listing).rows(each).omega for each in (scene, symmetry.turn(scene))
        )
        n = min(len(plain), len(other))
        other = np.array([symmetry.back(row) for row in other[:n]]).reshape(-1, 3)
        if listing.program in symmetry.bitwise:
            count = np.count_nonzero(plain[:n] != other) + 3 * abs(len(plain) - len(other))
            yield bounded(id, float(count), 0.0, replay(id), "bits")
            continue
        size = float(np.abs(plain[:n]).max(initial=0.0)) or 1.0
        yield described(id, float(np.abs(plain[:n] - other).max(initial=0.0)) / size, replay(id))


TRIAL = Trial(
    "invariance",
    "forth and back, in pieces, axes turned, two signs changed, omega scaled against time",
    "no bit where rounding can't tell the two apart: the same operations in another order of "
    "axes, with other signs, with other exponents; else the tolerance and rounding of each "
    "solution, amplified by the flow that follows it",
    run,
)
