"""Random scenes, listings and steps that can be had again: a seed and a number say which."""

import datetime
import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from pyharness.model.listing import PROGRAMS, Listing, names_of
from pyharness.model.same_motion import scaled
from pyharness.model.scene import Scene, TorqueLaw, Triple, Wave

COARSEST = 1e-3
_LIPSCHITZ = (500.0, 60.0, 1.0, 1e-3)


@dataclass(frozen=True)
class Draw:
    """What one number of a seed stands for.

    Attributes
    ----------
    scene : Scene
        Half of them nasty; `scene.name` says in what way.
    listing : Listing
        Of any program, with any defects and readings.
    lipschitz : float
        Constant of the stop test (1/s).
    may_stop : bool
        Whether the stop test may end the run.
    digits : float
        0 for the coarsest tolerance that a method is asked for, 1 for its own finest.
    backward : bool
        Whether a method is asked for negative times.
    stages : int
        Of Gauss collocation.
    """

    scene: Scene
    listing: Listing
    lipschitz: float
    may_stop: bool
    digits: float
    backward: bool
    stages: int

    @property
    def time(self) -> float:
        """The last time that a method is asked for (s)."""
        return self.scene.step_size * self.scene.steps * (-1.0 if self.backward else 1.0)

    def tolerance(self, finest: float) -> float:
        """Return the tolerance for a method that claims to meet `finest`."""
        return float(max(finest, COARSEST * (finest / COARSEST) ** self.digits))


def weekly_seed(day: datetime.date | None = None) -> str:
    """Return the week, as in 2026-W47: a seed that changes every Monday."""
    year, week, _ = (day or datetime.date.today()).isocalendar()
    return f"{year}-W{week:02d}"


def draw(seed: str, number: int) -> Draw:
    """Return what `number` of `seed` stands for; the same with every version of Python."""
    # A generator of its own for each number, so that one can be repeated without the others.
    source = random.Random(f"{seed}/{number}")
    nasty = number % 2 == 1
    scene = _plain(source)
    if nasty:
        name = source.choice(list(_NASTY))
        scene = replace(_NASTY[name](source), name=name)
    program = source.choice(PROGRAMS)
    defects, readings = (
        frozenset(name for name in names_of(kind, program) if source.random() < share)
        for kind, share in (("defect", 0.5), ("reading", 0.3))
    )
    return Draw(
        scene=scene,
        listing=Listing(program, defects, readings),
        lipschitz=source.choice(_LIPSCHITZ),
        may_stop=source.random() < 0.5,
        digits=source.random(),
        backward=source.random() < 0.5,
        stages=source.randint(1, 8),
    )


def _plain(source: random.Random) -> Scene:
    """Return a body that exists, turning at a few radians a second."""
    low, middle = sorted((source.uniform(1.0, 50.0), source.uniform(1.0, 50.0)))
    moments = [low, middle, source.uniform(middle, low + middle)]
    source.shuffle(moments)
    return _scene(source, "plain", _triple(moments), _triple(_vector(source, 5.0)))


def _near_symmetric(source: random.Random) -> Scene:
    moment = source.uniform(1.0, 50.0)
    apart = 1.0 + source.choice((-1.0, 1.0)) * 10.0 ** -source.uniform(1.0, 16.0)
    moments = [moment, moment * apart, moment * source.uniform(0.1, 1.9)]
    source.shuffle(moments)
    return _scene(source, "near-symmetric", _triple(moments), _triple(_vector(source, 5.0)))


def _near_separatrix(source: random.Random) -> Scene:
    low, middle = sorted((source.uniform(1.0, 50.0), source.uniform(1.0, 50.0)))
    moments = [low, middle, source.uniform(middle, low + middle)]
    spin = [0.0, source.choice((-1.0, 1.0)) * source.uniform(0.5, 5.0), 0.0]
    faint = 10.0 ** -source.uniform(1.0, 12.0)
    omega = [w + faint * e for w, e in zip(spin, _vector(source, 1.0), strict=True)]
    axes = source.sample(range(3), 3)
    return _scene(
        source, "near-separatrix",
        _triple([moments[k] for k in axes]), _triple([omega[k] for k in axes]), torque=False,
    )  # fmt: skip


def _violent(source: random.Random) -> Scene:
    scene = _plain(source)
    size = max(scene.moments or (1.0,)) * 10.0 ** source.uniform(1.0, 4.0)
    law = TorqueLaw(
        constant=_triple(_vector(source, size)),
        rate=_triple(_vector(source, size)),
        sines=(_wave(source, size, 10.0 ** source.uniform(0.0, 4.0)),),
    )
    step = 1e-2 / size**0.5
    return Scene("violent torque", scene.omega, scene.moments, torque=law, step_size=step, steps=50)


def _from_rest(source: random.Random) -> Scene:
    """Return a body at rest under torque of any kind, about one axis or about all."""
    scene = _plain(source)
    size = max(scene.moments or (1.0,)) * 10.0 ** source.uniform(-3.0, 1.0)
    axes = source.choice(((0,), (1,), (2,), (0, 1, 2), (0, 1, 2)))
    law = _law(source, size, source.randrange(1, 8), (0.1, 30.0))
    law = _about(law, axes)
    return replace(scene, omega=(0.0, 0.0, 0.0), torque=law)


def _slow_waves(source: random.Random) -> Scene:
    """Return waves that turn by as little as 1e-14 radians, half of them from rest."""
    scene = _plain(source)
    size = max(scene.moments or (1.0,)) * 10.0 ** source.uniform(-2.0, 2.0)
    kind = source.choice((4, 8, 12))
    law = _law(source, size, kind, (1e-12, 0.1))
    start = 0.0 if source.random() < 0.5 else 10.0 ** -source.uniform(0.0, 6.0)
    return replace(scene, omega=_triple([start * w for w in scene.omega]), torque=law)


def _many_speeds(source: random.Random) -> Scene:
    """Return up to six waves from 1e-6 to 600 rad/s beside each other."""
    scene = _plain(source)
    size = max(scene.moments or (1.0,))
    some: list[list[Wave]] = [[], []]
    for _ in range(source.randint(2, 6)):
        amplitude = size * 10.0 ** source.uniform(-3.0, 1.5)
        frequency = 10.0 ** source.uniform(-6.0, 2.8)
        some[source.randrange(2)].append(_wave(source, amplitude, frequency))
    law = TorqueLaw(sines=tuple(some[0]), cosines=tuple(some[1]))
    if source.random() < 0.2:
        # One frequency in a sine and in a cosine, which methods may take together.
        law = replace(law, cosines=tuple((a, f) for a, f in law.sines))
    start = source.choice((0.0, 0.01, 1.0))
    return replace(scene, omega=_triple([start * w for w in scene.omega]), torque=law)


def _far_scale(source: random.Random) -> Scene:
    """Return a scene with other units of time and mass: omega from 1e-135 to 1e135."""
    exponent = source.choice((-1, 1)) * source.randint(20, 450)
    scene = source.choice((_plain, _from_rest, _slow_waves, _many_speeds))(source)
    if abs(exponent) > 300:
        # The rate of a torque goes with the cube.
        scene = replace(_plain(source), torque=TorqueLaw())
    found = scaled(scene, 2.0**exponent)
    mass = 2.0 ** source.randint(-60, 60) if abs(exponent) <= 200 else 1.0
    law = found.torque

    def times(values: Sequence[float]) -> Triple:
        return _triple([mass * x for x in values])

    return replace(
        found,
        name="far scale",
        moments=times(found.moments or ()),
        torque=TorqueLaw(
            times(law.constant),
            times(law.rate),
            tuple((times(a), f) for a, f in law.sines),
            tuple((times(a), f) for a, f in law.cosines),
        ),
    )


def _sensitive(source: random.Random) -> Scene:
    """Return a spin beside the middle axis that multiplies a difference up to 1e6 times."""
    low, middle = sorted((source.uniform(1.0, 50.0), source.uniform(1.0, 50.0)))
    high = source.uniform(middle, low + middle)
    spin = source.choice((-1.0, 1.0)) * 10.0 ** source.uniform(-1.0, 1.0)
    rate = abs(spin) * ((high - middle) * (middle - low) / (high * low)) ** 0.5
    faint = abs(spin) * 10.0 ** -source.uniform(1.0, 8.0)
    omega = [w + faint * e for w, e in zip((0.0, spin, 0.0), _vector(source, 1.0), strict=True)]
    law = TorqueLaw()
    if source.random() < 0.6:
        size = low * faint * max(rate, 0.1)
        law = _law(source, size, source.randrange(1, 8), (0.1, 30.0))
    axes = source.sample(range(3), 3)
    steps = source.randint(10, 60)
    scene = Scene(
        "sensitive",
        _triple([omega[k] for k in axes]),
        _triple([(low, middle, high)[k] for k in axes]),
        torque=law,
        step_size=min(50.0, source.uniform(1.0, 14.0) / max(rate, 1e-3)) / steps,
        steps=steps,
    )
    return scene


def _long(source: random.Random) -> Scene:
    """Return a motion of up to a few hundred radians."""
    scene = _plain(source)
    return replace(scene, step_size=10.0 ** source.uniform(0.5, 1.3) / scene.steps)


def _no_body(source: random.Random) -> Scene:
    """Return coefficients of any sign, which no body has."""
    return _scene(
        source, "coefficients", None, _triple(_vector(source, 2.0)), _triple(_vector(source, 1.5))
    )


def _extreme(source: random.Random) -> Scene:
    """Return numbers from one end of binary64 to the other, which mostly overflow."""

    def any_size() -> float:
        if source.random() < 0.1:
            return float(source.choice((0.0, -0.0)))
        return float(source.choice((-1.0, 1.0)) * 10.0 ** source.uniform(-300.0, 300.0))

    law = TorqueLaw(_triple([any_size() for _ in range(3)]))
    return Scene(
        "extreme",
        _triple([any_size() for _ in range(3)]),
        _triple([abs(any_size()) or 1.0 for _ in range(3)]),
        torque=law if source.random() < 0.5 else TorqueLaw(),
        step_size=10.0 ** source.uniform(-100.0, 2.0),
        steps=20,
    )


_NASTY: dict[str, Callable[[random.Random], Scene]] = {
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


def _law(
    source: random.Random, size: float, kinds: int, frequencies: tuple[float, float]
) -> TorqueLaw:
    """Return a torque of about `size`: 1 constant, 2 rate, 4 a sine, 8 a cosine, or a sum."""
    low, high = map(math.log10, frequencies)
    nothing = (0.0, 0.0, 0.0)
    parts = [_triple(_vector(source, size)) for _ in range(2)]
    waves = [_wave(source, size, 10.0 ** source.uniform(low, high)) for _ in range(2)]
    return TorqueLaw(
        parts[0] if kinds & 1 else nothing,
        parts[1] if kinds & 2 else nothing,
        (waves[0],) if kinds & 4 else (),
        (waves[1],) if kinds & 8 else (),
    )


def _about(law: TorqueLaw, axes: Sequence[int]) -> TorqueLaw:
    """Return what of a torque acts about some axes."""

    def kept(values: Triple) -> Triple:
        return _triple([x if k in axes else 0.0 for k, x in enumerate(values)])

    return TorqueLaw(
        kept(law.constant),
        kept(law.rate),
        tuple((kept(a), f) for a, f in law.sines),
        tuple((kept(a), f) for a, f in law.cosines),
    )


def _scene(
    source: random.Random,
    name: str,
    moments: Triple | None,
    omega: Triple,
    coefficients: Triple | None = None,
    torque: bool = True,
) -> Scene:
    """Return a scene with one of the kinds of torque that there are, or none."""
    size = 10.0 if moments is None else max(moments)
    size *= source.uniform(0.1, 2.0)
    kind = source.randrange(4) if torque else 0
    law = TorqueLaw()
    if kind == 1:
        law = TorqueLaw(_triple(_vector(source, size)))
    elif kind == 2:
        law = TorqueLaw(_triple(_vector(source, size)), _triple(_vector(source, size)))
    elif kind == 3:
        law = TorqueLaw(
            sines=(_wave(source, size, source.uniform(0.1, 30.0)),),
            cosines=(_wave(source, size, source.uniform(0.1, 300.0)),),
        )
    return Scene(
        name,
        omega,
        moments,
        coefficients,
        law,
        step_size=10.0 ** source.uniform(-3.0, -1.3),
        steps=source.randint(10, 60),
    )


def _vector(source: random.Random, size: float) -> list[float]:
    return [source.uniform(-size, size) for _ in range(3)]


def _wave(source: random.Random, size: float, frequency: float) -> Wave:
    return _triple(_vector(source, size)), frequency


def _triple(values: list[float]) -> Triple:
    first, second, third = values
    return first, second, third
