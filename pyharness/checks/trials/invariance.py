"""Trial of invariance: a rotated or rescaled problem must have rotated or rescaled results.

Results must have equal bits if operations differ only in axes, signs or exponents; else they must
agree within an error bound.
"""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise

import numpy as np

from pyharness.checks.check import BITS, REFUSED, Attempt, Check, Name
from pyharness.checks.compare.candidates import unstopped
from pyharness.checks.hold import OURS, apart, run_method, scene_of
from pyharness.checks.scenes.random_scenes import random_scene
from pyharness.checks.stress import LISTINGS, Trial, named
from pyharness.checks.theory.conditioning import FLOW, Conditioning, conditioning
from pyharness.checks.tolerances import finest_and_middling
from pyharness.engine.plan.registry import FIXED_STEP, METHODS, SCIPY_METHODS
from pyharness.engine.problem.rescaled import scaled
from pyharness.engine.problem.rotated import restarted_at, rotated
from pyharness.engine.solve import finest, solve
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array

_ADAPTIVE = (*OURS, "quick", "auto", "dop853", "rk45", "lsoda", "radau")
_PREPARED = ("quick", "auto")

_BODY = (40.0, 30.0, 20.0)
_START = (0.3, 1.1, 2.7)
_PUSHED = TorqueLaw((10.0, -20.0, 15.0))
_SINE, _COSINE = ((20.0, 0.0, 5.0), 7.0), ((0.0, 30.0, 0.0), 11.0)
_DRIVEN = TorqueLaw((3.0, 2.0, -4.0), (0.0, 1.0, 2.0), [_SINE], [_COSINE])


_FREE = Scene("free", _START, moments=_BODY, step_size=0.01, steps=300)
SCENES = {
    "free": (_FREE, 3.0),
    "pushed": (replace(_FREE, name="pushed", torque=_PUSHED, steps=200), 2.0),
    "driven": (replace(_FREE, name="driven", torque=_DRIVEN, steps=200), 2.0),
    **{(name := f"random-{seed}"): (random_scene("driven", seed, name), 1.0) for seed in range(8)},
}


@dataclass(frozen=True)
class Symmetry:
    """A rotation or rescaling of a problem."""

    turn: Callable[[Scene], Scene]
    faster: float  # the time t becomes t / `faster`
    back: Callable[[Array], Array]  # the inverse, for omega
    bitwise: tuple[str, ...]  # methods that must return equal bits


def _signs(first: float, second: float, third: float) -> Symmetry:
    return Symmetry(
        lambda s: rotated(s, lambda v: (first * v[0], second * v[1], third * v[2]), body=False),
        1.0,
        lambda omega: omega * [first, second, third],
        # Rounding to nearest does not depend on the sign. Radau and LSODA are missing: the finite
        # differences of their Jacobian do not change sign.
        (*OURS, *_PREPARED, "dop853", "rk45", *FIXED_STEP, *PROGRAMS),
    )


def _faster(factor: float, *bitwise: str) -> Symmetry:
    return Symmetry(lambda s: scaled(s, factor), factor, lambda omega: omega / factor, bitwise)


# Scaling by a power of two changes no mantissa in methods that compare only quantities of the same
# unit. SciPy compares different units for its first step, LEQT1F powers of the step size.
_POWERS_OF_TWO = (*OURS, *_PREPARED, *FIXED_STEP, "runge-kutta")
SYMMETRIES = {
    # Methods that form products of the next two axes in this order; others have a fixed order.
    "cyclic": Symmetry(
        lambda scene: rotated(scene, lambda v: (v[1], v[2], v[0]), body=True),
        1.0,
        lambda omega: np.asarray(np.roll(omega, 1)),
        ("closed-form", "gauss-2", "gauss-4", "gauss-8", *FIXED_STEP, "runge-kutta"),
    ),
    "signs-12": _signs(-1.0, -1.0, 1.0),
    "signs-23": _signs(1.0, -1.0, -1.0),
    "times-2**7": _faster(2.0**7, *_POWERS_OF_TWO),
    "times-2**-9": _faster(2.0**-9, *_POWERS_OF_TWO),
    "times-1.7": _faster(1.7),
}


def _attempts() -> Iterator[Attempt]:
    for circumstance, (scene, time) in SCENES.items():
        name = named("invariance", "", "", circumstance, scene=scene)
        for method in (*_ADAPTIVE, *FIXED_STEP):
            if method == "closed-form" and circumstance != "free":
                continue
            if method in (*FIXED_STEP, "closed-form"):
                tolerances = [METHODS[method].finest]
            else:
                tolerances = finest_and_middling(method, scene, time)
            for tolerance in tolerances:
                ways: dict[str, Callable[[float, float, Name], Check]]
                ways = {what: partial(_check_rotated, each) for what, each in SYMMETRIES.items()}
                ways |= (
                    {"back": _back} if method in FIXED_STEP else {"back": _back, "split": _split}
                )
                own = replace(name, subject=method, quantity=f"{tolerance:.0e}")
                for way, make in ways.items():
                    yield Attempt(replace(own, circumstance=way), partial(make, time, tolerance))
        for listing in LISTINGS:
            own = replace(name, subject=listing.program, quantity=listing.label)
            for way, each in SYMMETRIES.items():
                yield Attempt(replace(own, circumstance=way), partial(_program, listing, each))


def _check_rotated(symmetry: Symmetry, time: float, tolerance: float, name: Name) -> Check:
    scene, method = scene_of(name), name.subject
    try:
        plain = run_method(method, scene, time, tolerance).omega
        turned, earlier = symmetry.turn(scene), time / symmetry.faster
        other = symmetry.back(run_method(method, turned, earlier, tolerance).omega)
    except InputError as refusal:
        return name.judged(False, f"{REFUSED}{refusal}")
    if method in symmetry.bitwise:
        return name.bounded(float(np.count_nonzero(plain != other)), 0.0, BITS, "bits")
    flow = _flow(scene.name, 0.0, time)
    difference = float(np.abs(plain - other).max()) / flow.largest
    if method in FIXED_STEP:
        return name.described(difference)
    # Both results may have the allowed error.
    return name.bounded(difference, 2.0 * flow.limit(tolerance), FLOW)


def _back(time: float, tolerance: float, name: Name) -> Check:
    scene, method = scene_of(name), name.subject
    there = run_method(method, scene, time, tolerance).omega
    start = restarted_at(scene, there, time)
    # SciPy may meet only a coarser tolerance in the backward run.
    coarser = tolerance
    if method in SCIPY_METHODS:
        coarser = max(tolerance, 1.1 * finest(method, start, -time))
    again = run_method(method, start, -time, coarser).omega
    flow, back = _flow(scene.name, 0.0, time), _flow(scene.name, time, -time)
    difference = float(np.abs(again - scene.omega).max()) / flow.largest
    if method in FIXED_STEP:
        return name.described(difference, "not reversible")
    # The forward run's error is an initial error of the backward run.
    limit = flow.limit(tolerance) * back.amplification + back.limit(coarser)
    return name.bounded(difference, limit, FLOW)


def _split(time: float, tolerance: float, name: Name) -> Check:
    scene, method = scene_of(name), name.subject
    # A fixed seed, for the same three cuts in every run.
    source = random.Random("cuts")
    cuts = sorted(source.uniform(0.0, time) for _ in range(3))
    omega = np.array(scene.omega)
    flow = _flow(scene.name, 0.0, time)
    limit = flow.limit(tolerance)
    for begin, stop in pairwise([0.0, *cuts, time]):
        start = restarted_at(scene, omega, begin)
        omega = run_method(method, start, stop - begin, tolerance).omega
        piece = _flow(scene.name, begin, stop - begin)
        rest = 1.0 if stop == time else _flow(scene.name, stop, time - stop).amplification
        # The rest of the motion amplifies the error of this piece.
        limit += piece.limit(tolerance) * rest
    whole = run_method(method, scene, time, tolerance).omega
    difference = float(np.abs(omega - whole).max()) / flow.largest
    return name.bounded(difference, limit, FLOW, f"{len(cuts)} cuts")


@cache
def _flow(circumstance: str, begin: float, length: float) -> Conditioning:
    scene = SCENES[circumstance][0]
    omega = np.array(scene.omega)
    if begin > 0.0:
        omega = solve(scene, [begin], "taylor", METHODS["taylor"].finest).omega[-1]
    return conditioning(restarted_at(scene, omega, begin), length)


def _program(listing: Listing, symmetry: Symmetry, name: Name) -> Check:
    scene = scene_of(name)
    plain, other = (unstopped(listing).rows(each).omega for each in (scene, symmetry.turn(scene)))
    n = min(len(plain), len(other))
    other = np.array([symmetry.back(row) for row in other]).reshape(-1, 3)
    if listing.program in symmetry.bitwise:
        count = np.count_nonzero(plain[:n] != other[:n]) + 3 * abs(len(plain) - len(other))
        return name.bounded(float(count), 0.0, BITS, "bits")
    size = float(np.abs(plain[:n]).max(initial=0.0)) or 1.0
    return name.described(apart(plain, other) / size)


TRIAL = Trial(
    "invariance",
    "motions forward and back, in four pieces, with axes permuted, signs changed, time rescaled",
    "No bit may differ where the same operations are done with other axes, signs or exponents. "
    "Elsewhere: the tolerance and rounding errors of each solution, amplified by the rest of the "
    "motion.",
    lambda only: _attempts(),
)
