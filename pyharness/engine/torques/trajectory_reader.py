"""Reading of the files that `Trajectory.save` writes; every value is checked."""

import itertools
import math
import os
from dataclasses import fields, replace
from typing import Any

import numpy as np

from pyharness.engine.torques.scene_reader import scene_of_file
from pyharness.model.archive import checked_path, read_archive, text_of
from pyharness.model.changing import ChangingInertia, ChangingMoments
from pyharness.model.errors import InputError
from pyharness.model.fields import FACTS, ROWS
from pyharness.model.inertia_function import COUNTS, InertiaFunction, checked_function
from pyharness.model.json_text import unique
from pyharness.model.own_states import checked_states
from pyharness.model.principal import PrincipalScene
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import ENDINGS, STOP_VARIABLES, Array, Stop, Trajectory
from pyharness.model.trajectory_file import (
    AXES,
    EVENTS,
    KIND,
    MOST_FUNCTIONS,
    OWN,
    SENSITIVITIES,
    tape_of,
)
from pyharness.model.values import three_floats

_WRITTEN = "a file that Trajectory.save wrote"
_CHANGING = {each.place: each for each in (ChangingMoments, ChangingInertia)}


def load(path: str | os.PathLike[str]) -> Trajectory:
    """Return the trajectory that `Trajectory.save` wrote to a file.

    All numbers, and the results of the trajectory's methods, are bit-for-bit the same. A torque
    that scene files can't describe becomes a recorded torque.

    Parameters
    ----------
    path : str or path
        The path of the file.

    Returns
    -------
    Trajectory
        The trajectory, with its scene if it had one.

    Raises
    ------
    InputError
        If the file can't be read, was not written by `Trajectory.save`, has another version, was
        changed or damaged, or is larger than a quarter of this machine's memory.

    Examples
    --------
    >>> from pyharness import case_scene, load, solve
    >>> solve(case_scene(1), [1.0, 2.0]).save("case-1.npz")
    >>> load("case-1.npz").omega[-1]
    array([6., 6., 6.])
    """
    name = checked_path("trajectory file", path)
    where = f"trajectory file '{name}'"
    names = {"scene", *ROWS, OWN, AXES, *EVENTS, SENSITIVITIES}
    arrays, header = read_archive(where, name, (KIND, "trajectory"), names, _WRITTEN)
    try:
        return _trajectory(arrays, header, where)
    except InputError as error:
        shown = str(error)
        raise InputError(shown if shown.startswith(where) else f"{where}: {shown}") from None
    except Exception:
        raise InputError(f"{where}: a value is missing or damaged; give {_WRITTEN}") from None


def _trajectory(arrays: dict[str, Any], header: dict[str, Any], where: str) -> Trajectory:
    rows: dict[str, Any] = {name: arrays.get(name) for name in ROWS}
    count = len(arrays["time"])
    for name, each in ROWS.items():
        if rows[name] is not None:
            _check_array(rows[name], each.kind, count, *each.shape)
    if rows["recorded_time"] is None:
        rows["recorded_time"] = rows["time"]
    axes, own, scene = arrays.get(AXES), arrays.get(OWN), None
    if axes is not None:
        _check_array(axes, "f8", 3, 3)
    _require(rows["omega"] is not None and header["ended"] in ENDINGS)
    if header["scene"] is not None:
        scene = _scene(text_of(arrays, "scene"), header["scene"], where)
    n_own = 0 if own is None else own.shape[1]
    if own is not None:
        _check_array(own, "f8", count, n_own)
    _require(scene is None or n_own == len(scene.states))
    n = 3 if rows["attitude"] is None else 7
    t_events, y_events = _events(arrays, rows["time"], n + n_own)
    sensitivities = None
    names: Any = header.get(SENSITIVITIES)
    if names is not None or SENSITIVITIES in arrays:
        array, counts = arrays[SENSITIVITIES], [_count(each) for _, each in names]
        _check_array(array, "f8", count, n + n_own, sum(counts))
        _require(all(type(name) is str for name, _ in names))
        parts = np.split(array, np.cumsum(counts)[:-1], axis=2) if counts else []
        sensitivities = unique(zip((name for name, _ in names), parts, strict=True))
    stop = None
    if header["stop"] is not None:
        stop = Stop(**header["stop"])
        _require(stop.variable in STOP_VARIABLES and type(stop.quotient) is float)
        stop = replace(stop, step=_count(stop.step))
    for name, kind in FACTS.items():
        value = header.get(name)
        _require(kind is int or isinstance(value, kind))
        rows[name] = _count(value) if kind is int else value
    return Trajectory(
        **rows,
        own=own,
        axes=axes,
        stop=stop,
        moments=_moments(header["moments"]),
        scene=scene,
        t_events=t_events,
        y_events=y_events,
        sensitivities=sensitivities,
    )


def _events(
    arrays: dict[str, Any], rows: Array, width: int
) -> tuple[list[Array] | None, list[Array] | None]:
    if not any(name in arrays for name in EVENTS):
        return None, None
    counts, times, states = (arrays[name] for name in EVENTS)
    n = len(times)
    _check_array(counts, "i8", len(counts))
    _check_array(times, "f8", n)
    _check_array(states, "f8", n, width)
    lengths = counts.tolist()
    _require(len(lengths) <= MOST_FUNCTIONS and min(lengths, default=0) >= 0)
    _require(sum(lengths) == n and np.isfinite(times).all())
    ends = list(itertools.accumulate(lengths))
    parts = [slice(end - length, end) for end, length in zip(ends, lengths, strict=True)]
    # Event times are in the order of the rows; with fewer than two rows, this is unknown.
    signs = (math.copysign(1.0, rows[-1] - rows[0]),) if len(rows) > 1 else (1.0, -1.0)
    for part in parts:
        _require(any((np.diff(sign * times[part]) >= 0.0).all() for sign in signs))
    return [times[part] for part in parts], [states[part] for part in parts]


def _scene(text: str, record: dict[str, Any], where: str) -> Scene:
    scene = scene_of_file(text.encode(), "", where)
    if "inertia" in record:
        scene = replace(scene, moments=None, changing=_moments(record["inertia"]))
    if record["torque"] is not None:
        states = checked_states(unique((name, pair) for name, *pair in record.get("states", ())))
        tape = tape_of(record["torque"], len(states))
        names = tuple(each.name for each in states)
        torque = StateTorque(tape, None, tape.needs_attitude, own=names)
        scene = replace(scene, torque=torque, states=states)
    others = {name: record[name] for name in ("masses", "forces", "case")}
    if record["moments_low"] is None:
        return replace(scene, **others)
    same = {each.name: getattr(scene, each.name) for each in fields(scene) if each.init}
    low = three_floats("moments_low", record["moments_low"])
    return PrincipalScene(**same | others, moments_low=low)


def _moments(record: Any) -> Any:
    if isinstance(record, dict):
        ((place, values),) = record.items()
        if isinstance(values, dict):
            tape = tape_of(values, 0, COUNTS[place])
            return checked_function(InertiaFunction(place, tape))
        return _CHANGING[place](values)
    return None if record is None else three_floats("moments", record)


def _count(value: Any) -> int:
    _require(type(value) is int and value >= 0)
    return int(value)


def _check_array(array: Any, kind: str, *shape: int) -> None:
    _require((array.dtype, array.shape) == (kind, shape))


# `load` converts the ValueError to a message.
def _require(holds: object) -> None:
    if not holds:
        raise ValueError("a damaged value")
