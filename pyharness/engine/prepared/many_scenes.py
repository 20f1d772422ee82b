"""Conversion of scenes to the arrays of `solve_many`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from pyharness.engine.system.parameters import torque_with_values
from pyharness.model.arrays import (
    check_rows,
    count_bodies,
    numbers_of,
    row_of,
    rows_of,
    spread,
    unit_quaternions,
)
from pyharness.model.attitude import quaternion_of_axes
from pyharness.model.codes import Statuses
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.inertia import SYMMETRIC, nearest_float, principal_frame
from pyharness.model.principal import PrincipalScene
from pyharness.model.scene import STATE_TORQUE, Scene, Triple, checked_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.model.waves import with_merged_rows

MERGED = ("torque_constant", "sines", "cosines")  # arrays that `with_merged_rows` may change
_MOST_KEPT = 8  # scenes whose arrays are kept
BODIES = ("moments", "inertia", "coefficients")
ONES: Triple = (1.0, 1.0, 1.0)
PARAMETER = "parameters: "  # before the names of parameters of a torque
PRINCIPAL = "principal"  # moments about principal axes over any number, beside coefficients
TORQUES = ("torque_constant", "torque_rate", "sines", "cosines")
_WAVES = ("sines", "cosines")
# The shapes of rows, in the order in which `solve_many` checks its arrays.
_SHAPES: dict[str, tuple[int, ...]] = {
    "omega": (3,), "moments": (3,), "coefficients": (3,), "inertia": (3, 3),
    "torque_constant": (3,), "torque_rate": (3,), "sines": (4,), "cosines": (4,), "t_end": (),
    "attitude": (4,), PRINCIPAL: (3,),
}  # fmt: skip


def about_principal(given: Mapping[str, Any]) -> tuple[dict[str, Any], Array, Array]:
    """Return `solve_many`'s arrays about principal axes, the axes (columns), and their quaternions.

    An invalid inertia has coefficients NaN.
    """
    rows = checked_rows({name: given[name] for name in given if name not in BODIES})
    matrices = rows_of("inertia", given["inertia"], 3, 3)
    law = {name: rows.pop(name) for name in TORQUES}
    n = count_bodies({"inertia": matrices, **law})
    for name in ("omega", "attitude"):
        if name in rows and n != 1:
            check_rows(name, rows[name], n)
    constant, sines, cosines = with_merged_rows(*(law[name] for name in MERGED))
    parts = constant[:, None], law["torque_rate"][:, None], sines[..., :3], cosines[..., :3]
    # One matrix may have the torques of many bodies.
    m = max(map(len, parts))
    is_free = not any(each.any() for each in parts)
    if len(matrices) > 1 and not is_free:
        m = n
    vectors = np.concatenate([spread(each, m) for each in parts], axis=1)
    of_matrix = np.empty((len(matrices), 0, 3))
    if not is_free:
        of_matrix = vectors.reshape(len(matrices), -1, 3) if len(matrices) else vectors
    numbers, axes, components = find_frames(matrices, of_matrix)
    if not is_free:
        vectors = components.reshape(vectors.shape)
    last = 2 + sines.shape[1]
    found: dict[str, Any] = {
        **rows,
        "coefficients": numbers[:, :3],
        PRINCIPAL: numbers[:, 3:6],
        "torque_constant": vectors[:, 0],
        "torque_rate": vectors[:, 1],
        "sines": np.concatenate([vectors[:, 2:last], spread(sines[..., 3:], m)], axis=2),
        "cosines": np.concatenate([vectors[:, last:], spread(cosines[..., 3:], m)], axis=2),
    }
    found = {name: np.ascontiguousarray(each) for name, each in found.items()}
    return found | rows_about(rows, axes, numbers[:, 6:]), axes, numbers[:, 6:]


def rows_about(rows: Mapping[str, Any], axes: Array, turns: Array) -> dict[str, Any]:
    """Return omegas and attitudes of `rows` about `axes` (columns) with quaternions `turns`."""
    found = {name: rows[name] for name in ("omega", "attitude") if name in rows}
    if "attitude" in found:
        found["attitude"] = unit_quaternions(found["attitude"])
    n = max([len(axes), *map(len, found.values())])
    found = {name: np.array(spread(each, n)) for name, each in found.items()}
    omega, attitude = (
        found.get(name, np.empty((0, width)))[:, None].T
        for name, width in (("omega", 3), ("attitude", 4))
    )
    conjugate = turns * np.array([1.0, -1.0, -1.0, -1.0])
    # Backwards, the axes are transposed.
    extension().turn_rows(axes.T, conjugate.T, omega, attitude)
    return found


def find_frames(matrices: Array, vectors: Array) -> tuple[Array, Array, Array]:
    """Return numbers of n bodies, their principal axes (columns), and components of `vectors`.

    The numbers, (n, 10), are A, B, C (NaN if the inertia is invalid), the moments over a power of
    two, and the quaternion of the axes. The components, (n, k, 3), are over the moments.
    """
    # The coefficients A, B, C are more accurate than rounded moments.
    numbers, axes, components, status = (
        each.T for each in extension().inertia_frames(matrices.T, SYMMETRIC, vectors.T)
    )
    axes = axes.transpose(0, 2, 1)
    for i in np.flatnonzero((status == Statuses.GAVE_UP) & np.isfinite(vectors).all(axis=(1, 2))):
        (a, b, c), (d, e, f), (g, h, k) = (0.5 * matrices[i] + 0.5 * matrices[i].T).tolist()
        frame = principal_frame(((a, b, c), (d, e, f), (g, h, k)))
        i1, i2, i3 = exact = frame.exact_moments
        exact_coefficients = (i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3
        numbers[i, :3] = [nearest_float(each) for each in exact_coefficients]
        numbers[i, 3:6] = [nearest_float(each / max(exact)) for each in exact]
        numbers[i, 6:] = quaternion_of_axes(np.array(frame.axes))
        axes[i] = frame.axes
        for row, (x, y, z) in enumerate(vectors[i].tolist()):
            turned = frame.into((Fraction(x), Fraction(y), Fraction(z)))
            parts = zip(turned, exact, strict=True)
            components[i, row] = [nearest_float(part / moment) for part, moment in parts]
    numbers[status == Statuses.REFUSED, :3] = np.nan
    return numbers, axes, components


def axes_of_inertia(matrices: Array) -> tuple[Array, Array, Array]:
    """Return A, B, C (NaN if invalid) of n bodies, their principal axes, and inverse inertias."""
    n = len(matrices)
    numbers, axes, components = find_frames(matrices, np.broadcast_to(np.eye(3), (n, 3, 3)))
    return numbers[:, :3], axes, np.einsum("nik,njk->nij", axes, components)


def from_scene(scene: Scene) -> dict[str, Any]:
    law = checked_scene(scene, any_axes=True).body_torque
    kind = next(name for name in BODIES if getattr(scene, name) is not None)
    return {
        kind: getattr(scene, kind),
        "omega": scene.omega,
        "torque_constant": law.constant,
        "torque_rate": law.rate,
        "sines": [[*amplitude, frequency] for amplitude, frequency in law.sines],
        "cosines": [[*amplitude, frequency] for amplitude, frequency in law.cosines],
        "attitude": scene.attitude,
    }


_kept: dict[tuple[Any, ...], tuple[Scene, Any]] = {}


def keep_with(scene: Scene, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
    # By identity, because equal scenes may differ in the signs of zeros. An entry keeps its
    # scene alive, so that no other object gets this identity.
    full = id(scene), *key
    found = _kept.get(full)
    if found is None:
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        found = _kept[full] = scene, make()
    return found[1]


def principal_rows_of_scene(scene: Scene) -> tuple[dict[str, Any], Array, Array]:
    """Return the arrays of a scene about principal axes; see `about_principal`."""

    def convert() -> Any:
        rows, axes, turns = about_principal(from_scene(scene))
        return {**rows, "merged": tuple(rows[name] for name in MERGED)}, axes, turns

    found: tuple[dict[str, Any], Array, Array] = keep_with(scene, ("principal",), convert)
    return found


def rows_of_scene(scene: Scene) -> dict[str, Any]:
    """Return the read-only arrays of a scene, and its torque with waves `merged` by frequency."""

    def convert() -> dict[str, Any]:
        rows = checked_rows(from_scene(scene))
        return {**rows, "merged": with_merged_rows(*(rows[name] for name in MERGED))}

    # Conversion takes longer than solving few bodies.
    found: dict[str, Any] = keep_with(scene, (), convert)
    return found


def checked_rows(given: Mapping[str, Any]) -> dict[str, Array]:
    """Return float arrays of checked shapes, with one row per body or one for all."""
    rows = {}
    for name in (*_SHAPES, *(each for each in given if each.startswith(PARAMETER))):
        values = given.get(name)
        if name in _WAVES and values is not None:
            waves = numbers_of(name, values)
            rows[name] = rows_of(name, waves, "k", 4) if waves.size else np.empty((1, 0, 4))
        elif values is not None or (name == "t_end" and name in given):
            rows[name] = rows_of(name, values, *_SHAPES.get(name, ()))
    return rows


def check_alike(scenes: Sequence[Scene]) -> None:
    if len({each.step_size for each in scenes}) > 1:
        raise InputError("the scenes have different step sizes; allowed: one step size for all")
    if len({each.attitude is None for each in scenes}) > 1:
        raise InputError(
            "some of the scenes have an attitude and others have none; allowed: all, or none"
        )


def from_scenes(scenes: Sequence[Scene]) -> dict[str, Any]:
    if not scenes:
        raise InputError("the sequence of scenes is empty; give at least one scene")
    check_alike(scenes)
    rows = [from_scene(each) for each in scenes]
    if len({"coefficients" in row for row in rows}) > 1:
        raise InputError(
            "some bodies are given by coefficients and others are not; allowed: "
            "coefficients for all, or for none"
        )
    found: dict[str, Any] = {
        name: np.array([row[name] for row in rows])
        for name in (*BODIES, "omega", "torque_constant", "torque_rate")
        if name in rows[0]
    }
    for name in _WAVES:
        most = max(len(row[name]) for row in rows)
        found[name] = [row[name] + [[0.0] * 4] * (most - len(row[name])) for row in rows]
    if scenes[0].attitude is not None:
        found["attitude"] = np.array([row["attitude"] for row in rows])
    return found


def rows_of_alike(scenes: Sequence[Scene]) -> tuple[Scene, dict[str, Any]]:
    """Return a scene, and the arrays in which scenes under one recorded torque differ.

    A torque law is given by arrays.
    """
    first = scenes[0]
    arrays: dict[str, Any] = dict.fromkeys((*BODIES, *TORQUES))
    arrays["omega"] = np.array([each.omega for each in scenes])
    arrays["attitude"] = first.attitude and np.array([each.attitude for each in scenes])
    if isinstance(first, PrincipalScene):
        return first, arrays
    for name in BODIES:
        if getattr(first, name) is not None:
            arrays[name] = np.array([getattr(each, name) for each in scenes])
    if not isinstance(first.torque, StateTorque):
        laws: list[Any] = [each.torque for each in scenes]
        arrays["torque_constant"] = np.array([each.constant for each in laws])
        if any(laws[0].rate):
            arrays["torque_rate"] = np.array([each.rate for each in laws])
        for name in _WAVES:
            if getattr(laws[0], name):
                waves = [[[*size, f] for size, f in getattr(each, name)] for each in laws]
                arrays[name] = np.array(waves)
    return first, arrays


def checked_copies(arrays: dict[str, Any], *, as_given: bool = False) -> dict[str, Array]:
    rows = checked_rows({**arrays, "omega": None, "attitude": None})
    for name in ("omega", "attitude"):
        rows |= checked_rows({name: arrays[name]})
    if "attitude" in rows and not as_given:
        rows["attitude"] = unit_quaternions(rows["attitude"])
    return {name: each.copy() for name, each in rows.items()}


def scene_of_row(scene: Scene, rows: Mapping[str, Array], i: int) -> Scene:
    own = {name: row_of(each, i) for name, each in rows.items()}
    values = {name: own.pop(name) for name in rows if name.startswith(PARAMETER)}
    torque: dict[str, Any] = {
        name.removeprefix("torque_"): own.pop(name) for name in TORQUES if name in own
    }
    for name in _WAVES:
        if name in torque:
            torque[name] = [(wave[:3], float(wave[3])) for wave in torque[name]]
    if own.keys() & BODIES:
        own = {**dict.fromkeys((*BODIES, "changing")), **own}
    law = scene.torque
    if torque:
        if isinstance(law, StateTorque):
            raise InputError(STATE_TORQUE)
        law = replace(law, **torque)
    if values:
        law = torque_with_values(
            law, {name.removeprefix(PARAMETER): value for name, value in values.items()}
        )
    return replace(scene, torque=law, **own)
