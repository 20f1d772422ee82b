"""Conversion of the arrays of `solve_many` to one scene per body.

Full inertia matrices need it. So do torques in space, torques of the state and changing inertias;
prepared solvers solve these bodies here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.ensemble import Ensemble, place_for
from pyharness.engine.many_recorded import solve_side_by_side
from pyharness.engine.prepared import prepare
from pyharness.engine.registry import check_prepared, check_torque
from pyharness.model.arrays import count_bodies, row_of, rows_of, waves_of
from pyharness.model.codes import Statuses
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.pieces import for_each_piece
from pyharness.model.scene import STATE_TORQUE, Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array

_REST: Triple = (0.0, 0.0, 0.0)
_MOST_KEPT = 8  # prepared solvers
_BODIES = ("moments", "inertia", "coefficients")
NO_ATTITUDE = "the torque needs the initial attitude; give attitude0, or scenes with an attitude"


def is_solved_alone(scene: Scene, arrays: Mapping[str, object]) -> bool:
    """Return whether the general kernel for many bodies can't take the scene.

    Raise InputError if its torque depends on the state, and `arrays` has torques too.
    """
    named = [name for name, each in arrays.items() if each is not None]
    if isinstance(scene.torque, StateTorque):
        for name in named:
            raise InputError(
                f"{name} is given beside a torque that depends on the state; allowed: only one of "
                "the two"
            )
        return True
    is_in_space = scene.torque.in_space or (scene.torque.frame == "space" and bool(named))
    return is_in_space or scene.changing is not None


def solve_one_by_one(
    scene: Scene, t_end: Any, arrays: dict[str, Any], out: "Ensemble | Array | None", *,
    method: str, tolerance: float, effort: float, estimates: bool, threads: int,
) -> Ensemble:  # fmt: skip
    """Return the final states of bodies by prepared solvers; invalid bodies are REFUSED.

    Raise InputError if the torque needs an attitude and there is none, if the method can't solve
    the scene, or if a torque in space acts on bodies given by coefficients.
    """
    check_torque(scene, method, attitude=True)
    check_prepared(scene, method)
    by_coefficients = arrays["coefficients"] is not None or scene.coefficients is not None
    if by_coefficients and not isinstance(scene.torque, StateTorque):
        raise InputError(
            "the torque is about the axes of space, and bodies are given by coefficients; allowed: "
            "moments or inertia"
        )
    attitude0 = scene.attitude if arrays["attitude0"] is None else arrays["attitude0"]
    if attitude0 is None and scene.torque.needs_attitude:
        raise InputError(NO_ATTITUDE)
    with_attitude = attitude0 is not None
    omega0 = scene.omega if arrays["omega0"] is None else arrays["omega0"]
    rows = rows_of_bodies(arrays)
    starts, times = rows_of("omega0", omega0, 3), rows_of("t_end", t_end)
    counted = {**rows, "omega0": starts, "t_end": times}
    if with_attitude:
        counted["attitude0"] = rows_of("attitude0", attitude0, 4)
    n = count_bodies(counted)
    at_rest = replace(scene, omega=_REST, attitude=None)
    found = place_for(out, n, with_attitude, estimates)
    if found.estimates is not None:
        found.estimates[:] = np.nan
    settings: Any = {"effort": effort, "attitude": with_attitude}
    # Bodies that differ in their starts alone share one solver.
    shared = None if rows else _kept_solver(scene, method, tolerance, effort, with_attitude)
    # `omega0` or `attitude0` may share memory with `out`.
    omega = np.full((n, 3), np.nan)
    attitude = np.full((n, 4), np.nan) if with_attitude else None
    found.status[:] = Statuses.REFUSED

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        left: Sequence[int] = range(piece.start, piece.stop)
        if shared is not None:
            turns = counted.get("attitude0")
            whole = Ensemble(omega, found.status, attitude, found.estimates)
            left = solve_side_by_side(shared, starts, times, turns, whole, piece, given_up)
        for i in left:
            if given_up[0]:
                return
            try:
                solver: Any = shared or prepare(
                    scene_of_row(at_rest, rows, i), method, tolerance, **settings
                )
                start, time = row_of(starts, i), float(row_of(times, i))
                if attitude is not None:
                    turn = row_of(counted["attitude0"], i)
                    omega[i], attitude[i] = solver(start, time, turn)
                else:
                    omega[i] = solver(start, time)
            except InputError:
                continue
            found.status[i] = ENDS.index(solver.status)
            if found.estimates is not None:
                found.estimates[i] = [
                    np.nan if each is None else each for each in (solver.error, solver.growth)
                ]

    for_each_piece(enter, n, threads)
    found.omega[:] = omega
    if found.attitude is not None and attitude is not None:
        found.attitude[:] = attitude
    return found


_kept: dict[tuple[int, str, float, float, bool], tuple[Scene, Any]] = {}


def _kept_solver(
    scene: Scene, method: str, tolerance: float, effort: float, with_attitude: bool
) -> Any:
    """Return the prepared solver of a scene, cached because preparation takes long."""
    # An entry keeps its scene alive, so that no other object gets its identity.
    key = id(scene), method, tolerance, effort, with_attitude
    if key not in _kept:
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        settings: Any = {"effort": effort, "attitude": with_attitude}
        at_rest = replace(scene, omega=_REST, attitude=None)
        _kept[key] = scene, prepare(at_rest, method, tolerance, **settings)
    return _kept[key][1]


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
