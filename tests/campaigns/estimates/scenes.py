"""Random scenes of the campaign, calm and wild, each drawn from a seed and a number.

Every draw has a kind of torque, of body and of motion. Independently of these it may have an
attitude, a full inertia matrix, a torque about the axes of space, and times before the last.
"""

import math
from dataclasses import dataclass, replace
from random import Random

import numpy as np

from pyharness.bench.random_loads import BODIES, LAWS, SPEEDS, WAVES, by_torque
from pyharness.engine.problem.rotated import rotated
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw, Wave
from tests.campaigns.estimates.truth import Truth, truth_of
from tests.checks.scenes.timed_kinds import NASTY, timed_scenes, triple

_MOST_TURNS = 330.0
_SHORT = 0.3  # fraction of scenes that end within a revolution or a few
COARSEST, FINEST = 1e-3, 1e-13
# The nasty scenes with a possible body and without extreme units of time or moment.
_ROUGH = tuple(name for name in NASTY if name not in ("no body", "other units"))
# The kinds of motion, used in turn; "plain" comes twice.
_WAYS = (
    "plain", "near the middle axis", "plain", "strong torque", "rough", "steady", "cancelling",
    "slow",
)  # fmt: skip
ATTITUDE, INERTIA, IN_SPACE, SEVERAL = (
    "attitude", "full inertia", "torque in space", "several times",
)  # fmt: skip
KINDS = (
    "all", *LAWS, *SPEEDS, *BODIES, *dict.fromkeys(_WAYS[:4] + _WAYS[5:]),
    *(f"rough: {name}" for name in _ROUGH), ATTITUDE, INERTIA, IN_SPACE, SEVERAL,
    "forward", "backward",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Draw:
    """The scene, times and tolerance drawn for a number of a seed."""

    number: int
    scene: Scene
    times: tuple[float, ...]  # s, of one sign, in order away from 0
    tolerance: float
    kinds: tuple[str, ...]  # of `KINDS`
    truth: Truth

    @property
    def attitude(self) -> bool:
        """Whether the attitude is requested."""
        return ATTITUDE in self.kinds

    @property
    def time(self) -> float:
        """The last time, s."""
        return self.times[-1]


def drawn(seed: str, number: int, tolerances: tuple[float, ...] = (), dressed: bool = True) -> Draw:
    """Return the draw for `number`, from 0 on, of a seed.

    Its tolerance is one of `tolerances`, by default any from `COARSEST` to `FINEST`. A scene is
    drawn again if the body turns more than some 300 times, or if the truth would take too many
    steps. Unless `dressed`, the scene has principal axes, no attitude and one time, and none of the
    kinds of motion after "rough".
    """
    source = Random(f"estimates/{seed}/{number}")
    law, place = LAWS[number % len(LAWS)], number // len(LAWS)
    ways = _WAYS if dressed else _WAYS[: _WAYS.index("rough") + 1]
    way = ways[place % len(ways)]
    while True:
        scene, time, kinds = _rough(source) if way == "rough" else _by_kind(source, law, way)
        times: tuple[float, ...] = (time,)
        more: list[str] = []
        if dressed:
            scene, more = _dressed(source, scene)
            times = _times(source, time)
        if len(times) > 1:
            more.append(SEVERAL)
        try:
            truth = truth_of(scene, times, attitude=ATTITUDE in more)
        except InputError:
            continue
        if truth.turns <= _MOST_TURNS:
            break
    of_its_own = Random(f"estimates/{seed}/{number}/tolerance")
    tolerance = COARSEST * (FINEST / COARSEST) ** of_its_own.random()
    if tolerances:
        tolerance = of_its_own.choice(tolerances)
    kinds = ("all", *kinds, *more, "backward" if time < 0.0 else "forward")
    return Draw(number, replace(scene, name=str(number)), times, tolerance, kinds, truth)


def _dressed(source: Random, scene: Scene) -> tuple[Scene, list[str]]:
    """Return the scene, perhaps with an attitude or a full inertia matrix, and the kinds added."""
    kinds = []
    if source.random() < 0.5:
        kinds.append(ATTITUDE)
        w, x, y, z = (source.gauss(0.0, 1.0) for _ in range(4))
        scene = replace(scene, attitude=(w, x, y, z))
        if scene.moments and not scene.torque.is_zero and source.random() < 0.4:
            kinds.append(IN_SPACE)
            scene = replace(scene, torque=replace(scene.law, frame="space"))
    if scene.moments and source.random() < 0.25:
        kinds.append(INERTIA)
        scene = _about_other_axes(source, scene)
    return scene, kinds


def _about_other_axes(source: Random, scene: Scene) -> Scene:
    """Return the scene about axes that are not principal; its inertia matrix is rounded."""
    a, b, _ = np.linalg.qr([[source.gauss(0.0, 1.0) for _ in range(3)] for _ in range(3)])[0]
    axes = np.array([a, b, np.cross(a, b)])

    def turn(vector: Triple) -> Triple:
        return triple(axes @ np.array(vector))

    matrix = axes @ np.diag(scene.moments or ()) @ axes.T
    bare = replace(scene, moments=None, inertia=(0.5 * (matrix + matrix.T)).tolist())
    if scene.law.frame == "space":
        return replace(bare, omega=turn(scene.omega))
    return rotated(bare, turn, body=False)


def _times(source: Random, end: float) -> tuple[float, ...]:
    """Return one to four times, all multiples of the unit in the last place of the last one."""
    unit = math.ulp(end)
    parts = [source.random() for _ in range(source.choice((0, 0, 0, 1, 3)))]
    before = {math.floor(part * abs(end) / unit) * unit for part in parts} - {0.0}
    return (*(math.copysign(t, end) for t in sorted(before)), end)


def _by_kind(source: Random, law: str, way: str) -> tuple[Scene, float, tuple[str, ...]]:
    body = source.choice(list(BODIES))
    speed = source.choice(list(SPEEDS)) if law in WAVES else ""
    scene, time = by_torque(source, "", law, speed, body)
    if way == "near the middle axis":
        start = math.hypot(*scene.omega)
        moments = scene.moments or (1.0, 1.0, 1.0)
        middle = moments.index(sorted(moments)[1])
        faint = start * 10.0 ** -source.uniform(1.0, 12.0)
        omega = np.array([faint * source.uniform(-1.0, 1.0) for _ in range(3)])
        omega[middle] += source.choice((-1.0, 1.0)) * start
        scene = replace(_pushed(scene, 10.0 ** -source.uniform(0.0, 10.0)), omega=triple(omega))
    elif way == "strong torque" and law != "no torque":
        factor = 10.0 ** source.uniform(0.0, 2.0)
        scene, time = _pushed(scene, factor), time * factor ** -source.random()
    elif way == "steady":
        scene = _steady(source, scene)
    elif way == "cancelling":
        scene = _cancelling(source, scene)
    elif way == "slow":
        time *= 10.0 ** -source.uniform(1.0, 6.0)
    if source.random() < _SHORT:
        time *= 10.0 ** -source.uniform(0.0, 2.0)
    if source.random() < 0.5:
        time = -time
    return scene, time, tuple(filter(None, (law, speed, body, way)))


def _steady(source: Random, scene: Scene) -> Scene:
    """Return a rotation that is steady up to rounding: about a principal axis, or by a torque.

    Of the rotations about an axis, half keep the scene's torque along this axis.
    """
    moments = scene.moments or (1.0, 1.0, 1.0)
    if source.random() < 0.4:
        x, y, z = scene.omega
        i1, i2, i3 = moments
        held = ((i3 - i2) * y * z, (i1 - i3) * z * x, (i2 - i1) * x * y)
        return replace(scene, torque=TorqueLaw(held))
    axis = source.randrange(3)

    def along(vector: Triple) -> Triple:
        return triple(np.where(np.arange(3) == axis, np.array(vector), 0.0))

    if source.random() < 0.5:
        scene = replace(scene, torque=TorqueLaw())
    return rotated(scene, along, body=False)


def _cancelling(source: Random, scene: Scene) -> Scene:
    """Return the scene with two more torques, which cancel except for a small part."""
    speed = math.hypot(*scene.omega)
    moments = np.array(scene.moments)
    large = 10.0 ** source.uniform(0.0, 4.0) * speed * speed
    amplitude = moments * large * np.array([source.uniform(-1.0, 1.0) for _ in range(3)])
    rest = 1.0 + 10.0 ** -source.uniform(6.0, 14.0) * source.choice((-1.0, 1.0))
    frequency = speed * 10.0 ** source.uniform(-1.0, 0.5)
    law, one, other = scene.law, triple(amplitude), triple(-amplitude * rest)
    if source.random() < 0.3:
        # The two torques alone, from rest or from an omega of the size that they can produce.
        law = TorqueLaw()
        small = large / speed * abs(rest - 1.0) * source.choice((0.0, 1.0))
        scene = replace(scene, omega=triple(small * np.array(scene.omega) / speed))
    pair: list[Wave]
    kind = source.choice(("sines", "cosines", "constant", "frequencies"))
    if kind == "constant":
        slow = speed * abs(rest - 1.0)
        constant = triple(np.array(law.constant) + amplitude)
        return replace(
            scene, torque=replace(law, constant=constant, cosines=(*law.cosines, (other, slow)))
        )
    if kind == "frequencies":
        kind, pair = "sines", [(one, frequency), (triple(-amplitude), frequency * rest)]
    else:
        pair = [(one, frequency), (other, frequency)]
    if kind == "sines":
        return replace(scene, torque=replace(law, sines=(*law.sines, *pair)))
    return replace(scene, torque=replace(law, cosines=(*law.cosines, *pair)))


def _pushed(scene: Scene, factor: float) -> Scene:
    """Return the scene with its torque multiplied by `factor`."""

    def times(values: Triple) -> Triple:
        return values[0] * factor, values[1] * factor, values[2] * factor

    return replace(rotated(scene, times, body=False), omega=scene.omega)


def _rough(source: Random) -> tuple[Scene, float, tuple[str, ...]]:
    name = source.choice(_ROUGH)
    scene, time = next(timed_scenes(name, source.getrandbits(64)))
    return scene, time, (f"rough: {name}",)
