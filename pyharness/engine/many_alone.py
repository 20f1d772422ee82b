"""Bodies that the general kernel for many bodies can't take, by prepared solvers.

They are those under a torque of the state or about the axes of space, or of a changing inertia.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.many_prepared import solve_each, solve_row
from pyharness.engine.many_scenes import rows_of_bodies, scene_of_row
from pyharness.engine.prepared import prepare
from pyharness.engine.registry import check_prepared, check_torque
from pyharness.model.arrays import count_bodies, rows_of
from pyharness.model.codes import Statuses
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError
from pyharness.model.progress import for_each_piece
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array

_REST: Triple = (0.0, 0.0, 0.0)
_MOST_KEPT = 8  # prepared solvers
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
    own = Ensemble(
        np.full((n, 3), np.nan), found.status, np.full((n, 4), np.nan) if with_attitude else None,
        found.estimates,
    )  # fmt: skip
    found.status[:] = Statuses.REFUSED
    turns = counted.get("attitude0")

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        if shared is not None:
            solve_each(shared, starts, times, turns, own, piece, given_up)
            return
        for i in range(piece.start, piece.stop):
            if given_up[0]:
                return
            with suppress(InputError):
                solver = prepare(scene_of_row(at_rest, rows, i), method, tolerance, **settings)
                solve_row(solver, i, starts, times, turns, own)

    for_each_piece(enter, n, threads)
    found.omega[:] = own.omega
    if found.attitude is not None and own.attitude is not None:
        found.attitude[:] = own.attitude
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
