"""Trial of torque-free attitudes."""

import math
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.hold import FORMS, refusable, scene_of
from pyharness.checks.judge import (
    MethodRun,
    Policy,
    Truth,
    by_rows,
    judge,
    linear,
    lively,
    tolerance_of,
    unknown_flow,
)
from pyharness.checks.scenes.extreme import EXTREMES, POINTED
from pyharness.checks.scenes.random_scenes import random_scene
from pyharness.checks.stress import Trial, named
from pyharness.checks.theory.conditioning import (
    ATTITUDE,
    FLOW,
    ROUNDING,
    Conditioning,
    conditioning,
)
from pyharness.checks.tolerances import MIDDLING
from pyharness.checks.trials.length import CLOSED_FORM, MOTIONS
from pyharness.engine.plan.registry import METHODS
from pyharness.engine.problem.rotated import rotated
from pyharness.engine.solve import solve
from pyharness.model.attitude import SEQUENCES, Quaternion, angle_between, angles, product
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import Array, turned_to_space
from pyharness.truth.elliptic import torque_free
from pyharness.truth.free_attitude import free_attitude, period_of

# The limits of closed forms do not need the error amplification, whose computation takes long.
_unknown = partial(unknown_flow, 1.0)
_SERIES = ("taylor", "dop853")
_TOLERANCES = {"taylor": (1e-12, MIDDLING), "dop853": (MIDDLING,)}
# Rounding errors (rad) of three angles, which are formed, converted to degrees and read.
_ANGLES = 64.0 * ROUNDING
_OPERATIONS = Basis(
    "derived",
    "norm, angle per period and Euler angles of an attitude",
    "a count of the rounding errors (`checks/trials/attitude.py`)",
)
_BODIES = 8


@dataclass(frozen=True)
class Turn:
    """A rotation of a scene's body or space axes, and its inverse for quaternions, shape (n, 4)."""

    scene: Callable[[Scene], Scene]
    back: Callable[[Array], Array]


def _about_body(turn: Quaternion, vectors: Callable[[Triple], Triple], moments: bool) -> Turn:
    w, x, y, z = turn

    def scene(given: Scene) -> Scene:
        other = rotated(given, vectors, body=moments)
        return replace(other, attitude=product(given.attitude or POINTED, turn))

    return Turn(scene, lambda q: _product(q, (w, -x, -y, -z)))


TURNS = {
    # Axes 1, 2, 3 of the rotated body are axes 2, 3, 1 of the original.
    "cyclic": _about_body((0.5, 0.5, 0.5, 0.5), lambda v: (v[1], v[2], v[0]), True),
    "half-turn": _about_body((0.0, 1.0, 0.0, 0.0), lambda v: (v[0], -v[1], -v[2]), False),
    "space": Turn(
        lambda scene: replace(scene, attitude=product(POINTED, scene.attitude or POINTED)),
        lambda q: np.array(product((POINTED[0], *(-x for x in POINTED[1:])), q.T)).T,
    ),
}


def _limit(truth: Truth, tried: MethodRun) -> float:
    return linear(_allowed(tried.method, tolerance_of(tried), truth.flow, truth.end))


def _allowed(method: str, tolerance: float, flow: Conditioning, time: float) -> float:
    made = tolerance * lively(flow.amplification)
    return ATTITUDE if method in FORMS else flow.angle_limit(made, time)


POLICY = Policy(_limit, FLOW, refusable)
"""Policy whose limit is rounding for closed forms, else tolerance plus amplified rounding.

The tolerance is amplified too if the error amplification exceeds a thousand.
"""


def _truth(scene: Scene, time: float, flow: Callable[[], Conditioning]) -> Truth:
    q = np.array([[float(x) for x in free_attitude(scene, time)]])
    return Truth(np.array([time]), np.empty((0, 3)), 0.0, flow(), q, is_signed=True)


def _attempts() -> Iterator[Attempt]:
    for circumstance, scene, time in EXTREMES["attitude"]():
        name = named("attitude", "", circumstance, scene=scene)
        flow = cache(partial(conditioning, scene, time))
        for method in (*FORMS, *_SERIES):
            known = partial(_truth, scene, time, _unknown if method in FORMS else flow)
            for tolerance in _TOLERANCES.get(method, (METHODS["closed-form"].finest,)):
                own = replace(name, subject=method, setting=f"{tolerance:.0e}")
                yield Attempt(own, partial(_judged, known, tolerance))
    for motion, axial in MOTIONS.items():
        scene = replace(axial, attitude=POINTED)
        turn = 2.0 * math.pi / max(map(abs, scene.omega))
        for k in range(2, 13):
            known = partial(_truth, scene, 10.0 ** (0.5 * k) * turn, _unknown)
            where = f"revolutions-{10.0 ** (0.5 * k):.0f}"
            name = named("attitude", "closed-form", where, motion, scene=scene)
            yield Attempt(name, partial(_judged, known, METHODS["closed-form"].finest))
    for number in range(_BODIES):
        scene = random_scene("pointing", f"attitude {number}", f"random-{number}")
        name = named("attitude", "closed-form", "montgomery", f"random-{number}", scene=scene)
        yield Attempt(name, _montgomery)
        for method in ("closed-form", "taylor"):
            own = replace(name, subject=method)
            for what, each in TURNS.items():
                yield Attempt(replace(own, circumstance=what), partial(_check_rotated, each))
            yield Attempt(replace(own, circumstance="back"), _back)
    for sequence in SEQUENCES:
        for power in range(1, 18):
            name = named("attitude", "angles", sequence, f"{power if power < 17 else 'pole'}")
            yield Attempt(name, partial(_angles, 10.0**-power if power < 17 else 0.0))


def _judged(known: Callable[[], Truth], tolerance: float, name: Name) -> Iterator[Check]:
    scene, truth = scene_of(name), known()
    tried = by_rows(name.subject, tolerance, scene, [truth.end])
    # The signs of quaternions count, because they are continuous in time.
    yield judge(name.with_quantity("angle"), tried, truth, POLICY)
    answer = tried.answer
    if answer.attitude is None:
        return
    off = abs(float(np.linalg.norm(answer.attitude)) - 1.0)
    yield name.with_quantity("length").bounded(off, 8.0 * ROUNDING, _OPERATIONS)
    if name.subject in FORMS:
        # The angular momentum in space has the attitude's error, and omega's error (16 rounding
        # errors) times the moments.
        moments = np.array(scene.moments)
        momentum = moments * scene.omega
        largest = max(scene.moments or (1.0,)) * max(map(abs, scene.omega))
        off = 16.0 * ROUNDING * math.sqrt(3.0) * largest / (float(np.linalg.norm(momentum)) or 1.0)
        before = turned_to_space(np.array([scene.attitude]), momentum[None, :])[0]
        change = turned_to_space(answer.attitude, moments * answer.omega)[0] - before
        drift = float(np.linalg.norm(change)) / (float(np.linalg.norm(before)) or 1.0)
        yield name.with_quantity("momentum").bounded(drift, ATTITUDE + off, CLOSED_FORM)


def _montgomery(name: Name) -> Check:
    """Return the check of a body's rotation in a period against Montgomery's formula."""
    # The angle about the angular momentum L in a period T is 2 E T/L, with the energy E, minus the
    # solid angle that the direction of L encloses in the body. No other check detects a wrong rate
    # of this angle, because it is not conserved.
    scene = scene_of(name)
    period = float(period_of(scene) or 0.0)
    momentum = np.array(scene.moments) * scene.omega
    size = float(np.linalg.norm(momentum))
    energy = 0.5 * float(momentum @ scene.omega)
    area = _solid_angle(scene, period)
    wanted = 2.0 * energy * period / size - area
    q = solve(scene, [period], "closed-form", 1e-14, attitude=True).attitude
    assert q is not None
    w, x, y, z = scene.attitude or POINTED
    turn = _product(q, (w, -x, -y, -z))[0]
    along = turned_to_space(np.array([scene.attitude]), momentum[None, :] / size)[0]
    found = 2.0 * math.atan2(float(turn[1:] @ along), float(turn[0]))
    apart = abs(math.remainder(found - wanted, 2.0 * math.pi))
    limit = ATTITUDE + 8.0 * ROUNDING * (2.0 * energy * period / size + 2.0 * math.pi)
    return name.bounded(apart, limit, _OPERATIONS)


def _solid_angle(scene: Scene, period: float) -> float:
    """Return the solid angle that L's direction encloses in the body in a `period` (s)."""
    moments = np.array(scene.moments)
    before, count, rows = math.inf, 32, np.empty((0, 3))
    while True:  # the trapezoidal rule converges exponentially
        times = [period * n / count for n in range(count)]
        rows = np.array([[float(x) for x in torque_free(scene, t)] for t in times])
        m = rows * moments
        m /= np.linalg.norm(m, axis=1, keepdims=True)
        third = int(np.argmax(np.abs(m).min(axis=0)))
        axes = [(third + 1) % 3, (third + 2) % 3, third]
        m, omega = m[:, axes], rows[:, axes]
        if m[0, 2] < 0.0:
            # Rotate by 180 degrees about the first axis: the formula needs m[2] > 0.
            m, omega = m * [1.0, -1.0, -1.0], omega * [1.0, -1.0, -1.0]
        rate = np.cross(m, omega)
        found = float(((m[:, 0] * rate[:, 1] - m[:, 1] * rate[:, 0]) / (1.0 + m[:, 2])).mean())
        if abs(found - before) * period < 4.0 * ROUNDING * math.pi or count >= 1024:
            return found * period
        before, count = found, 2 * count


def _check_rotated(turn: Turn, name: Name) -> Check:
    scene, method, time, tolerance = scene_of(name), name.subject, 5.0, 1e-12
    run = partial(solve, times=[time], method=method, tolerance=tolerance, attitude=True)
    plain, other = run(scene).attitude, run(turn.scene(scene)).attitude
    assert plain is not None
    assert other is not None
    apart = 2.0 * float(np.linalg.norm(turn.back(other) - plain))
    limit = _allowed(method, tolerance, conditioning(scene, time), time)
    return name.bounded(apart, 2.0 * limit + 8.0 * ROUNDING, FLOW)


def _back(name: Name) -> Check:
    scene, method, time, tolerance = scene_of(name), name.subject, 5.0, 1e-12
    there = solve(scene, [time], method, tolerance, attitude=True)
    assert there.attitude is not None
    start = replace(scene, omega=there.omega[0].tolist(), attitude=there.attitude[0].tolist())
    again = solve(start, [-time], method, tolerance, attitude=True).attitude
    assert again is not None
    forth, back = conditioning(scene, time), conditioning(start, -time)
    # The forward run's error of omega rotates the body in the backward run.
    made = forth.limit(tolerance if method == "taylor" else 16.0 * ROUNDING)
    turns = made * back.amplification * math.sqrt(3.0) * back.largest * time
    limit = _allowed(method, tolerance, forth, time) + _allowed(method, tolerance, back, -time)
    apart = float(angle_between(again, np.array([scene.attitude]))[0])
    return name.bounded(apart, limit + turns, FLOW if method == "taylor" else CLOSED_FORM)


def _angles(off: float, name: Name) -> Check:
    """Return the check, against SciPy, of Euler angles at the distance `off` (rad) from a pole."""
    from scipy.spatial.transform import Rotation

    sequence = name.circumstance
    source, worst = random.Random(f"{sequence} {off}"), 0.0
    for _ in range(20):
        first, last = source.uniform(-math.pi, math.pi), source.uniform(-math.pi, math.pi)
        pole = source.choice((0.0, math.pi) if sequence == "3-1-3" else (-math.pi, math.pi))
        tilt = math.copysign(1.0, 1.0 - pole) * off + (pole if sequence == "3-1-3" else 0.5 * pole)
        q: Quaternion = (1.0, 0.0, 0.0, 0.0)
        for axis, angle in zip(sequence.split("-"), (first, tilt, last), strict=True):
            turn = [math.cos(0.5 * angle), 0.0, 0.0, 0.0]
            turn[int(axis)] = math.sin(0.5 * angle)
            q = product(q, (turn[0], turn[1], turn[2], turn[3]))
        told = angles(np.array([q]), sequence)[0]
        letters = "".join(" XYZ"[int(axis)] for axis in sequence.split("-"))
        back = Rotation.from_euler(letters, told, degrees=True).as_quat(scalar_first=True)
        worst = max(worst, float(angle_between(np.array([q]), back[None, :])[0]))
    return name.bounded(worst, _ANGLES, _OPERATIONS)


def _product(q: Array, by: Quaternion) -> Array:
    return np.array(product(q.T, by)).T


TRIAL = Trial(
    "attitude",
    "attitude without torque: separatrix, symmetry, 1e6 revolutions, rotated axes, angle poles",
    "Closed form: 20 rounding errors of each component at any time, 4.4e-15 rad. Other methods: "
    "tolerance and rounding errors, amplified by the motion, plus the growth of an error of "
    "omega with the angle of rotation. Rotation per period: the rounding errors of Montgomery's "
    "formula. Euler angles: the rounding errors of three angles, added.",
    lambda only: _attempts(),
)
