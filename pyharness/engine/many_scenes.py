"""Conversion of scenes to the arrays of `solve_many`."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.parameters import torque_with_values
from pyharness.model.arrays import (
    check_rows,
    count_bodies,
    row_of,
    rows_of,
    spread,
    unit_quaternions,
    waves_of,
)
from pyharness.model.attitude import IDENTITY, quaternions_of_axes, rotated, turned_back
from pyharness.model.codes import Methods, Statuses
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.inertia import SYMMETRIC, nearest_float, principal_frame
from pyharness.model.progress import for_each_piece
from pyharness.model.scene import STATE_TORQUE, Scene, checked_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.model.waves import with_merged_rows

_MERGED = ("torque_constant", "sines", "cosines")  # what `with_merged_rows` may change
_NOTHING = np.empty((4, 0), order="F")  # in place of attitudes
_UNKNOWN = -1.0  # in place of an estimate that the kernel does not compute
_MOST_KEPT = 8  # scenes whose arrays are kept
BODIES = ("moments", "inertia", "coefficients")
PARAMETER = "parameters: "  # before the names of parameters of a torque
TORQUES = ("torque_constant", "torque_rate", "sines", "cosines")


class Axes:
    """The principal axes of n bodies, or one set for all, and conversions to and from them."""

    def __init__(self, axes: Array) -> None:
        """Store the axes as columns, (n, 3, 3)."""
        self.axes = axes

    @cached_property
    def turns(self) -> Array:
        """The axes as quaternions, (n, 4)."""
        return quaternions_of_axes(self.axes)

    def about_principal(self, given: dict[str, Any], names: Iterable[str]) -> None:
        """Convert `omega` and `attitude` of `given`, if in `names`, to principal axes."""
        if "omega" in names:
            rows = rows_of("omega", given["omega"], 3)
            self._check("omega", rows)
            given["omega"] = rotated(rows, self.axes.transpose(0, 2, 1))
        if "attitude" in names:
            attitudes = unit_quaternions(rows_of("attitude", given["attitude"], 4))
            self._check("attitude", attitudes)
            conjugate = self.turns * np.array([1.0, -1.0, -1.0, -1.0])
            given["attitude"] = turned_back(attitudes, conjugate)

    def give_back(self, omega: Array, attitude: Array | None) -> None:
        """Convert final omegas, (n, 3), and attitudes, (n, 4), back in place."""
        omega[:] = rotated(omega, self.axes)
        if attitude is not None:
            attitude[:] = turned_back(attitude, self.turns)

    def _check(self, name: str, rows: Array) -> None:
        if len(self.axes) != 1:
            check_rows(name, rows, len(self.axes))


def about_principal(given: Mapping[str, Any]) -> tuple[dict[str, Any], Axes]:
    """Return arrays of bodies with inertia matrices as arrays about principal axes, and these.

    The arrays have A, B, C, because rounded moments would be less accurate. They are NaN for a
    matrix that is not symmetric and positive definite.
    """
    rows = checked_rows({name: given[name] for name in given if name not in BODIES})
    own = {"inertia": rows_of("inertia", given["inertia"], 3, 3)}
    own |= {name: rows.pop(name) for name in TORQUES}
    n = count_bodies(own)
    matrices, constant, rate, sines, cosines = (spread(each, n) for each in own.values())
    constant, sines, cosines = with_merged_rows(constant, sines, cosines)
    with np.errstate(all="ignore"):
        opposite = matrices.transpose(0, 2, 1)
        largest = np.abs(matrices).max(axis=(1, 2))
        is_right = np.isfinite(largest) & (
            np.abs(matrices - opposite).max(axis=(1, 2)) <= SYMMETRIC * largest
        )
        matrices = np.where(is_right[:, None, None], 0.5 * matrices + 0.5 * opposite, np.eye(3))
    vectors = np.concatenate(
        [constant[:, None], rate[:, None], sines[..., :3], cosines[..., :3]], axis=1
    )
    coefficients, axes, components, status = (
        np.ascontiguousarray(each.T)
        for each in extension().inertia_frames(matrices.transpose(1, 2, 0), vectors.T)
    )
    axes = axes.transpose(0, 2, 1)
    for i in np.flatnonzero((status == Statuses.GAVE_UP) & np.isfinite(vectors).all(axis=(1, 2))):
        (a, b, c), (d, e, f), (g, h, k) = matrices[i].tolist()
        frame = principal_frame(((a, b, c), (d, e, f), (g, h, k)))
        i1, i2, i3 = exact = frame.exact_moments
        exact_coefficients = (i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3
        coefficients[i] = [nearest_float(each) for each in exact_coefficients]
        axes[i] = frame.axes
        for row, (x, y, z) in enumerate(vectors[i].tolist()):
            turned = frame.into((Fraction(x), Fraction(y), Fraction(z)))
            parts = zip(turned, exact, strict=True)
            components[i, row] = [nearest_float(part / moment) for part, moment in parts]
    coefficients[~is_right | (status == Statuses.REFUSED)] = np.nan
    last = 2 + sines.shape[1]
    found = {
        **rows,
        "coefficients": coefficients,
        "torque_constant": components[:, 0],
        "torque_rate": components[:, 1],
        "sines": np.concatenate([components[:, 2:last], sines[..., 3:]], axis=2),
        "cosines": np.concatenate([components[:, last:], cosines[..., 3:]], axis=2),
    }
    found = {name: np.ascontiguousarray(each) for name, each in found.items()}
    about = Axes(np.ascontiguousarray(axes))
    about.about_principal(found, rows)
    return found, about


def _filled(laws: list[Any]) -> list[Any]:
    most = max(map(len, laws))
    return [waves + [[0.0] * 4] * (most - len(waves)) for waves in laws]


def from_scene(scene: Scene) -> dict[str, Any]:
    """Return the arrays of a scene."""
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
    rows: dict[str, Any] = checked_rows(from_scene(scene))
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
    rows = [from_scene(each) for each in scenes]
    if len({"coefficients" in row for row in rows}) > 1:
        raise InputError(
            "some bodies are given by coefficients and others are not; allowed: "
            "coefficients for all, or for none"
        )
    return _stacked(rows)


def _stacked(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {"attitude": None}
    for name in (*BODIES, "omega", "torque_constant", "torque_rate"):
        if name in rows[0]:
            found[name] = np.array([row[name] for row in rows])
    for name in ("sines", "cosines"):
        found[name] = _filled([row[name] for row in rows])
    if any(row["attitude"] is not None for row in rows):
        found["attitude"] = np.array([row["attitude"] or IDENTITY for row in rows])
    return found


# In the order in which `solve_many` checks its arrays.
_CONVERSIONS: dict[str, Callable[[Any], Array]] = {
    **{
        name: lambda values, name=name: rows_of(name, values, 3)  # type: ignore[misc]
        for name in ("omega", "moments", "coefficients", "torque_constant", "torque_rate")
    },
    "sines": partial(waves_of, "sines"),
    "cosines": partial(waves_of, "cosines"),
    "t_end": partial(rows_of, "t_end"),
    "attitude": lambda values: rows_of("attitude", values, 4),
}


def rows_of_bodies(arrays: dict[str, Any]) -> dict[str, Array]:
    """Return the arrays of bodies and torques that are not None, with checked shapes."""
    shapes = {"moments": (3,), "inertia": (3, 3), "torque_constant": (3,), "torque_rate": (3,)}
    rows = {}
    for name, values in arrays.items():
        if values is not None and name in shapes:
            rows[name] = rows_of(name, values, *shapes[name])
        elif values is not None and name in ("sines", "cosines"):
            rows[name] = waves_of(name, values)
        elif name.startswith(PARAMETER):
            rows[name] = rows_of(name, values)
    return rows


def scene_of_row(scene: Scene, rows: Mapping[str, Array], i: int) -> Scene:
    """Return the scene of body `i`, or raise InputError if its numbers are invalid."""
    own = {name: row_of(each, i) for name, each in rows.items()}
    values = {name: own.pop(name) for name in rows if name.startswith(PARAMETER)}
    torque: dict[str, Any] = {
        name.removeprefix("torque_"): own.pop(name)
        for name in ("torque_constant", "torque_rate", "sines", "cosines")
        if name in own
    }
    for name in ("sines", "cosines"):
        if name in torque:
            torque[name] = [(wave[:3], float(wave[3])) for wave in torque[name]]
    if own.keys() & BODIES:
        own = {**dict.fromkeys(BODIES), **own}
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


class Bodies:
    """The checked arguments of the kernel: arrays `own`, and for others a scene's `ready` rows."""

    def __init__(
        self, ready: dict[str, Any], own: dict[str, Any], step: float, code: int, tolerance: float,
        effort: float, is_rounded: bool,
    ) -> None:  # fmt: skip
        given = checked_rows(own)
        self.n = count_bodies(given)
        rows = {**ready, **given}
        self.by_moments = "moments" in (given if "coefficients" in given else rows)
        self.body = rows["moments" if self.by_moments else "coefficients"]
        self.rate, self.times = rows["torque_rate"], rows["t_end"]
        self.attitude = rows.get("attitude")
        law: tuple[Array, Array, Array] | None = ready.get("merged")
        if law is None or not given.keys().isdisjoint(_MERGED):
            law = with_merged_rows(*(rows[name] for name in _MERGED))
        self.constant, self.sines, self.cosines = law
        self.omega0 = spread(rows["omega"], self.n)
        self.step = step
        self.is_rounded = is_rounded
        if not step > 0.0:
            raise InputError(f"step is {step:g}; allowed: above 0")
        self.code, self.tolerance, self.effort = code, tolerance, effort
        if code == Methods.CLOSED_FORM:
            self._check_form()

    def _check_form(self) -> None:
        torques = (self.constant, self.rate, self.sines[..., :3], self.cosines[..., :3])
        if any(each.any() for each in torques):
            raise InputError(
                "closed-form can't solve bodies with a torque in one call; allowed: auto, taylor"
            )
        if self.attitude is not None and not self.by_moments:
            raise InputError(
                "closed-form can't compute the attitude of bodies given by coefficients; "
                "allowed: moments, or methods auto and taylor"
            )

    def solve(self, threads: int, out: "Ensemble | Array | None", with_estimates: bool) -> Ensemble:
        """Return the final states."""
        found = place_for(out, self.n, self.attitude is not None, with_estimates)
        if found.estimates is not None:
            found.estimates[:] = _UNKNOWN
        # The kernel may write a result before it reads the start again.
        if np.may_share_memory(self.omega0, found.omega):
            self.omega0 = self.omega0.copy()
        attitude = self.attitude
        if attitude is not None and np.may_share_memory(attitude, found.attitude):
            self.attitude = attitude.copy()
        for_each_piece(partial(self._enter, found), self.n, threads)
        if found.estimates is not None:
            found.estimates[~(found.estimates >= 0.0)] = np.nan
        return found

    def _enter(self, found: Ensemble, piece: slice, given_up: NDArray[np.int32]) -> None:
        def part(array: Array) -> Array:
            return (array if len(array) in (0, 1, piece.stop - piece.start) else array[piece]).T

        extension().solve_ensemble(
            self.code, self.tolerance, self.step, self.effort,
            self.by_moments + 2 * self.is_rounded,
            part(self.body), part(self.constant), part(self.rate), part(self.sines),
            part(self.cosines), part(self.omega0), part(self.times),
            _NOTHING if self.attitude is None else part(self.attitude), given_up,
            found.omega[piece].T,
            _NOTHING if found.attitude is None else found.attitude[piece].T, found.status[piece],
            found.estimates_of(piece),
        )  # fmt: skip
