"""Problems and contenders of `bench --terms`, for torques that depend on the state."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from pyharness.bench.contenders import (
    TOLERANCES,
    Maker,
    SceneContender,
    list_own_contenders,
    prepared_maker,
)
from pyharness.bench.ensemble_contenders import EnsembleContender, EnsembleLoad, own_ensembles
from pyharness.bench.ensemble_peers import ensemble_peers
from pyharness.bench.measure import Workload
from pyharness.bench.peers import Formula, heyoka_maker, peers
from pyharness.checks.scenes.random_scenes import text_generator
from pyharness.engine.prepared.solver import prepare
from pyharness.engine.torques.term_file import KINDS
from pyharness.model.scene import Scene
from pyharness.model.values import Triple
from pyharness.truth.reference import reference

OURS, HEYOKA, DOP853 = "auto", "heyoka", "solve_ivp-dop853"
VARIATIONAL = "heyoka-variational"
MANY_OURS, MANY_HEYOKA = "taylor", "heyoka-batch"
ONE_TOLERANCE = 1e-9  # for solvers compared with ours at one tolerance
# Coarser tolerances do not change our steps. The finest is heyoka's default.
_TOLERANCES = (*(each for each in TOLERANCES if each <= 1e-3), 2.0**-52)

HORIZONS = (10.0, 100.0)  # end times of a single body, s
READY, EXPRESSION = "ready term", "expression"
_MOMENTS: Triple = (1.0, 2.0, 2.5)  # kg m2
_OMEGA: Triple = (0.3, 0.2, 0.9)  # rad/s
_SPREAD = 0.2  # largest deviation of a component of a body's initial omega from _OMEGA, rad/s
_ATTITUDE = (0.6, 0.0, 0.8, 0.0)

_TARGET = (0.1, 0.2, 0.5)


@dataclass(frozen=True)
class TermScene:
    """A scene with a ready-made torque (READY) or a recorded function (EXPRESSION)."""

    kind: str
    scene: Scene
    formula: Formula | None = None  # independent implementation of a ready-made torque


@dataclass(frozen=True, eq=False)
class TermBodies(EnsembleLoad):
    """Bodies with different initial omegas and one torque, which depends on the state."""

    body: Scene  # moments, torque and initial attitude of all bodies

    @property
    def scene(self) -> Scene:
        return self.body

    def scenes(self) -> Iterator[Scene]:
        for start in self.omega0.tolist():
            yield replace(self.body, omega=start)


def term_scenes() -> list[TermScene]:
    found = []
    for name, ready in KINDS.items():
        if ready.leaves:
            formula = FORMULAS.get(name)
            scene = _scene(name.replace("_", " "), ready.function(**ready.sample))
            found.append(TermScene(READY, scene, formula and partial(formula, **ready.sample)))
    return found + [TermScene(EXPRESSION, _scene(*each)) for each in EXPRESSIONS.items()]


def _scene(name: str, torque: Any) -> Scene:
    scene = Scene(name, _OMEGA, _MOMENTS, torque=torque)
    return replace(scene, attitude=_ATTITUDE) if scene.torque.needs_attitude else scene


def term_loads(scenes: Sequence[TermScene]) -> list[Workload]:
    found = []
    for each, time in product(scenes, HORIZONS):
        scene, scale = each.scene, max(map(abs, each.scene.omega))
        truth = reference(scene, [time])
        found.append(Workload(scene.name, scene, time, (each.kind,), truth, scale=scale))
    return found


def term_bodies(scenes: Sequence[TermScene], seed: str, n: int) -> list[TermBodies]:
    source = text_generator(f"terms/{seed}")
    omega0 = np.array(_OMEGA) + source.uniform(-_SPREAD, _SPREAD, (n, 3))
    horizon = HORIZONS[0]
    of = (each.scene for each in scenes)
    return [TermBodies(scene.name, omega0, None, scene, horizon=horizon) for scene in of]


def _wind(t: Any, w: Any, q: Any) -> Any:
    scalar, vector = q[0], q[1:]
    stream = np.array([1.0, 0.2, 0.0])
    flow = stream + 2.0 * np.cross(vector, np.cross(vector, stream) - scalar * stream)
    return 0.1 * flow[0] * np.cross([0.3, 0.0, 0.1], flow) - 0.05 * w


def _beacon(t: Any, w: Any, q: Any) -> Any:
    north = 2.0 * (q[1] * q[3] - q[0] * q[2])
    return [0.1 * np.sin(0.5 * t) * north, -0.1 * w[1], 0.1 * north * north - 0.1 * w[2]]


EXPRESSIONS: dict[str, Callable[..., Any]] = {
    "quadratic drag": lambda t, w: -0.1 * w * np.sqrt(w @ w + 0.01),
    "saturated control": lambda t, w: -0.3 * (w - np.array(_TARGET)) / np.sqrt(1.0 + w @ w),
    "smooth friction": lambda t, w: -0.1 * np.tanh(3.0 * w),
    "gust": lambda t, w: [
        0.3 * np.exp(-0.1 * (t - 4.0) ** 2),
        -0.05 * w[1],
        0.1 * np.exp(-w[2] * w[2]),
    ],
    "rotor": lambda t, w: (
        0.4 * np.cross([0.1, 0.3, 0.9], w) + [0.1 * np.sin(1.7 * t + 0.4 * w[0]), 0.0, 0.0]
    ),
    "swing": lambda t, w: np.array([0.2, -0.1, 0.15]) * np.cos(2.0 * w[0] + w[1]) - 0.05 * w,
    "fading wheel": lambda t, w: (
        np.cross(w, [0.5, 0.1, 0.2]) / (1.0 + 0.1 * t * t) - 0.02 * w / (1.0 + w @ w)
    ),
    "spring": lambda t, w, q: -0.4 * q[0] * q[1:] - 0.1 * w,
    "wind": _wind,
    "beacon": _beacon,
}

# Formulas of docs/how-to/torques.md for the samples of ready torques; arguments as in `Formula`.


def _cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _about_body(vector: Sequence[Any], q: Sequence[Any]) -> list[Any]:
    """Return R^T times a vector, where R rotates from body to space."""
    a, b, c, d = q
    x, y, z = vector
    rows = [
        [1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
        [2.0 * (b * c + a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d - a * b)],
        [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c)],
    ]
    return [first * x + second * y + third * z for first, second, third in zip(*rows, strict=True)]


def _damping(t: Any, w: Any, q: Any, sin: Any, cos: Any, matrix: Any) -> Sequence[Any]:
    return [-d * each for d, each in zip(matrix, w, strict=True)]


def _drag(
    t: Any, w: Any, q: Any, sin: Any, cos: Any, coefficients: Any, per_axis: bool
) -> Sequence[Any]:
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    return [-coefficients[1] * square * each for each in w]


def _rate_control(
    t: Any, w: Any, q: Any, sin: Any, cos: Any, gain: Any, target: Any
) -> Sequence[Any]:
    return [-gain * (each - wanted) for each, wanted in zip(w, target, strict=True)]


def _attitude_control(
    t: Any, w: Any, q: Any, sin: Any, cos: Any, stiffness: Any, gain: Any, target: Any
) -> Sequence[Any]:
    return [-2.0 * stiffness * q[0] * q[i + 1] - gain * w[i] for i in range(3)]


def _wheels(t: Any, w: Any, q: Any, sin: Any, cos: Any, momentum: Any, motor: Any) -> Sequence[Any]:
    h = [start + push * t for start, push in zip(momentum, motor, strict=True)]
    return [-turn - push for turn, push in zip(_cross(w, h), motor, strict=True)]


def _gravity_gradient(
    t: Any, w: Any, q: Any, sin: Any, cos: Any, inertia: Any, rate: Any
) -> Sequence[Any]:
    r = _about_body([cos(rate * t), sin(rate * t), 0.0], q)
    weighted = [moment * each for moment, each in zip(inertia, r, strict=True)]
    return [3.0 * rate**2 * each for each in _cross(r, weighted)]


def _magnetic_dipole(
    t: Any, w: Any, q: Any, sin: Any, cos: Any, moment: Any, field: Any
) -> Sequence[Any]:
    ((swing, frequency),) = field.sines
    wave = sin(frequency * t)
    value = [base + part * wave for base, part in zip(field.constant, swing, strict=True)]
    return _cross(moment, _about_body(value, q))


def _magnetic_damping(
    t: Any, w: Any, q: Any, sin: Any, cos: Any, gain: Any, field: Any
) -> Sequence[Any]:
    b = _about_body(field, q)
    return [gain * each for each in _cross(_cross(w, b), b)]


def _in_space(t: Any, w: Any, q: Any, sin: Any, cos: Any, torque: Any) -> Sequence[Any]:
    return _about_body(torque, q)


# By the names of ready torques; without a formula, heyoka integrates the recorded torque.
FORMULAS: dict[str, Callable[..., Sequence[Any]]] = {
    "damping": _damping, "drag": _drag, "rate_control": _rate_control,
    "attitude_control": _attitude_control, "wheels": _wheels,
    "gravity_gradient": _gravity_gradient, "magnetic_dipole": _magnetic_dipole,
    "magnetic_damping": _magnetic_damping, "in_space": _in_space,
}  # fmt: skip


def term_methods(compiled: bool = False) -> list[SceneContender]:
    own = (each for each in list_own_contenders() if each.name == OURS)
    prepare = partial(prepared_maker, OURS, compiled=compiled)
    return [replace(each, prepare=prepare, settings=_TOLERANCES[:-1]) for each in own]


def term_leaves(scenes: Sequence[TermScene], compiled: bool) -> Counter[str]:
    own: Any = partial(prepare, compiled=compiled)
    solvers = [own(each.scene, attitude=each.scene.attitude is not None) for each in scenes]
    return Counter(str(each.leaves) for each in solvers)


def term_peers(scenes: Sequence[TermScene]) -> list[SceneContender]:
    """Return heyoka, heyoka with variational equations, and DOP853, installed or not."""
    formulas = {each.scene.name: each.formula for each in scenes}

    def prepare(scene: Scene, variational: bool = False) -> Maker:
        return heyoka_maker(scene, formulas[scene.name], variational=variational)

    known = {each.name: each for each in peers()}
    return [
        replace(known[HEYOKA], prepare=prepare, settings=_TOLERANCES),
        replace(
            known[VARIATIONAL],
            prepare=partial(prepare, variational=True),
            settings=(ONE_TOLERANCE,),
        ),
        replace(known[DOP853], settings=(ONE_TOLERANCE,)),
    ]


def body_contenders(compiled: bool = False) -> list[EnsembleContender]:
    found = [*own_ensembles(compiled), *ensemble_peers()]
    return [replace(each, threads=(1,)) for each in found if each.name in (MANY_OURS, MANY_HEYOKA)]
