"""Solution of bodies one by one: events, sensitivities, and scenes that the vector kernel refuses.

These have a changing inertia, moments in double-double, or a torque that depends on the state or is
about axes of space.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.event_functions import event_functions
from pyharness.engine.leaf_cache import leaves_of, leaves_of_many
from pyharness.engine.many_prepared import solve_each, solve_lanes, solve_row
from pyharness.engine.many_scenes import (
    BODIES,
    PARAMETER,
    TORQUES,
    checked_copies,
    checked_rows,
    keep_with,
    scene_of_row,
)
from pyharness.engine.parameter_sensitivity import checked_names
from pyharness.engine.parameters import tape_of_bodies
from pyharness.engine.recorded import packed_tape
from pyharness.engine.registry import check_prepared, check_torque, requested_tolerance
from pyharness.engine.solve import solve
from pyharness.engine.solver import prepare
from pyharness.model.arrays import (
    count_bodies,
    only_one,
    row_of,
    rows_of,
    spread,
    threads_of,
    unit_quaternions,
)
from pyharness.model.codes import Statuses
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError, TimedError, kind_of
from pyharness.model.extension import ENDS
from pyharness.model.principal import PrincipalScene
from pyharness.model.progress import count_done, expect_bodies, for_each_piece
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.model.values import Number

_REST: Triple = (0.0, 0.0, 0.0)
_ONES: Triple = (1.0, 1.0, 1.0)
NO_ATTITUDE = "the torque needs the initial attitude; give attitude, or scenes with an attitude"


def is_solved_alone(scene: Scene, arrays: Mapping[str, object]) -> bool:
    """Return whether the vector kernel refuses the scene."""
    named = [name for name, each in arrays.items() if each is not None]
    if isinstance(scene.torque, StateTorque):
        for name in named:
            raise InputError(
                f"{name} is given beside a torque that depends on the state; allowed: only one of "
                "the two"
            )
        return True
    is_in_space = scene.torque.in_space or (scene.torque.frame == "space" and bool(named))
    # The vector kernel has moments in double precision; a PrincipalScene has double-double.
    return is_in_space or scene.changing is not None or isinstance(scene, PrincipalScene)


def solve_one_by_one(
    scene: Scene, t_end: Any, arrays: dict[str, Any], out: "Ensemble | Array | None", *,
    method: str, tolerance: float, effort: float, estimates: bool, threads: int, compiled: bool,
) -> Ensemble:  # fmt: skip
    """Return final states by prepared solvers; invalid bodies have the status REFUSED."""
    by_coefficients = arrays["coefficients"] is not None or scene.coefficients is not None
    if by_coefficients and not isinstance(scene.torque, StateTorque):
        raise InputError(
            "the torque is about the axes of space, and bodies are given by coefficients; allowed: "
            "moments or inertia"
        )
    attitude0 = scene.attitude if arrays["attitude"] is None else arrays["attitude"]
    if attitude0 is None and scene.torque.needs_attitude:
        raise InputError(NO_ATTITUDE)
    with_attitude = attitude0 is not None
    omega0 = scene.omega if arrays["omega"] is None else arrays["omega"]
    own = {name: each for name, each in arrays.items() if name not in ("omega", "attitude")}
    differ = any(each is not None for each in own.values())
    rows = checked_rows(own) if differ else {}
    starts, times = rows_of("omega", omega0, 3), rows_of("t_end", t_end)
    counted = {**rows, "omega": starts, "t_end": times}
    if with_attitude:
        counted["attitude"] = rows_of("attitude", attitude0, 4)
    n = count_bodies(counted)
    settings: Any = {"effort": effort, "attitude": with_attitude}
    leaves = None
    at_rest = partial(replace, scene, omega=_REST, attitude=None)
    shared = lanes = None
    if not rows:  # bodies that differ only in initial states share a solver
        settings["compiled"] = compiled
        key = method, tolerance, *settings.values()
        shared = keep_with(scene, key, lambda: prepare(at_rest(), method, tolerance, **settings))
        leaves = shared.leaves and leaves_of_many(shared.packed, shared.leaves)
    else:
        check_prepared(scene, method)
        check_torque(scene, method, attitude=True)
        lanes, leaves = _lanes(scene, rows, (tolerance, effort), with_attitude, compiled)
    found = place_for(out, n, with_attitude, estimates)
    if found.estimates is not None:
        found.estimates[:] = np.nan
    # `omega` or `attitude` may share memory with `out`.
    attitudes = np.full((n, 4), np.nan) if with_attitude else None
    result = Ensemble(np.full((n, 3), np.nan), found.status, attitudes, found.estimates)
    found.status[:] = Statuses.REFUSED
    turns = counted.get("attitude")

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        if shared is not None:
            solve_each(shared, starts, times, turns, result, piece, given_up)
            return
        left = list(range(piece.start, piece.stop))
        if lanes is not None:
            left = solve_lanes(*lanes, starts, times, turns, result, piece, given_up)
        body = at_rest()
        for i in left:
            if given_up[0]:
                return
            with suppress(InputError):
                solver = prepare(scene_of_row(body, rows, i), method, tolerance, **settings)
                solve_row(solver, i, starts, times, turns, result)

    for_each_piece(enter, n, threads)
    found.omega[:] = result.omega
    if found.attitude is not None:
        found.attitude[:] = result.attitude
        # At time 0 attitudes are normalised as by the vector kernel.
        at_start = (spread(times, n) == 0.0) & (found.status == Statuses.COMPLETE)
        found.attitude[at_start] = unit_quaternions(spread(counted["attitude"], n)[at_start])
    return found if found.leaves == leaves else replace(found, leaves=leaves)


def _lanes(
    scene: Scene, rows: Mapping[str, Array], settings: tuple[float, float], attitude: bool,
    compiled: bool,
) -> tuple[tuple[Array, Array] | None, str | None]:  # fmt: skip
    """Return (equations, parameters) of one kernel call, or None, and `Ensemble.leaves`."""
    names = [name for name in rows if name.startswith(PARAMETER)]
    kind = next((name for name in ("moments", "coefficients") if name in rows), None)
    if (
        rows.keys() - {*names, kind}
        or not isinstance(scene.torque, StateTorque)
        or scene.changing is not None
        or (scene.inertia is not None and kind is None)
    ):
        return None, None
    columns, body = [], None
    with np.errstate(all="ignore"):
        if kind == "moments":
            first, second, third = moments = np.where(rows[kind] > 0.0, rows[kind], np.nan).T
            differences = np.array([second - third, third - first, first - second])
            columns = [*(differences / moments), *(1.0 / moments)]
        elif kind == "coefficients":
            columns = [*rows[kind].T, *np.ones((3, 1))]
        else:
            i1, i2, i3 = scene.moments or _ONES
            body = scene.euler_coefficients, (1.0 / i1, 1.0 / i2, 1.0 / i3)
    columns += [rows[name] for name in names]
    own = tuple(name.removeprefix(PARAMETER) for name in names)
    tape = tape_of_bodies(scene.torque, body, own, attitude)
    address, leaves = leaves_of(tape) if compiled else (0, "interpreter")
    packed = packed_tape(tape, scene.step_size, *settings, address)
    parameters = np.column_stack([spread(each, max(map(len, columns))) for each in columns])
    return (packed, parameters), leaves_of_many(packed, leaves)


_METHODS = ("auto", "taylor", "closed-form")


def prepare_details(
    scene: Scene | Sequence[Scene], t_end: Any, arrays: dict[str, Any], *, method: str,
    tolerance: Number | None, effort: float, events: object,
    sensitivities: Iterable[str] | None, has_rows: bool,
) -> Callable[[Ensemble], Ensemble]:  # fmt: skip
    """Check the request; return a function that adds events and sensitivities to a result.

    With `has_rows`, `t_end` lists common times (s).
    """
    if method not in _METHODS:
        where = "sensitivities" if events is None else "events"
        raise InputError(f"{where}: the method is {method}; allowed: {', '.join(_METHODS)}")
    times = t_end[None] if has_rows else rows_of("t_end", t_end).copy()
    scene_of: Callable[[int], Scene]
    if isinstance(scene, Scene):
        rows = checked_copies(arrays)
        if only_one({name: arrays[name] for name in BODIES}):  # the arrays give other bodies
            scene = replace(scene, changing=None, inertia=None, coefficients=None, moments=_ONES)
        first, scene_of = scene, partial(scene_of_row, scene, rows)
        for i in range(max(map(len, rows.values()), default=0)):
            with suppress(InputError, IndexError):  # until a body is valid
                first = scene_of(i)
                break
    else:
        scenes = list(scene)
        first, scene_of = scenes[0], scenes.__getitem__
    attitude = first.attitude is not None
    functions = [] if events is None else event_functions(events, attitude)
    for each in functions:
        if np.isfinite(each.limit):
            raise InputError(
                f"{each.name} is terminal; allowed in solve_many: events that are not terminal; or "
                "call solve for each body"
            )
    names = None
    if sensitivities is not None:
        names = checked_names(first, sensitivities, method, attitude)
    tolerance = requested_tolerance(method, tolerance)

    def add(found: Ensemble) -> Ensemble:
        n = len(found.omega)
        t_events: list[list[Array | None]] = [[None] * n for _ in functions]
        y_events: list[list[Array | None]] = [[None] * n for _ in functions]
        slopes: dict[str, Array] = {}
        refusals: dict[int, str] = {}
        expect_bodies(n)
        for i, has_result in enumerate(found.has_result):
            count_done(1)
            if not has_result.all():
                continue
            try:
                one = solve(
                    scene_of(i), row_of(times, i), method, tolerance, effort=effort,
                    attitude=attitude, events=events, sensitivities=names,
                )  # fmt: skip
            except InputError as refusal:
                refusals[i] = str(refusal)
                continue
            both = zip(one.t_events or [], one.y_events or [], strict=True)
            for k, own in enumerate(both):
                t_events[k][i], y_events[k][i] = own
            for name, each in (one.sensitivities or {}).items():
                last = each if has_rows else each[0]
                if name not in slopes:
                    slopes[name] = np.full((n, *last.shape), np.nan)
                if slopes[name][i].shape == last.shape:
                    slopes[name][i] = last
        unknown = np.full((n, *times.shape[1:], 3, 0), np.nan)
        return replace(
            found,
            t_events=None if events is None else t_events,
            y_events=None if events is None else y_events,
            sensitivities=None
            if names is None
            else {name: slopes.get(name, unknown) for name in names},
            refusals=refusals,
        )

    return add


def solve_with_states(
    scene: Scene, t_end: Any, times: Array | None, arrays: dict[str, Any], states: object, *,
    refused: Mapping[str, object], estimates: bool, threads: int, **settings: Any,
) -> Ensemble:  # fmt: skip
    """Return the states of bodies with the user's own unknowns, at `t_end` or `times` (s)."""
    for name, value in refused.items():
        if value is not None:
            raise InputError(f"{name}: the scene has states of its own; allowed: solve")
    check_prepared(scene, settings["method"])
    check_torque(scene, settings["method"], attitude=True)
    is_solved_alone(scene, {name: arrays[name] for name in TORQUES})
    rows = checked_copies(arrays)
    given = {each.name: each.start for each in scene.states}
    if states is None:
        states = {}
    if not isinstance(states, Mapping):
        raise InputError(f"states: {kind_of(states)}; allowed: a dict of names and arrays")
    for name in states:
        if name not in given:
            raise InputError(f"states: {name!r}; allowed: {', '.join(given)}")
    starts = {name: rows_of(f"states: {name}", states.get(name, x)) for name, x in given.items()}
    ends = rows_of("t_end", t_end) if times is None else times[None]
    n = count_bodies({**rows, **starts, "t_end": ends})
    shape = (n,) if times is None else (n, len(times))
    has_attitude = "attitude" in rows or scene.has_attitude
    own = np.full((*shape, len(starts)), np.nan)
    found = Ensemble(
        omega=np.full((*shape, 3), np.nan),
        status=np.full(shape, Statuses.REFUSED, np.int8),
        attitude=np.full((*shape, 4), np.nan) if has_attitude else None,
        estimates=np.full((*shape, 2), np.nan) if estimates else None,
        times=times,
        own=own,
        names=tuple(starts),
    )

    def solve_body(i: int) -> None:
        try:
            initial = tuple(
                each._replace(start=float(row_of(starts[each.name], i))) for each in scene.states
            )
            body = replace(scene_of_row(scene, rows, i), states=initial)
            one = solve(body, row_of(ends, i), **settings)
        except TimedError:
            found.status[i] = Statuses.GAVE_UP
            return
        except InputError:
            return
        # Either side of time 0 may end early.
        row = i, np.isin(row_of(ends, i), one.time)
        found.status[i] = ENDS.index(one.ended)
        if not one.has_all_rows:
            found.status[row] = Statuses.COMPLETE
        found.omega[row], own[row] = one.omega, one.own
        if found.attitude is not None:
            found.attitude[row] = one.attitude
        if found.estimates is not None:
            found.estimates[row] = np.array([one.error, one.growth], float)

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        for i in range(piece.start, piece.stop):
            if given_up[0]:
                return
            solve_body(i)
            count_done(1)

    for_each_piece(enter, n, threads_of(threads))
    return found
