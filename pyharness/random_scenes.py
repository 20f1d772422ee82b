"""Random scenes, listings and steps that can be had again: a seed and a number say which."""

import datetime
import random
from collections.abc import Callable
from dataclasses import dataclass

from pyharness.listing import PROGRAMS, Listing, names_of
from pyharness.scaling import scaled
from pyharness.scene import Scene, TorqueLaw, Triple, Wave

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
    tolerance : float
        For a method, 1e-2 to 1e-14.
    backward : bool
        Whether a method is asked for negative times.
    stages : int
        Of Gauss collocation.
    """

    scene: Scene
    listing: Listing
    lipschitz: float
    may_stop: bool
    tolerance: float
    backward: bool
    stages: int


def weekly_seed(day: datetime.date | None = None) -> str:
    """Return the week, as in 2026-W47: a seed that changes every Monday."""
    year, week, _ = (day or datetime.date.today()).isocalendar()
    return f"{year}-W{week:02d}"


def draw(seed: str, number: int) -> Draw:
    """Return what `number` of `seed` stands for; the same with every version of Python."""
    # A generator of its own for each number, so that one can be repeated without the others.
    source = random.Random(f"{seed}/{number}")
    nasty = number % 2 == 1
    scene = source.choice(_NASTY)(source) if nasty else _plain(source)
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
        tolerance=10.0 ** -source.uniform(2.0, 14.0),
        backward=source.random() < 0.3,
        stages=source.randint(3, 8),
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


def _far_scale(source: random.Random) -> Scene:
    """Return a plain scene with another unit of time: omega from 1e-135 to 1e135."""
    from dataclasses import replace

    exponent = source.choice((-1, 1)) * source.randint(20, 450)
    scene = _plain(source)
    if abs(exponent) > 300:
        # The rate of a torque goes with the cube.
        scene = replace(scene, torque=TorqueLaw())
    return replace(scaled(scene, 2.0**exponent), name="far scale")


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


_NASTY: tuple[Callable[[random.Random], Scene], ...] = (
    _near_symmetric,
    _near_separatrix,
    _violent,
    _far_scale,
    _no_body,
    _extreme,
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
