"""Scenes that continue a trajectory."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.errors import InputError
from pyharness.model.values import finite

if TYPE_CHECKING:
    from pyharness.model.scene import Scene
    from pyharness.model.trajectory import Trajectory


def scene_at(found: "Trajectory", time: float | None) -> "Scene":
    """Return the scene of a trajectory with the state at `time` (s), by default the last."""
    if found.scene is None:
        raise InputError("scene_at: the trajectory has no scene; allowed: one that solve returned")
    scene: Any = found.scene
    time = _last_time(found) if time is None else finite("scene_at: time", time)
    state = _state_at(found, time)
    end = len(state) - len(scene.states)
    states = scene.states
    if states:
        own = state[end:].tolist()
        states = tuple(x._replace(start=value) for x, value in zip(states, own, strict=True))
    attitude = tuple(state[3:end].tolist()) or scene.attitude
    if len(state) - len(states) == 3 and attitude is not None:
        raise InputError("scene_at: the attitude was not computed; give attitude=True")
    omega = tuple(state[:3].tolist())
    continued: Scene = replace(scene, omega=omega, attitude=attitude, states=states, t0=time)
    return continued


def _last_time(found: "Trajectory") -> float:
    events = found.t_events or [] if found.ended == "event" else []
    ends = np.concatenate([found.time[-1:], *events])
    if not ends.size:
        raise InputError("scene_at: the trajectory has no row; allowed: a time of dense output")
    start = 0.0 if found.scene is None else found.scene.t0
    last: float = ends[np.abs(ends - start).argmax()]
    return float(last)


def _state_at(found: "Trajectory", time: float) -> Array:
    rows = [(found.time, found.y.T), *zip(found.t_events or [], found.y_events or [], strict=True)]
    for times, states in rows:
        for k in np.flatnonzero(times == time):
            state: Array = states[k]
            return state
    if found.sol is None:
        raise InputError(
            f"scene_at: no row or event is at {time:.16g} s; allowed: their times, or dense output"
        )
    return found.sol(time)
