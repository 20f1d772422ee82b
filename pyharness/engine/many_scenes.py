"""Conversion of scenes to the arrays of `solve_many`."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pyharness.engine.many_prepared import rotated, turned_back
from pyharness.model.arrays import (
    check_rows,
    count_bodies,
    row_of,
    rows_of,
    unit_quaternions,
    waves_of,
)
from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError
from pyharness.model.principal import axes_and_turn, principal
from pyharness.model.scene import STATE_TORQUE, Scene, checked_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.model.waves import with_merged_rows

_MOST_KEPT = 8  # scenes whose arrays are kept
_BODIES = ("moments", "inertia", "coefficients")


class Axes:
    """The principal axes of n bodies, or one set for all, and conversions to and from them."""

    def __init__(self, axes: Array, turns: Array) -> None:
        """Store the axes as columns, (n, 3, 3), and as quaternions, (n, 4)."""
        self.axes, self.turns = axes, turns

    def about_principal(self, given: dict[str, Any], names: Iterable[str]) -> None:
        """Convert `omega0` and `attitude0` of `given`, if in `names`, to principal axes."""
        if "omega0" in names:
            rows = rows_of("omega0", given["omega0"], 3)
            self._check("omega0", rows)
            given["omega0"] = rotated(rows, self.axes.transpose(0, 2, 1))
        if "attitude0" in names:
            attitudes = unit_quaternions(rows_of("attitude0", given["attitude0"], 4))
            self._check("attitude0", attitudes)
            conjugate = self.turns * np.array([1.0, -1.0, -1.0, -1.0])
            given["attitude0"] = turned_back(attitudes, conjugate)

    def give_back(self, omega: Array, attitude: Array | None) -> None:
        """Convert final omegas, (n, 3), and attitudes, (n, 4), back in place."""
        omega[:] = rotated(omega, self.axes)
        if attitude is not None:
            attitude[:] = turned_back(attitude, self.turns)

    def _check(self, name: str, rows: Array) -> None:
        if len(self.axes) != 1:
            check_rows(name, rows, len(self.axes))


def from_rows(rows: Sequence[Scene | None]) -> tuple[dict[str, Any], Axes]:
    """Return scenes with full inertia matrices as arrays about principal axes, and these axes.

    None becomes NaN. The arrays have A, B, C, because rounded moments would be less accurate.
    """
    each = [_REFUSED if scene is None else _full_row(scene) for scene in rows]
    axes = Axes(np.array([row["axes"] for row in each]), np.array([row["turn"] for row in each]))
    return _stacked(each), axes


_NONE = (math.nan, math.nan, math.nan)
_REFUSED: dict[str, Any] = {
    "coefficients": _NONE, "omega0": _NONE, "torque_constant": _NONE, "torque_rate": _NONE,
    "sines": [], "cosines": [], "axes": np.eye(3), "turn": IDENTITY, "attitude0": None,
}  # fmt: skip


def _full_row(scene: Scene) -> dict[str, Any]:
    turned, axes = principal(scene)
    law, moments = turned.body_torque, np.array(turned.moments)
    return {
        "coefficients": turned.euler_coefficients,
        "omega0": turned.omega,
        "torque_constant": np.array(law.constant) / moments,
        "torque_rate": np.array(law.rate) / moments,
        "sines": [[*(np.array(wave) / moments), frequency] for wave, frequency in law.sines],
        "cosines": [[*(np.array(wave) / moments), frequency] for wave, frequency in law.cosines],
        "axes": axes,
        "turn": axes_and_turn(scene)[1],
        "attitude0": turned.attitude,
    }


def _filled(laws: list[Any]) -> list[Any]:
    most = max(map(len, laws))
    return [waves + [[0.0] * 4] * (most - len(waves)) for waves in laws]


def _from_scene(scene: Scene) -> dict[str, Any]:
    law = checked_scene(scene).body_torque
    kind = "coefficients" if scene.moments is None else "moments"
    return {
        kind: getattr(scene, kind),
        "omega0": scene.omega,
        "torque_constant": law.constant,
        "torque_rate": law.rate,
        "sines": [[*amplitude, frequency] for amplitude, frequency in law.sines],
        "cosines": [[*amplitude, frequency] for amplitude, frequency in law.cosines],
        "attitude0": scene.attitude,
    }


_kept: dict[int, tuple[Scene, dict[str, Any]]] = {}


def rows_of_scene(scene: Scene) -> dict[str, Any]:
    """Return the shared, read-only `checked_rows` of a scene, with its `merged` torque.

    They are cached, because for few bodies their conversion takes longer than the solution.
    """
    # The key is the identity, because equal scenes may differ in the signs of zeros. An entry keeps
    # its scene alive, so that no other object gets its identity.
    found = _kept.get(id(scene))
    if found is not None:
        return found[1]
    rows: dict[str, Any] = checked_rows(_from_scene(scene))
    rows["merged"] = with_merged_rows(rows["torque_constant"], rows["sines"], rows["cosines"])
    if len(_kept) >= _MOST_KEPT:
        _kept.clear()
    _kept[id(scene)] = scene, rows
    return rows


def checked_rows(given: Mapping[str, Any]) -> dict[str, Array]:
    """Return float arrays with one row per body, or one for all; raise InputError otherwise."""
    rows = {}
    for name, convert in _CONVERSIONS.items():
        values = given.get(name)
        if values is not None or (name == "t_end" and name in given):
            rows[name] = convert(values)
    return rows


def check_alike(scenes: Sequence[Scene]) -> None:
    """Raise InputError if only some scenes have attitudes, or their step sizes differ."""
    if len({each.step_size for each in scenes}) > 1:
        raise InputError("the scenes have different step sizes; allowed: one step size for all")
    if len({each.attitude is None for each in scenes}) > 1:
        raise InputError(
            "some of the scenes have an attitude and others have none; allowed: all, or none"
        )


def from_scenes(scenes: Sequence[Scene]) -> dict[str, Any]:
    """Return the arrays of scenes, or raise InputError if one kernel call can't solve all."""
    if not scenes:
        raise InputError("the sequence of scenes is empty; give at least one scene")
    check_alike(scenes)
    rows = [_from_scene(each) for each in scenes]
    if len({"moments" in row for row in rows}) > 1:
        raise InputError(
            "some bodies are given by coefficients and others are not; allowed: "
            "coefficients for all, or for none"
        )
    return _stacked(rows)


def _stacked(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {"attitude0": None}
    for name in ("moments", "coefficients", "omega0", "torque_constant", "torque_rate"):
        if name in rows[0]:
            found[name] = np.array([row[name] for row in rows])
    for name in ("sines", "cosines"):
        found[name] = _filled([row[name] for row in rows])
    if any(row["attitude0"] is not None for row in rows):
        found["attitude0"] = np.array([row["attitude0"] or IDENTITY for row in rows])
    return found


# In the order in which `solve_many` checks its arrays.
_CONVERSIONS: dict[str, Callable[[Any], Array]] = {
    **{
        name: lambda values, name=name: rows_of(name, values, 3)  # type: ignore[misc]
        for name in ("omega0", "moments", "coefficients", "torque_constant", "torque_rate")
    },
    "sines": partial(waves_of, "sines"),
    "cosines": partial(waves_of, "cosines"),
    "t_end": partial(rows_of, "t_end"),
    "attitude0": lambda values: rows_of("attitude0", values, 4),
}


def inertia_scenes(scene: Scene, arrays: dict[str, Any]) -> list[Scene | None]:
    """Return the scene of each body; None for a body with invalid numbers."""
    rows = rows_of_bodies(arrays)
    found: list[Scene | None] = []
    for i in range(count_bodies(rows)):
        try:
            found.append(scene_of_row(scene, rows, i))
        except InputError:
            found.append(None)
    return found


def rows_of_bodies(arrays: dict[str, Any]) -> dict[str, Array]:
    """Return the arrays of bodies and torques that are not None, with checked shapes."""
    shapes = {"moments": (3,), "inertia": (3, 3), "torque_constant": (3,), "torque_rate": (3,)}
    rows = {}
    for name, values in arrays.items():
        if values is not None and name in shapes:
            rows[name] = rows_of(name, values, *shapes[name])
        elif values is not None and name in ("sines", "cosines"):
            rows[name] = waves_of(name, values)
    return rows


def scene_of_row(scene: Scene, rows: Mapping[str, Array], i: int) -> Scene:
    """Return the scene of body `i`, or raise InputError if its numbers are invalid."""
    own = {name: row_of(each, i) for name, each in rows.items()}
    torque: dict[str, Any] = {
        name.removeprefix("torque_"): own.pop(name)
        for name in ("torque_constant", "torque_rate", "sines", "cosines")
        if name in own
    }
    for name in ("sines", "cosines"):
        if name in torque:
            torque[name] = [(wave[:3], float(wave[3])) for wave in torque[name]]
    if own.keys() & _BODIES:
        own = {**dict.fromkeys(_BODIES), **own}
    for name in ("omega", "attitude"):
        if f"{name}0" in own:
            own[name] = own.pop(f"{name}0")
    law = scene.torque
    if torque:
        if isinstance(law, StateTorque):
            raise InputError(STATE_TORQUE)
        law = replace(law, **torque)
    return replace(scene, torque=law, **own)
