"""Transformations of a scene to an equivalent one: with other axes or signs, or a later time 0."""

import math
from collections.abc import Callable
from dataclasses import replace

from pyharness.model.attitude import Quaternion
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.model.trajectory import Array


def rotated(scene: Scene, turn: Callable[[Triple], Triple], body: bool) -> Scene:
    """Return the scene with the function `turn` applied to omega and to all vectors of the torque.

    `turn` takes and returns three components; for example, it permutes axes or changes signs. If
    `body` is true, `turn` is also applied to the moments. A torque about the axes of space is
    unchanged. The attitude is also unchanged, so that the caller must transform it if necessary.
    """

    def waves(each: tuple[Wave, ...]) -> tuple[Wave, ...]:
        return tuple((turn(amplitude), frequency) for amplitude, frequency in each)

    law = scene.law
    if not law.in_space:
        law = TorqueLaw(turn(law.constant), turn(law.rate), waves(law.sines), waves(law.cosines))
    return replace(
        scene,
        omega=turn(scene.omega),
        moments=turn(scene.moments) if body and scene.moments else scene.moments,
        torque=law,
    )


def restarted_at(
    scene: Scene, omega: Array, by: float, attitude: Quaternion | None = None
) -> Scene:
    """Return the scene whose time 0 is the time `by` (s) of the given scene.

    `omega` (rad/s) and `attitude` (a quaternion) are the state at time `by` and become the initial
    values. If `attitude` is None, the initial attitude of the given scene is used. The torque law
    is shifted in time. Raise InputError if the torque is about the axes of space and `attitude` is
    None.
    """
    law = scene.law
    if law.in_space and attitude is None:
        raise InputError(
            "a scene with a torque about the axes of space can't be restarted without the "
            "attitude at that time"
        )
    sines: list[Wave] = []
    cosines: list[Wave] = []

    def times(values: Triple, factor: float) -> Triple:
        return values[0] * factor, values[1] * factor, values[2] * factor

    for amplitude, frequency in law.sines:
        sines.append((times(amplitude, math.cos(frequency * by)), frequency))
        cosines.append((times(amplitude, math.sin(frequency * by)), frequency))
    for amplitude, frequency in law.cosines:
        cosines.append((times(amplitude, math.cos(frequency * by)), frequency))
        sines.append((times(amplitude, -math.sin(frequency * by)), frequency))
    c, r = law.constant, law.rate
    constant = (c[0] + r[0] * by, c[1] + r[1] * by, c[2] + r[2] * by)
    first, second, third = (float(w) for w in omega)
    return replace(
        scene,
        omega=(first, second, third),
        torque=TorqueLaw(constant, r, tuple(sines), tuple(cosines), law.frame),
        attitude=scene.attitude if attitude is None else attitude,
    )
