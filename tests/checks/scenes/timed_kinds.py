"""Random scenes of several named kinds, each with a time; no method was tuned on these scenes."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness.engine.problem.rescaled import scaled
from pyharness.engine.problem.rotated import rotated
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.model.trajectory import Array

Generator = np.random.Generator


def triple(values: Array) -> Triple:
    first, second, third = values.tolist()
    return first, second, third


def _size(generator: Generator, low: float, high: float) -> Array:
    """Return three numbers of about 10**low to 10**high, of either sign."""
    return np.array(generator.normal(size=3) * 10.0 ** generator.uniform(low, high))


def _waves(generator: Generator, amplitude: tuple[float, float], f: tuple[float, float]) -> Wave:
    return triple(_size(generator, *amplitude)), float(10.0 ** generator.uniform(*f))


def _law(generator: Generator, high: float = 2.0, low: float = -1.0, least: int = 0) -> TorqueLaw:
    """Return a torque of a random kind from `least` on: 0 none, 4 all terms."""
    kind = generator.integers(least, 5)

    def some() -> list[Wave]:
        return [
            _waves(generator, (low, high), (-0.5, 2.5)) for _ in range(generator.integers(1, 3))
        ]

    return TorqueLaw(
        _size(generator, low, high) * (kind != 0),
        _size(generator, low, high - 1.0) * (kind in (2, 4)),
        some() if kind >= 3 else [],
        some() if kind == 4 else [],
    )


def _moments(generator: Generator) -> Array:
    first, second, third = np.sort(generator.uniform(1.0, 10.0, 3))
    return generator.permutation([first, second, min(third, 0.999 * (first + second))])


def _plain(generator: Generator) -> tuple[Scene, float]:
    body, torque = _moments(generator), _law(generator)
    scene = Scene("", _size(generator, -1, 1), moments=body, torque=torque)
    return scene, float(generator.choice([1, 1, -1]) * 10.0 ** generator.uniform(-1.0, 0.7))


def _nearly_symmetric(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = _plain(generator)
    one, _, two = scene.moments or (1.0, 1.0, 1.0)
    near = one * (1.0 + 10.0 ** generator.uniform(-12, -1))
    body = (one, near, min(two, 1.9 * one))
    return replace(scene, moments=body, torque=_law(generator, least=1)), t_end


def _near_the_separatrix(generator: Generator) -> tuple[Scene, float]:
    i1, i2, i3 = np.sort(_moments(generator))
    start = _size(generator, -8, -1)
    start[1] = generator.choice([-1, 1]) * 10.0 ** generator.uniform(-1, 1)
    if generator.random() < 0.5:
        start[2] = generator.uniform(0.1, 2.0)
        start[0] = start[2] * np.sqrt(i3 * (i3 - i2) / (i1 * (i2 - i1)))
        start[0] *= 1.0 + 10.0 ** generator.uniform(-6, -2)
    push = _size(generator, -8, 0)
    some = [_waves(generator, (-8, 0), (-1, 1.5))] if generator.random() < 0.5 else []
    t_end = float(generator.choice([1, -1]) * 10.0 ** generator.uniform(0, 1))
    return Scene("", start, (i1, i2, i3), torque=TorqueLaw(push, sines=some)), t_end


def _violent(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = _plain(generator)
    return replace(scene, torque=_law(generator, 4.0, 1.0)), 0.3 * t_end


def _resonant(generator: Generator) -> tuple[Scene, float]:
    """Return a scene whose wave has the frequency of the precession, twice or half of it."""
    a, b, c = _moments(generator)
    spin = 10.0 ** generator.uniform(0, 1)
    start = _size(generator, -2, 0)
    start[2] = spin
    f = spin * np.sqrt(abs((c - a) * (c - b) / (a * b))) * generator.choice([0.5, 1.0, 1.0, 2.0])
    wave = (triple(_size(generator, -2, 1)), float(f * (1.0 + 0.01 * generator.normal())))
    t_end = float(10.0 ** generator.uniform(0, 1))
    return Scene("", start, (a, b, c), torque=TorqueLaw(sines=[wave])), t_end


def _fast(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = _plain(generator)
    some = [_waves(generator, (-1, 3.5), (1.5, 4)) for _ in range(generator.integers(1, 4))]
    return replace(scene, torque=TorqueLaw(cosines=some[:1], sines=some[1:])), t_end


def _no_body(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = _plain(generator)
    coefficients = triple(generator.normal(size=3) * 10.0 ** generator.uniform(-2, 0.3, 3))
    return replace(scene, moments=None, coefficients=coefficients), 0.3 * t_end


def _other_units(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = _plain(generator)
    rate, mass = 10.0 ** generator.uniform(-30, 30), 10.0 ** generator.uniform(-20, 20)
    fast = scaled(scene, rate)
    heavy = rotated(fast, lambda each: triple(mass * np.array(each)), body=True)
    return replace(heavy, omega=fast.omega), t_end / rate


def _long(generator: Generator) -> tuple[Scene, float]:
    scene, _ = _plain(generator)
    torque = _law(generator, 0.5, -2.0, least=1)
    start = triple(_size(generator, -1, 0.3))
    return replace(scene, omega=start, torque=torque), float(10.0 ** generator.uniform(0.7, 1.7))


def _from_rest(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = _plain(generator)
    return replace(scene, omega=(0.0, 0.0, 0.0), torque=_law(generator, least=1)), t_end


def _unstable(generator: Generator) -> tuple[Scene, float]:
    """Return a steady rotation under torque, and a time for a growth of perturbations to 1e18."""
    while True:
        body = _moments(generator)
        middle = int(np.argsort(body)[1])
        omega = 10.0 ** generator.uniform(-8.0, -0.3, 3) * generator.choice([-1.0, 1.0], 3)
        omega[middle] = generator.choice([-1.0, 1.0]) * 10.0 ** generator.uniform(-0.5, 0.5)
        # The torque makes I omega' = N - omega x I omega zero, except for rounding.
        torque = TorqueLaw(triple(np.cross(omega, body * omega)))
        scene = Scene("", triple(omega), triple(body), torque=torque)
        x, y, z = omega
        a, b, c = scene.euler_coefficients
        jacobian = np.array([[0.0, a * z, a * y], [b * z, 0.0, b * x], [c * y, c * x, 0.0]])
        rate = float(np.linalg.eigvals(jacobian).real.max())
        if rate > 1e-3:
            break
    time = math.log(10.0) * float(generator.uniform(0.0, 18.0)) / rate
    return scene, float(generator.choice([-1.0, 1.0])) * time


def _spin(generator: Generator, kind: str) -> tuple[Scene, float]:
    """Return a rotation about a principal axis, a torque of `SPINS` along it, and a time (s)."""
    axis = int(generator.integers(3))
    along = np.zeros(3)
    along[axis] = 1.0
    spin = generator.choice([-1.0, 1.0]) * 10.0 ** generator.uniform(-2.0, 1.0)
    push = generator.normal() * 10.0 ** generator.uniform(-2.0, 0.0)
    time = 10.0 ** generator.uniform(0.0, 2.0) / abs(spin)
    none: Triple = (0.0, 0.0, 0.0)
    law = TorqueLaw()
    if kind == "constant":
        law = TorqueLaw(triple(push * along))
    elif kind in ("ramp", "ramp from rest"):
        law = TorqueLaw(none, triple(push * along))
    elif kind == "wave":
        law = TorqueLaw(sines=[(triple(push * along), float(10.0 ** generator.uniform(-1.0, 1.0)))])
    if kind == "ramp from rest":
        spin = 0.0
        time = float(generator.uniform(0.5, 4.0) / abs(push) ** (1.0 / 3.0))
    elif kind == "slow":
        spin, time = spin * 1e-4, time * generator.uniform(0.0, 0.1) * 1e4
    time = float(min(time, 60.0) if kind not in ("steady", "slow") else time)
    attitude = generator.normal(size=4)
    attitude /= np.linalg.norm(attitude)
    first, second, third, fourth = attitude.tolist()
    scene = Scene(
        "", triple(spin * along), triple(_moments(generator)), torque=law,
        attitude=(first, second, third, fourth),
    )  # fmt: skip
    return scene, float(generator.choice([-1.0, 1.0])) * time


NASTY: dict[str, Callable[[Generator], tuple[Scene, float]]] = {
    "nearly symmetric": _nearly_symmetric, "near the separatrix": _near_the_separatrix,
    "violent torque": _violent, "resonant": _resonant, "fast waves": _fast, "no body": _no_body,
    "other units": _other_units, "long": _long, "from rest": _from_rest,
}  # fmt: skip
"""The functions that return random scenes which are difficult for numerical methods, by kind."""

SPINS = ("steady", "constant", "ramp", "wave", "ramp from rest", "slow")
"""The kinds of rotations about a principal axis, by their torque along it."""

KINDS: dict[str, Callable[[Generator], tuple[Scene, float]]] = {
    "plain": _plain,
    **NASTY,
    "unstable": _unstable,
    **{f"spin: {kind}": partial(_spin, kind=kind) for kind in SPINS},
}
"""The functions that return a random scene and its time (s), by kind."""


def timed_scenes(kind: str, seed: int | Sequence[int]) -> Iterator[tuple[Scene, float]]:
    """Yield random scenes of a kind, a key of `KINDS`, each with a time (s), without end."""
    generator = np.random.default_rng(seed)
    while True:
        yield KINDS[kind](generator)
