"""Scenes for the campaign: calm and wild, by kind; a seed and a number say which."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from random import Random

import numpy as np

from pyharness.bench.random_loads import _BODIES, _SPEEDS, _WAVES, LAWS, _drawn
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, Triple
from pyharness.model.turned_scenes import turned
from tests.estimates.truth import Truth, truth_of
from tests.random_scenes import NASTY, triple

_MOST_TURNS = 330.0
_SHORT = 0.3  # share of scenes that end within a revolution or a few
COARSEST, FINEST = 1e-3, 1e-13
# What no unit of time or moment changes, in bodies that there are.
_ROUGH = tuple(name for name in NASTY if name not in ("no body", "other units"))
# In turn; those as they are drawn come twice.
_WAYS = ("plain", "near the middle axis", "plain", "strong torque", "rough")
KINDS = (
    "all", *LAWS, *_SPEEDS, *_BODIES, "plain", "near the middle axis", "strong torque",
    *(f"rough: {name}" for name in _ROUGH), "forward", "backward",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Draw:
    """What a number of a seed stands for."""

    number: int
    scene: Scene
    time: float  # s, on either side of 0
    tolerance: float
    kinds: tuple[str, ...]  # of `KINDS`
    truth: Truth


def drawn(seed: str, number: int, tolerances: tuple[float, ...] = ()) -> Draw:
    """Return what `number`, from 0 on, of a seed stands for.

    Its tolerance is one of those given, by default any from `COARSEST` to `FINEST`. Drawn again
    where the body turns more than some 300 times, or the truth would take too many steps.
    """
    source = Random(f"estimates/{seed}/{number}")
    law, place = LAWS[number % len(LAWS)], number // len(LAWS)
    way = _WAYS[place % len(_WAYS)]
    while True:
        scene, time, kinds = _rough(source) if way == "rough" else _by_kind(source, law, way)
        try:
            truth = truth_of(scene, time)
        except InputError:
            continue
        if truth.turns <= _MOST_TURNS:
            break
    of_its_own = Random(f"estimates/{seed}/{number}/tolerance")
    tolerance = COARSEST * (FINEST / COARSEST) ** of_its_own.random()
    if tolerances:
        tolerance = of_its_own.choice(tolerances)
    kinds = ("all", *kinds, "backward" if time < 0.0 else "forward")
    return Draw(number, replace(scene, name=str(number)), time, tolerance, kinds, truth)


def _by_kind(source: Random, law: str, way: str) -> tuple[Scene, float, tuple[str, ...]]:
    body = source.choice(list(_BODIES))
    speed = source.choice(list(_SPEEDS)) if law in _WAVES else ""
    scene, time = _drawn(source, "", law, speed, body)
    if way == "near the middle axis":
        start = math.hypot(*scene.omega)
        moments = scene.moments or (1.0, 1.0, 1.0)
        middle = moments.index(sorted(moments)[1])
        faint = start * 10.0 ** -source.uniform(1.0, 12.0)
        omega = np.array([faint * source.uniform(-1.0, 1.0) for _ in range(3)])
        omega[middle] += source.choice((-1.0, 1.0)) * start
        pushed = _pushed(scene, 10.0 ** -source.uniform(0.0, 10.0))
        scene = replace(pushed, omega=triple(omega))
    elif way == "strong torque" and law != "no torque":
        factor = 10.0 ** source.uniform(0.0, 2.0)
        scene, time = _pushed(scene, factor), time * factor ** -source.random()
    if source.random() < _SHORT:
        time *= 10.0 ** -source.uniform(0.0, 2.0)
    if source.random() < 0.5:
        time = -time
    return scene, time, tuple(filter(None, (law, speed, body, way)))


def _pushed(scene: Scene, factor: float) -> Scene:
    """Return a scene with so many times the torque."""

    def times(values: Triple) -> Triple:
        return values[0] * factor, values[1] * factor, values[2] * factor

    return replace(turned(scene, times, body=False), omega=scene.omega)


def _rough(source: Random) -> tuple[Scene, float, tuple[str, ...]]:
    name = source.choice(_ROUGH)
    make: Callable[[np.random.Generator], tuple[Scene, float]] = NASTY[name]
    scene, time = make(np.random.default_rng(source.getrandbits(64)))
    return scene, time, (f"rough: {name}",)
