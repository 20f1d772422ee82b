"""Scenes that begin at another time than 0: solved with shifted times, and shifted back."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pyharness.engine.events.event_functions import EventFunction
from pyharness.engine.problem.problem import kept_of
from pyharness.engine.problem.rotated import call_later, restarted_at
from pyharness.model.array_type import Array
from pyharness.model.attitude import IDENTITY
from pyharness.model.dense_output import DenseOutput
from pyharness.model.errors import InputError, TimedError
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Trajectory

_TIME = re.compile(r"(?<=t = )[-+.e\d]+(?= s)")
_OF_LAW = ("torque.rate", "torque.sines", "torque.cosines")


def from_zero(scene: Scene) -> Scene:
    """Return the scene as a function of the time since `t0`; it is kept with the scene."""
    kept, key = kept_of(scene), "from 0"
    if key not in kept:
        turned = IDENTITY if scene.torque.needs_attitude else None
        attitude = scene.attitude or turned
        kept[key] = restarted_at(scene, np.array(scene.omega), scene.t0, attitude)
    found: Scene = kept[key]
    return found


def solve_from_zero(
    scene: Scene,
    times: Sequence[float],
    functions: Sequence[EventFunction] | None,
    sensitivities: Iterable[str] | None,
    solve: Callable[..., Trajectory],
) -> Trajectory:
    """Return the trajectory of a scene with `t0` at `times` (s), by a `solve` for those without."""
    by = scene.t0
    moved = [time - by for time in times]
    events = None if functions is None else events_from_zero(functions, by)
    names = None if sensitivities is None else _checked_names(scene, sensitivities)
    try:
        found = solve(from_zero(scene), moved, events=events, sensitivities=names)
    except TimedError as error:
        raise error.later(by) from None
    known = dict(zip(moved, times, strict=True))
    time = np.array([known.get(each, each + by) for each in found.time.tolist()])
    return found.with_values(
        time=time, recorded_time=time, scene=scene,
        moments=found.moments if scene.changing is None else scene.changing,
        sol=found.sol and _later_output(found.sol, by),
        reason=found.reason and _later_reason(found.reason, by),
        t_events=found.t_events and [each + by for each in found.t_events],
    )  # fmt: skip


def events_from_zero(functions: Sequence[EventFunction], by: float) -> list[Any]:
    return [
        replace(each.event, function=partial(call_later, each.event.function, by))
        for each in functions
    ]


def _checked_names(scene: Scene, names: Iterable[str]) -> list[str]:
    found = list(names)
    is_law = isinstance(scene.torque, TorqueLaw) and scene.torque.named is None
    for name in found:
        if is_law and name in _OF_LAW:
            raise InputError(
                f"sensitivities: {name} of a scene with t0 = {scene.t0:g} s; allowed: t0 = 0, or a "
                "function as torque, whose arguments have defaults"
            )
    return found


def _call_earlier(function: Callable[..., Array], by: float, times: Array, *rows: Array) -> Array:
    return function(times - by, *rows)


def _later_output(sol: DenseOutput, by: float) -> DenseOutput:
    states, rates = (partial(_call_earlier, each, by) for each in (sol.states, sol.rates))
    return replace(sol, t_min=sol.t_min + by, t_max=sol.t_max + by, states=states, rates=rates)


def _later_reason(reason: str, by: float) -> str:
    """Return a reason with its times, and the formula of a switch, as functions of the time."""
    text, found, formula = reason.partition("; it is the ")
    text = _TIME.sub(lambda time: f"{float(time[0]) + by:.6g}", text)
    old = f"t {'-' if by < 0.0 else '+'} {abs(by):.6g}"
    return text + found + formula.replace(f"({old})", "t").replace(old, "t")
