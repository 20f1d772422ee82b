"""Many bodies that have states of their own, solved one by one; all times by one integration."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.many_alone import checked_copies, is_solved_alone
from pyharness.engine.many_scenes import TORQUES, scene_of_row
from pyharness.engine.registry import check_prepared, check_torque
from pyharness.engine.solve import solve
from pyharness.model.arrays import count_bodies, row_of, rows_of, threads_of
from pyharness.model.codes import Statuses
from pyharness.model.ensemble import Ensemble
from pyharness.model.errors import InputError, TimedError, kind_of
from pyharness.model.extension import ENDS
from pyharness.model.progress import count_done, for_each_piece
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array


def solve_with_states(
    scene: Scene, t_end: Any, times: Array | None, arrays: dict[str, Any], states: object, *,
    refused: Mapping[str, object], estimates: bool, threads: int, **settings: Any,
) -> Ensemble:  # fmt: skip
    """Return the final states of bodies with own states, at `t_end` or at common `times` (s).

    `refused` are arguments that must be None.
    """
    for name, value in refused.items():
        if value is not None:
            raise InputError(f"{name}: the scene has states of its own; allowed: solve")
    check_prepared(scene, settings["method"])
    check_torque(scene, settings["method"], attitude=True)
    is_solved_alone(scene, {name: arrays[name] for name in TORQUES})
    rows = checked_copies(arrays)
    starts = _starts(scene, states)
    ends = rows_of("t_end", t_end) if times is None else times[None]
    n = count_bodies({**rows, **starts, "t_end": ends})
    shape = (n,) if times is None else (n, len(times))
    has_attitude = "attitude" in rows or scene.has_attitude
    found = Ensemble(
        omega=np.full((*shape, 3), np.nan),
        status=np.full(shape, Statuses.REFUSED, np.int8),
        attitude=np.full((*shape, 4), np.nan) if has_attitude else None,
        estimates=np.full((*shape, 2), np.nan) if estimates else None,
        times=times,
        own=np.full((*shape, len(starts)), np.nan),
        names=tuple(starts),
    )
    solve_body = partial(_solve_body, scene, rows, starts, ends, found, settings)

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        for i in range(piece.start, piece.stop):
            if given_up[0]:
                return
            solve_body(i)
            count_done(1)

    for_each_piece(enter, n, threads_of(threads))
    return found


def _starts(scene: Scene, states: object) -> dict[str, Array]:
    """Return the initial values of each state, one for each body or for all."""
    given = {each.name: each.start for each in scene.states}
    if states is None:
        states = {}
    if not isinstance(states, Mapping):
        raise InputError(f"states: {kind_of(states)}; allowed: a dict of names and arrays")
    for name in states:
        if name not in given:
            raise InputError(f"states: {name!r}; allowed: {', '.join(given)}")
    return {name: rows_of(f"states: {name}", states.get(name, x)) for name, x in given.items()}


def _solve_body(
    scene: Scene, rows: Mapping[str, Array], starts: Mapping[str, Array], ends: Array,
    found: Ensemble, settings: dict[str, Any], i: int,
) -> None:  # fmt: skip
    """Solve body `i`; a body with invalid numbers remains REFUSED."""
    try:
        own = tuple(
            each._replace(start=float(row_of(starts[each.name], i))) for each in scene.states
        )
        one = solve(replace(scene_of_row(scene, rows, i), states=own), row_of(ends, i), **settings)
    except TimedError:
        found.status[i] = Statuses.GAVE_UP
        return
    except InputError:
        return
    # The rows before the end of an integration that did not reach all times are complete.
    places = slice(len(one.time)) if found.times is not None else slice(None)
    row = (i, places) if found.times is not None else i
    found.status[i] = ENDS.index(one.ended)
    if not one.has_all_rows:
        if found.times is None:
            return
        found.status[row] = Statuses.COMPLETE
    assert found.own is not None
    assert one.own is not None
    last = slice(None) if found.times is not None else -1
    found.omega[row], found.own[row] = one.omega[last], one.own[last]
    if found.attitude is not None and one.attitude is not None:
        found.attitude[row] = one.attitude[last]
    if found.estimates is not None:
        given = one.error, one.growth
        found.estimates[row] = [np.nan if each is None else each for each in given]
