"""Random scenes, listings and parameters, from a seed and a number."""

import datetime
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Any

import numpy as np

from pyharness.engine.problem.rescaled import scaled
from pyharness.engine.problem.rotated import rotated
from pyharness.model.listing import PROGRAMS, Listing, flagged, names_of, switches
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw

COARSEST = 1e-3
# Defects from this flag on are drawn last, so that a seed gives the draws of earlier versions.
_FIRST_LATER = 11
_LIPSCHITZ = (500.0, 60.0, 1.0, 1e-3)
MODERATE = ("free", "constant", "wave", "mixed", "fast", "slow")
"""Kinds of moderate scenes: no torque; a constant torque; waves with a linear torque; these and
more waves at once, of elongated bodies from rest, near 100 rad/s, and near 0.001 rad/s."""
# Exponents of 10 of speed (1/s) and moments (kg m2).
_WIDE = {
    "mixed": (0.0, 0.0, -3.0, 3.0),
    "fast": (1.8, 2.0, 2.0, 3.0),
    "slow": (-3.0, -2.8, -3.0, -2.0),
}
# Longest steps (s) whose halves contain .01 and 1/60, not exact in binary.
_STEPS = (0.32, 4.0 / 15.0)


@dataclass(frozen=True)
class Draw:
    """The random inputs of a check: scene, program, and parameters of the runs."""

    scene: Scene  # in odd draws a difficult one, named by its kind in `NASTY`
    listing: Listing  # a program with random defects and readings of doubtful cards
    lipschitz: float  # constant of the stop test (1/s)
    may_stop: bool
    digits: float  # from 0 (coarsest tolerance) to 1 (a method's finest)
    backward: bool  # whether a method integrates to negative times
    stages: int  # number of stages of Gauss collocation

    @property
    def time(self) -> float:
        """The end time (s) of a method's run; negative if backward."""
        return self.scene.step_size * self.scene.steps * (-1.0 if self.backward else 1.0)

    def tolerance(self, finest: float) -> float:
        """Return the relative tolerance that `digits` selects, from 1e-3 to `finest`."""
        return float(max(finest, COARSEST * (finest / COARSEST) ** self.digits))


def weekly_seed(day: datetime.date | None = None) -> str:
    """Return the week of `day` (by default today) as a seed, as in 2026-W47."""
    year, week, _ = (day or datetime.date.today()).isocalendar()
    return f"{year}-W{week:02d}"


def draw(seed: str, number: int) -> Draw:
    """Return the random inputs of check `number`, equal in all versions of Python."""
    # Each draw has its own generator, so that it can be repeated alone.
    source = Random(f"{seed}/{number}")
    scene = _plain(source)
    if number % 2 == 1:
        name = source.choice(list(NASTY))
        scene = replace(NASTY[name](source), name=name)
    program = source.choice(PROGRAMS)
    later = [each["id"] for each in flagged() if each["flag"] >= _FIRST_LATER]
    early = [name for name in switches(program) if name not in later]
    defects = frozenset(name for name in early if source.random() < 0.5)
    readings = frozenset(x for x in names_of("reading", program) if source.random() < 0.3)
    found = Draw(
        scene=scene,
        listing=Listing(program, defects, readings),
        lipschitz=source.choice(_LIPSCHITZ),
        may_stop=source.random() < 0.5,
        digits=source.random(),
        backward=source.random() < 0.5,
        stages=source.randint(1, 8),
    )
    drawn = [name for name in later if name in switches(program) and source.random() < 0.5]
    return replace(found, listing=Listing(program, defects.union(drawn), readings))


def text_generator(seed: str) -> np.random.Generator:
    return np.random.default_rng([ord(letter) for letter in seed])


def random_scene(kind: str, seed: str | int, name: str = "") -> Scene:
    return replace(KINDS[kind](Random(seed)), name=name)


def draw_moderate(seed: str, kind: str, number: int) -> Scene:
    """Return scene `number` of a seed, of a kind in `MODERATE`.

    The body rotates by several radians.
    """
    source = Random(f"{seed}/moderate/{kind}/{number}")
    wide = kind in _WIDE
    slowest, fastest, *sizes = _WIDE.get(kind, (0.0, 0.0, -1.0, 1.0))
    size = 10.0 ** source.uniform(*sizes)
    low = source.uniform(1.0, 2.0)
    middle = low * (10.0 ** source.uniform(2.5, 3.0) if wide else source.uniform(1.15, 1.6))
    ends = (0.1 * low, 0.9 * low) if wide else (0.1 * middle, 0.95 * low - 0.05 * middle)
    high = middle + source.uniform(*ends)
    moments = [size * moment for moment in (low, middle, high)]
    source.shuffle(moments)

    def vector(least: float, most: float) -> list[float]:
        return [source.choice((-1.0, 1.0)) * source.uniform(least, most) for _ in range(3)]

    speed = 10.0 ** source.uniform(slowest, fastest) if wide else 1.0

    def torque(factor: float = 1.0) -> list[float]:
        pairs = zip(vector(0.2, 0.6), moments, strict=True)
        return [factor * (part * moment) * speed**2 for part, moment in pairs]

    def waves(count: int) -> list[tuple[list[float], float]]:
        return [(torque(), source.uniform(1.0, 3.0) * speed) for _ in range(count)]

    law = TorqueLaw()
    if kind == "constant":
        law = TorqueLaw(torque())
    elif kind == "wave":
        law = TorqueLaw(rate=torque(0.1), sines=waves(1), cosines=waves(1))
    elif wide:
        law = TorqueLaw(torque(), torque(0.1 * speed), waves(2), waves(3))
    omega, attitude = vector(0.4 * speed, 1.4 * speed), [source.gauss(0.0, 1.0) for _ in range(4)]
    if kind == "mixed":
        omega = [0.0, 0.0, 0.0]
    step_size = _STEPS[number % len(_STEPS)] / speed if wide else 0.5
    given: dict[str, Any] = {"torque": law, "attitude": attitude, "step_size": step_size}
    return Scene(f"{kind}-{number}", omega, moments, **given, steps=16 if wide else 12)


def _body(source: Random) -> list[float]:
    """Return random possible moments (kg m2) in ascending order."""
    low, middle = sorted((source.uniform(1.0, 50.0), source.uniform(1.0, 50.0)))
    return [low, middle, source.uniform(middle, low + middle)]


def _plain(source: Random) -> Scene:
    moments = _body(source)
    source.shuffle(moments)
    return _scene(source, _vector(source, 5.0), moments)


def _near_symmetric(source: Random) -> Scene:
    moment = source.uniform(1.0, 50.0)
    apart = 1.0 + source.choice((-1.0, 1.0)) * 10.0 ** -source.uniform(1.0, 16.0)
    moments = [moment, moment * apart, moment * source.uniform(0.1, 1.9)]
    source.shuffle(moments)
    return _scene(source, _vector(source, 5.0), moments)


def _near_separatrix(source: Random) -> Scene:
    moments = _body(source)
    spin = source.choice((-1.0, 1.0)) * source.uniform(0.5, 5.0)
    omega = _disturbed(source, spin, 10.0 ** -source.uniform(1.0, 12.0))
    axes = source.sample(range(3), 3)
    turned, moments = ([values[k] for k in axes] for values in (omega, moments))
    return _scene(source, turned, moments, torque=False)


def _disturbed(source: Random, spin: float, faint: float) -> list[float]:
    """Return omega (rad/s): `spin` about axis 2, each component perturbed by at most `faint`."""
    return [w + faint * e for w, e in zip((0.0, spin, 0.0), _vector(source, 1.0), strict=True)]


def _violent(source: Random) -> Scene:
    scene = _plain(source)
    size = _largest(scene) * 10.0 ** source.uniform(1.0, 4.0)
    constant, rate = _vector(source, size), _vector(source, size)
    frequency = 10.0 ** source.uniform(0.0, 4.0)
    law = TorqueLaw(constant, rate, [(_vector(source, size), frequency)])
    return replace(scene, torque=law, step_size=1e-2 / size**0.5, steps=50)


def _from_rest(source: Random) -> Scene:
    scene = _plain(source)
    size = _largest(scene) * 10.0 ** source.uniform(-3.0, 1.0)
    axes = source.choice(((0,), (1,), (2,), (0, 1, 2), (0, 1, 2)))
    law = _law(source, size, source.randrange(1, 8), (0.1, 30.0))

    def kept(values: Triple) -> Triple:
        x, y, z = (w if k in axes else 0.0 for k, w in enumerate(values))
        return x, y, z

    return rotated(replace(scene, omega=(0.0, 0.0, 0.0), torque=law), kept, body=False)


def _slow_waves(source: Random) -> Scene:
    scene = _plain(source)
    size = _largest(scene) * 10.0 ** source.uniform(-2.0, 2.0)
    law = _law(source, size, source.choice((4, 8, 12)), (1e-12, 0.1))
    start = 0.0 if source.random() < 0.5 else 10.0 ** -source.uniform(0.0, 6.0)
    return replace(scene, omega=np.multiply(start, scene.omega).tolist(), torque=law)


def _many_speeds(source: Random) -> Scene:
    scene = _plain(source)
    some: list[list[tuple[list[float], float]]] = [[], []]
    for _ in range(source.randint(2, 6)):
        amplitude = _largest(scene) * 10.0 ** source.uniform(-3.0, 1.5)
        frequency = 10.0 ** source.uniform(-6.0, 2.8)
        some[source.randrange(2)].append((_vector(source, amplitude), frequency))
    sines, cosines = some
    if source.random() < 0.2:
        # Methods may combine equal frequencies of sines and cosines.
        cosines = sines
    start, law = source.choice((0.0, 0.01, 1.0)), TorqueLaw(sines=sines, cosines=cosines)
    return replace(scene, omega=np.multiply(start, scene.omega).tolist(), torque=law)


def _far_scale(source: Random) -> Scene:
    exponent = source.choice((-1, 1)) * source.randint(20, 450)
    scene = source.choice((_plain, _from_rest, _slow_waves, _many_speeds))(source)
    if abs(exponent) > 300:
        # A torque's rate, which scales with the factor cubed, would overflow or underflow.
        scene = replace(_plain(source), torque=TorqueLaw())
    found = scaled(scene, 2.0**exponent)
    mass = 2.0 ** source.randint(-60, 60) if abs(exponent) <= 200 else 1.0
    heavier = rotated(found, lambda v: (mass * v[0], mass * v[1], mass * v[2]), body=True)
    return replace(heavier, omega=found.omega)


def _sensitive(source: Random) -> Scene:
    """Return a scene of rotation near the middle axis, with error amplification up to about 1e6."""
    low, middle, high = body = _body(source)
    spin = source.choice((-1.0, 1.0)) * 10.0 ** source.uniform(-1.0, 1.0)
    rate = abs(spin) * ((high - middle) * (middle - low) / (high * low)) ** 0.5
    faint = abs(spin) * 10.0 ** -source.uniform(1.0, 8.0)
    omega, law = _disturbed(source, spin, faint), TorqueLaw()
    if source.random() < 0.6:
        size = low * faint * max(rate, 0.1)
        law = _law(source, size, source.randrange(1, 8), (0.1, 30.0))
    axes, steps = source.sample(range(3), 3), source.randint(10, 60)
    step_size = min(50.0, source.uniform(1.0, 14.0) / max(rate, 1e-3)) / steps
    turned, moments = ([values[k] for k in axes] for values in (omega, body))
    return Scene("", turned, moments, None, law, step_size=step_size, steps=steps)


def _long(source: Random) -> Scene:
    scene = _plain(source)
    return replace(scene, step_size=10.0 ** source.uniform(0.5, 1.3) / scene.steps)


def _no_body(source: Random) -> Scene:
    return _scene(source, _vector(source, 2.0), None, _vector(source, 1.5))


def _extreme(source: Random) -> Scene:
    """Return a scene with numbers of all magnitudes of binary64; most runs overflow."""

    def any_size() -> float:
        if source.random() < 0.1:
            return source.choice((0.0, -0.0))
        return float(source.choice((-1.0, 1.0)) * 10.0 ** source.uniform(-300.0, 300.0))

    law, omega, sizes = ([any_size() for _ in range(3)] for _ in range(3))
    moments = [abs(x) or 1.0 for x in sizes]
    torque = TorqueLaw(law) if source.random() < 0.5 else TorqueLaw()
    step_size = 10.0 ** source.uniform(-100.0, 2.0)
    return Scene("", omega, moments, None, torque, step_size=step_size, steps=20)


def _unsorted_body(source: Random) -> Triple:
    low, middle = source.uniform(5.0, 50.0), source.uniform(5.0, 50.0)
    return source.uniform(abs(low - middle), low + middle), low, middle


def _pointing(source: Random) -> Scene:
    moments, omega = _unsorted_body(source), _vector(source, 3.0)
    return Scene("", omega, moments, attitude=[source.gauss(0, 1) for _ in range(4)])


def _driven(source: Random) -> Scene:
    moments = _unsorted_body(source)
    constant, rate, sine = (_vector(source, size) for size in (20.0, 5.0, 20.0))
    law = TorqueLaw(constant, rate, [(sine, source.uniform(0.1, 20.0))])
    return Scene("", _vector(source, 3.0), moments, torque=law)


NASTY: dict[str, Callable[[Random], Scene]] = {
    "near-symmetric": _near_symmetric,
    "near-separatrix": _near_separatrix,
    "violent torque": _violent,
    "from rest": _from_rest,
    "slow waves": _slow_waves,
    "many speeds": _many_speeds,
    "far scale": _far_scale,
    "sensitive": _sensitive,
    "long": _long,
    "coefficients": _no_body,
    "extreme": _extreme,
}
"""Functions that return scenes difficult for numerical methods, by kind."""

KINDS = {"plain": _plain, **NASTY, "pointing": _pointing, "driven": _driven}
"""Functions that return random scenes, by kind."""


def _law(source: Random, size: float, kinds: int, frequencies: tuple[float, float]) -> TorqueLaw:
    """Return a random torque law, with components up to `size` and `frequencies` in rad/s."""
    # `kinds` is a sum of 1 for a constant term, 2 for a rate, 4 for a sine, 8 for a cosine.
    low, high = map(math.log10, frequencies)
    constant, rate = _vector(source, size), _vector(source, size)
    drawn = ((10.0 ** source.uniform(low, high), _vector(source, size)) for _ in range(2))
    sine, cosine = ((amplitude, frequency) for frequency, amplitude in drawn)
    parts: dict[str, Any] = {"constant": constant, "rate": rate}
    parts |= {"sines": [sine], "cosines": [cosine]}
    return TorqueLaw(**{name: x for k, (name, x) in enumerate(parts.items()) if kinds >> k & 1})


def _scene(
    source: Random,
    omega: Sequence[float],
    moments: Sequence[float] | None,
    coefficients: Sequence[float] | None = None,
    torque: bool = True,
) -> Scene:
    size = (max(moments) if moments else 10.0) * source.uniform(0.1, 2.0)
    kind = source.randrange(4) if torque else 0
    if kind < 3:
        vectors: list[Any] = [_vector(source, size) for _ in range(kind)]
        law = TorqueLaw(*vectors)
    else:
        drawn = ((source.uniform(0.1, most), _vector(source, size)) for most in (30.0, 300.0))
        sine, cosine = ((amplitude, frequency) for frequency, amplitude in drawn)
        law = TorqueLaw(sines=[sine], cosines=[cosine])
    step_size, steps = 10.0 ** source.uniform(-3.0, -1.3), source.randint(10, 60)
    return Scene("plain", omega, moments, coefficients, law, step_size=step_size, steps=steps)


def _largest(scene: Scene) -> float:
    return max(scene.moments or (1.0,))


def _vector(source: Random, size: float) -> list[float]:
    return [source.uniform(-size, size) for _ in range(3)]
