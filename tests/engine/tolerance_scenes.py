"""Scenes of every kind with a time each, for the table of tolerances: drawn, or named."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from random import Random
from typing import Any

import numpy as np

from pyharness import ChangingInertia, ChangingMoments, Scene, TorqueLaw, case_scene, torques
from pyharness.checks.scenes import state_scenes
from pyharness.checks.scenes.random_scenes import KINDS as DRAWN
from pyharness.checks.scenes.random_scenes import random_scene
from pyharness.model.attitude import IDENTITY
from tests.checks.scenes.cancelling import MERGED, cancelling
from tests.checks.scenes.free_motions import KINDS as FREE
from tests.checks.scenes.free_motions import draw as draw_free
from tests.checks.scenes.timed_kinds import KINDS as TIMED
from tests.checks.scenes.timed_kinds import timed_scenes
from tests.within import Motion, true_motion

Timed = tuple[Scene, float]
TURNED = (0.5, -0.1, 0.7, 0.5)
BODY = (40.0, 30.0, 20.0)
# Numbers of the draws whose reference takes little time.
_TIMED = {
    "plain": (0, 1), "nearly symmetric": (0,), "near the separatrix": (0, 2),
    "violent torque": (0, 2), "resonant": (0, 1, 2), "fast waves": (2,), "no body": (0, 1, 2),
    "other units": (0, 1, 2), "from rest": (0, 2),
}  # fmt: skip


def _seeds(kinds: tuple[str, ...], **seeds: int) -> list[tuple[str, int]]:
    return [(kind, seeds.get(kind, 0)) for kind in kinds]


_SEEDS_READY = _seeds(state_scenes.READY, attitude_control=1, magnetic_dipole=1)
_SEEDS_STEADY = _seeds(state_scenes.STEADY, wave=1, decay=0)
_SEEDS_TURNING = _seeds(state_scenes.TURNING, gradient=1)
_SEEDS_SUDDEN = _seeds(state_scenes.SUDDEN, friction=1, switch=1)


def _free(kind: str) -> Timed:
    moments, omega, attitude, time = draw_free(Random(f"within {kind}"), kind, 0.7)
    return _cut(Scene("", omega, moments, attitude=attitude), time, 15.0)


def _drawn(kind: str, seed: int) -> Timed:
    scene = random_scene(kind, seed)
    return scene, scene.step_size * scene.steps


def _timed(kind: str, number: int) -> Timed:
    return next(itertools.islice(timed_scenes(kind, 1), number, None))


def _cut(scene: Scene, time: float, radians: float = 6.0) -> Timed:
    """Return a time that is so short that the reference takes little work."""
    longest = radians / max(map(abs, scene.omega))
    return scene, float(np.sign(time)) * min(abs(time), longest)


def _state(kind: str, seed: int) -> Timed:
    return _cut(*state_scenes.draw(Random(f"{kind} {seed}"), (kind,)))


def _ready(kind: str, seed: int) -> Timed:
    return _cut(*state_scenes.draw_ready(Random(f"{kind} {seed}"), (kind, kind)))


def _space(law: TorqueLaw, **body: Any) -> Timed:
    body = body or {"moments": BODY}
    law = replace(law, frame="space")
    return Scene("", (0.3, -1.0, 2.0), torque=law, attitude=TURNED, **body), 0.7


def _law(law: TorqueLaw, omega: Any = (0.3, -1.0, 2.0), time: float = 2.0) -> Timed:
    return Scene("", omega, BODY, torque=law), time


def draw_changing(source: Random, full: bool = False) -> Timed:
    """Return a random scene with an inertia that changes, and a time (s) within its span.

    The inertia is a matrix if `full` is true.
    """
    time = source.choice((1.0, -0.4)) * 10.0 ** source.uniform(0.0, 1.3)
    size = 10.0 ** source.uniform(-2.0, 2.0)
    x, y = (source.uniform(0.3, 1.0) for _ in range(2))
    moments = [size * x, size * y, size * source.uniform(abs(x - y), x + y)]
    polynomials = []
    for axis, moment in enumerate(moments):
        # The sum of the changes is at most 0.7 of the moment.
        degree = source.randint(int(axis == 0), 4)
        powers = enumerate([source.uniform(-0.7, 0.7) / degree for _ in range(degree)], 1)
        polynomials.append([moment, *(moment * each / abs(time) ** n for n, each in powers)])
    omega = [source.uniform(-2.0, 2.0) for _ in range(3)]
    if not full:
        return Scene("random", omega, moments=ChangingMoments(polynomials), attitude=IDENTITY), time
    axes = np.linalg.qr(np.random.default_rng(source.randrange(1000)).normal(size=(3, 3)))[0]
    matrices = [axes @ np.diag(moments) @ axes.T]
    degree = source.randint(1, 4)
    for n in range(1, degree + 1):
        size = 0.7 / degree * min(moments) / abs(time) ** n
        # The norm of a matrix is at most three times its largest element.
        a, b, c, d, e, f = (source.uniform(-size, size) / 3.0 for _ in range(6))
        matrices.append(np.array([[a, f, e], [f, b, d], [e, d, c]]))
    return Scene("random", omega, inertia=ChangingInertia(matrices), attitude=IDENTITY), time


def _changing(full: bool, kind: int) -> Timed:
    """Return a scene whose inertia changes, under one kind of torque."""
    scene, time = draw_changing(Random(f"within {full} {kind}"), full)
    assert scene.changing is not None
    size = float(np.abs(scene.changing.matrix(0.0)).max())
    vector = [0.2 * size, -0.1 * size, 0.15 * size]
    wave = [(vector[::-1], 1.3)]
    cubic = -0.05 * float(np.copysign(size, time))
    torque: Any = (
        lambda: TorqueLaw(),
        lambda: TorqueLaw(vector, sines=wave),
        lambda: TorqueLaw(vector, frame="space"),
        lambda: torques.damping(0.1 * size) + TorqueLaw(vector),
        lambda: torques.wheels(vector, TorqueLaw(0.1 * np.array(vector))),
        lambda: torques.gravity_gradient(scene.changing, 0.4),
        lambda: torques.in_space(vector) + (lambda t, omega: cubic * omega**3),
    )[kind]()
    return _cut(replace(scene, torque=torque), time, 4.0)


WAVES = TorqueLaw(
    (1.0, -2.0, 3.0), (0.5, 1.0, -2.0), [((5.0, 2.0, 0.0), 3.0), ((0.0, 4.0, 8.0), -11.0)],
    [((-3.0, 6.0, 2.0), 1.7)],
)  # fmt: skip
MATRIX = ((40.0, 3.0, 0.0), (3.0, 30.0, 1.0), (0.0, 1.0, 20.0))
REST = (0.0, 0.0, 0.0)

# Omega and moments: middle axis, separatrix, symmetry, spheres, rest, extreme sizes.
EDGES: list[tuple[Any, Any]] = [
    ((0.0, 1.0, 0.0), (40.0, 30.0, 20.0)), ((1e-9, 1.0, 0.0), (40.0, 30.0, 20.0)),
    ((1.0, 1.0, np.sqrt(0.75)), (3.0, 2.0, 1.0)), ((1.0, 2.0, 3.0), (2.0, 2.0, 1.0)),
    ((1.0, 2.0, 3.0), (1.0, 2.0, 2.0)), ((1.0, 2.0, 3.0), (5.0, 5.0, 5.0)),
    (REST, (3.0, 2.0, 1.0)), ((1.0, 2.0, 3.0), (1e9, 1.0, 1e9 + 1e-3)),
    ((1.0, 0.0, 0.0), (3.0, 2.0, 1.0)), ((-1.0, -2.0, 0.5), (1.0, 3.0, 2.5)),
    ((0.0, 0.0, 20.0), (3.0, 3.0, 3.0)),
]  # fmt: skip

# By kind, and by name, a function that returns a scene and a time (s).
KINDS: dict[str, dict[str, Callable[[], Timed]]] = {
    "torque free": {kind: partial(_free, kind) for kind in FREE if kind != "needle"},
    "cases": {f"case {n}": partial(lambda n: (case_scene(n), 0.4), n) for n in range(1, 8)},
    "drawn": {
        f"{kind} {seed}": partial(_drawn, kind, seed)
        for kind in DRAWN if kind not in ("extreme", "pointing") for seed in (0, 1)
        if (kind, seed) not in (("long", 0), ("sensitive", 0), ("sensitive", 1))
    },
    "timed": {
        f"{kind} {number}": partial(_timed, kind, number)
        for kind, numbers in _TIMED.items() for number in numbers
    },
    "spins": {kind: partial(_timed, kind, 0) for kind in TIMED if kind.startswith("spin")},
    "cancelling": {
        kind: partial(lambda kind: (cancelling(kind, 0), 2.0), kind) for kind in MERGED
    },
    "ready torques": {
        f"{kind} {seed}": partial(_ready, kind, seed) for kind, seed in _SEEDS_READY
    },
    "steady": {f"{kind} {seed}": partial(_state, kind, seed) for kind, seed in _SEEDS_STEADY},
    "turning": {f"{kind} {seed}": partial(_state, kind, seed) for kind, seed in _SEEDS_TURNING},
    "sudden": {f"{kind} {seed}": partial(_state, kind, seed) for kind, seed in _SEEDS_SUDDEN},
    "torque in space": {
        "constant": partial(_space, TorqueLaw((3.0, 0.0, 10.0))),
        "ramp": partial(_space, TorqueLaw(rate=(3.0, -9.0, 10.0))),
        "waves": partial(_space, WAVES),
        "waves on a top": partial(_space, WAVES, moments=(30.0, 30.0, 20.0)),
        "waves on a sphere": partial(_space, WAVES, moments=(30.0, 30.0, 30.0)),
        "waves, full inertia": partial(_space, WAVES, inertia=MATRIX),
        "along the axis of a spin": lambda: (
            Scene(
                "", (0.0, 2.0, 0.0), BODY,
                torque=TorqueLaw((0.0, 3.0, 0.0), sines=[((0.0, 2.0, 0.0), 3.0)], frame="space"),
            ), 2.0,
        ),
        "however small, from rest": lambda: (
            Scene("", REST, BODY, torque=TorqueLaw((3e-200, 0.0, 1e-201), frame="space")), 1e100
        ),
    },
    "changing inertia": {
        f"{'matrix' if full else 'moments'} {kind}": partial(_changing, full, kind)
        for full, kinds in ((False, (0, 1, 2, 5, 6)), (True, (0, 3, 4))) for kind in kinds
    },
    "full inertia": {
        "free": lambda: (Scene("", (0.3, -1.0, 2.0), inertia=MATRIX), 3.0),
        "waves": lambda: (Scene("", (0.3, -1.0, 2.0), inertia=MATRIX, torque=WAVES), -0.7),
        "damping": lambda: (
            Scene("", (0.3, -1.0, 2.0), inertia=MATRIX, torque=torques.damping(3.0)), 3.0
        ),
        "field": lambda: (
            replace(_state("field", 1)[0], moments=None, inertia=MATRIX), 1.0
        ),
    },
    "edges": {
        str(n): partial(lambda omega, moments: (Scene("", omega, moments), 1.0), *edge)
        for n, edge in enumerate(EDGES)
    },
    "from rest": {
        "recorded": lambda: (
            Scene("", REST, (1.0, 2.0, 2.5),
                  torque=lambda t, w: [t, t * t - w[0], np.sin(t)]), 4.0,
        ),
        "fast sine": partial(_law, TorqueLaw(sines=[((1e-9, 2e-9, -3e-9), 20.0)]), REST, 1.0),
        "constant": partial(_law, TorqueLaw((5.0, 3.0, 1.0)), REST),
        "ramp": partial(_law, TorqueLaw(rate=(90.0, 60.0, 70.0)), REST, -2.0),
        "sine": partial(_law, TorqueLaw(sines=[((50.0, 30.0, 10.0), 2.0)]), REST),
        "about one axis": partial(_law, TorqueLaw(sines=[((0.0, 0.0, 10.0), 2.0)]), REST),
        "faint": partial(_law, TorqueLaw((2e-40, -3e-40, 1e-40), (0.0, 1e-40, 0.0)), REST),
        "slow sine": partial(_law, TorqueLaw(sines=[((0.0, 0.0, 2e3), 1e-12)]), REST, -2.5),
    },
}  # fmt: skip


@cache
def motions(kind: str) -> dict[str, Motion]:
    """Return the true motions of the scenes of a kind, each at two times."""
    found = {}
    for name, drawn in KINDS[kind].items():
        scene, time = drawn()
        found[name] = true_motion(scene, [0.37 * time, time])
    return found
