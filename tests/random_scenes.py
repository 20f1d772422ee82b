"""Random scenes, plain and nasty, each from a generator. No method was tuned on them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pyharness import Scene, TorqueLaw
from pyharness.model.scene import Triple
from pyharness.model.torque_law import Wave
from pyharness.scenes.rescaled import scaled
from pyharness.scenes.rotated import rotated

Generator = np.random.Generator


def triple(values: np.ndarray) -> Triple:
    """Return three plain floats."""
    first, second, third = values.tolist()
    return first, second, third


def size(generator: Generator, low: float, high: float) -> np.ndarray:
    """Return three numbers of about 10**low to 10**high, of either sign."""
    return np.array(generator.normal(size=3) * 10.0 ** generator.uniform(low, high))


def waves(generator: Generator, amplitude: tuple[float, float], f: tuple[float, float]) -> Wave:
    """Return a wave; the ranges of amplitude and frequency are powers of ten."""
    return triple(size(generator, *amplitude)), float(10.0 ** generator.uniform(*f))


def law(generator: Generator, high: float = 2.0, low: float = -1.0, least: int = 0) -> TorqueLaw:
    """Return a torque of a random kind from `least` on: 0 none, 4 all terms."""
    kind = generator.integers(least, 5)

    def some() -> list[Wave]:
        return [waves(generator, (low, high), (-0.5, 2.5)) for _ in range(generator.integers(1, 3))]

    return TorqueLaw(
        size(generator, low, high) * (kind != 0),
        size(generator, low, high - 1.0) * (kind in (2, 4)),
        some() if kind >= 3 else [],
        some() if kind == 4 else [],
    )


def moments(generator: Generator) -> np.ndarray:
    """Return three moments of a possible body, in any order."""
    first, second, third = np.sort(generator.uniform(1.0, 10.0, 3))
    return generator.permutation([first, second, min(third, 0.999 * (first + second))])


def plain(generator: Generator) -> tuple[Scene, float]:
    """Return a scene and its time (s): body, start and torque over two orders of magnitude each."""
    body, torque = moments(generator), law(generator)
    scene = Scene("", size(generator, -1, 1), moments=body, torque=torque)
    return scene, float(generator.choice([1, 1, -1]) * 10.0 ** generator.uniform(-1.0, 0.7))


def _nearly_symmetric(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = plain(generator)
    one, _, two = scene.moments or (1.0, 1.0, 1.0)
    near = one * (1.0 + 10.0 ** generator.uniform(-12, -1))
    body = (one, near, min(two, 1.9 * one))
    return replace(scene, moments=body, torque=law(generator, least=1)), t_end


def _near_the_separatrix(generator: Generator) -> tuple[Scene, float]:
    """Return a scene that rotates near the middle axis or near the separatrix, and its time."""
    i1, i2, i3 = np.sort(moments(generator))
    start = size(generator, -8, -1)
    start[1] = generator.choice([-1, 1]) * 10.0 ** generator.uniform(-1, 1)
    if generator.random() < 0.5:
        start[2] = generator.uniform(0.1, 2.0)
        start[0] = start[2] * np.sqrt(i3 * (i3 - i2) / (i1 * (i2 - i1)))
        start[0] *= 1.0 + 10.0 ** generator.uniform(-6, -2)
    push = size(generator, -8, 0)
    some = [waves(generator, (-8, 0), (-1, 1.5))] if generator.random() < 0.5 else []
    t_end = float(generator.choice([1, -1]) * 10.0 ** generator.uniform(0, 1))
    return Scene("", start, (i1, i2, i3), torque=TorqueLaw(push, sines=some)), t_end


def _violent(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = plain(generator)
    return replace(scene, torque=law(generator, 4.0, 1.0)), 0.3 * t_end


def _resonant(generator: Generator) -> tuple[Scene, float]:
    """Return a scene whose wave has the frequency of the precession, twice or half of it."""
    a, b, c = moments(generator)
    spin = 10.0 ** generator.uniform(0, 1)
    start = size(generator, -2, 0)
    start[2] = spin
    f = spin * np.sqrt(abs((c - a) * (c - b) / (a * b))) * generator.choice([0.5, 1.0, 1.0, 2.0])
    wave = (triple(size(generator, -2, 1)), float(f * (1.0 + 0.01 * generator.normal())))
    t_end = float(10.0 ** generator.uniform(0, 1))
    return Scene("", start, (a, b, c), torque=TorqueLaw(sines=[wave])), t_end


def _fast(generator: Generator) -> tuple[Scene, float]:
    """Return a scene with waves of up to 1e4 rad/s, faint or dominant, and its time."""
    scene, t_end = plain(generator)
    some = [waves(generator, (-1, 3.5), (1.5, 4)) for _ in range(generator.integers(1, 4))]
    return replace(scene, torque=TorqueLaw(cosines=some[:1], sines=some[1:])), t_end


def _no_body(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = plain(generator)
    coefficients = triple(generator.normal(size=3) * 10.0 ** generator.uniform(-2, 0.3, 3))
    return replace(scene, moments=None, coefficients=coefficients), 0.3 * t_end


def _other_units(generator: Generator) -> tuple[Scene, float]:
    """Return a scene with times and moments that are many powers of ten away from one."""
    scene, t_end = plain(generator)
    rate, mass = 10.0 ** generator.uniform(-30, 30), 10.0 ** generator.uniform(-20, 20)
    fast = scaled(scene, rate)
    heavy = rotated(fast, lambda each: triple(mass * np.array(each)), body=True)
    return replace(heavy, omega=fast.omega), t_end / rate


def _long(generator: Generator) -> tuple[Scene, float]:
    scene, _ = plain(generator)
    torque = law(generator, 0.5, -2.0, least=1)
    start = triple(size(generator, -1, 0.3))
    return replace(scene, omega=start, torque=torque), float(10.0 ** generator.uniform(0.7, 1.7))


def _from_rest(generator: Generator) -> tuple[Scene, float]:
    scene, t_end = plain(generator)
    return replace(scene, omega=(0.0, 0.0, 0.0), torque=law(generator, least=1)), t_end


NASTY: dict[str, Callable[[Generator], tuple[Scene, float]]] = {
    "nearly symmetric": _nearly_symmetric,
    "near the separatrix": _near_the_separatrix,
    "violent torque": _violent,
    "resonant": _resonant,
    "fast waves": _fast,
    "no body": _no_body,
    "other units": _other_units,
    "long": _long,
    "from rest": _from_rest,
}
