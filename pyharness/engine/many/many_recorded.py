"""Equations of motion of many bodies under one recorded torque.

Whatever differs between bodies (parameters, inertia, a torque law about axes of space) is an input
of the equations, so that a batch is one set of equations with rows of data.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.plan.registry import check_prepared, check_torque
from pyharness.engine.prepared.many_prepared import solve_with, times_within
from pyharness.engine.prepared.many_scenes import (
    BODIES,
    ONES,
    PARAMETER,
    TORQUES,
    axes_of_inertia,
    checked_rows,
    keep_with,
    scene_of_row,
)
from pyharness.engine.prepared.many_tape import Bodies, Equations, solve_tape
from pyharness.engine.prepared.solver import Solver, prepare
from pyharness.engine.solve import solve
from pyharness.engine.system.leaf_cache import leaves_of, leaves_of_many
from pyharness.engine.system.parameters import BatchBody, tape_of_bodies
from pyharness.engine.system.recorded import listing, packed_tape
from pyharness.model.arrays import (
    count_bodies,
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
from pyharness.model.progress import for_each_piece
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque, has_switches
from pyharness.model.tape import Tape, slots_of
from pyharness.model.trajectory import Array

_REST: Triple = (0.0, 0.0, 0.0)
NO_ATTITUDE = "the torque needs the initial attitude; give attitude, or scenes with an attitude"


def needs_equations(scene: Scene, arrays: Mapping[str, object]) -> bool:
    """Return whether the kernel of torque laws refuses the scene."""
    named = [name for name, each in arrays.items() if each is not None]
    if isinstance(scene.torque, StateTorque):
        for name in named:
            raise InputError(
                f"{name} is given beside a torque that depends on the state; allowed: only one of "
                "the two"
            )
        return True
    is_in_space = scene.torque.in_space or (scene.torque.frame == "space" and bool(named))
    # That kernel has moments in double precision; a PrincipalScene has double-double.
    return is_in_space or scene.changing is not None or isinstance(scene, PrincipalScene)


def solve_recorded(
    scene: Scene, t_end: Any, times: Array | None, arrays: dict[str, Any], states: object,
    out: "Ensemble | Array | None", *, method: str, tolerance: float, effort: float,
    estimates: bool, threads: int, compiled: bool,
) -> Ensemble:  # fmt: skip
    """Return states at `t_end`, or at `times` (s); invalid bodies have the status REFUSED."""
    by_coefficients = arrays["coefficients"] is not None or scene.coefficients is not None
    if by_coefficients and not isinstance(scene.torque, StateTorque):
        raise InputError(
            "the torque is about the axes of space, and bodies are given by coefficients; allowed: "
            "moments or inertia"
        )
    attitude0 = scene.attitude if arrays["attitude"] is None else arrays["attitude"]
    if attitude0 is None and scene.torque.needs_attitude:
        raise InputError(NO_ATTITUDE)
    omega0 = scene.omega if arrays["omega"] is None else arrays["omega"]
    own = {name: each for name, each in arrays.items() if name not in ("omega", "attitude")}
    rows = checked_rows(own) if any(each is not None for each in own.values()) else {}
    ends = rows_of("t_end", t_end) if times is None else times
    counted = {**rows, "omega": rows_of("omega", omega0, 3), **_own_states(scene, states)}
    if times is None:
        counted["t_end"] = ends
    if attitude0 is not None:
        counted["attitude"] = rows_of("attitude", attitude0, 4)
    n = count_bodies(counted)
    turns = counted.get("attitude")
    settings = method, tolerance, effort, turns is not None, compiled
    equations, leaves = _prepare(scene, rows, settings)
    if times is None:
        place = place_for(out, n, turns is not None, estimates)
    else:
        shape = n, len(times)
        place = Ensemble(
            np.empty((*shape, 3)), np.empty(shape, np.int8),
            None if turns is None else np.empty((*shape, 4)),
            np.empty((*shape, 2)) if estimates else None, times=times,
        )  # fmt: skip
    columns = ends[None] if times is None else ends[:, None]
    columns = times_within(scene, columns)
    sizes = tuple(each.scale for each in scene.states)
    starts = np.empty((n, len(sizes)))
    for k, each in enumerate(scene.states):
        starts[:, k] = counted[f"states: {each.name}"]
    bodies = Bodies(counted["omega"], columns, turns, starts, sizes)
    m = len(columns)
    # `omega` or `attitude` may share memory with `out`.
    result = Ensemble(
        np.full((n, m, 3), np.nan), np.full((n, m), Statuses.REFUSED, np.int8),
        None if turns is None else np.full((n, m, 4), np.nan),
        np.full((n, m, 2), np.nan) if estimates else None,
        own=np.full((n, m, len(sizes)), np.nan) if sizes else None,
    )  # fmt: skip

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        if isinstance(equations, Equations):
            left.append(solve_tape(equations, bodies, result, piece, given_up))
        else:
            left.append(solve_with(equations, bodies, result, piece, given_up))

    left: list[int] = []
    for_each_piece(enter, n, threads_of(threads))
    if leaves is not None and any(left):
        why = "switches" if has_switches(scene.torque) else "their error estimates"
        leaves += f"; {sum(left)} of {n} bodies one by one, because of {why}"
    if scene.states:
        # `solve` takes omegas and states of any size, and tells endings apart.
        is_result = (result.status == Statuses.COMPLETE) | (result.status == Statuses.SENSITIVE)
        has_result = is_result.all(axis=1)
        options = {"method": method, "tolerance": tolerance, "effort": effort}
        for i in np.flatnonzero(~has_result).tolist():
            _solve_alone(scene, {**counted, **rows}, i, times, result, options)
    if result.attitude is not None:
        # At time 0 attitudes are normalised as by the kernel of torque laws.
        at_start = (spread(columns.T, n) == 0.0) & (result.status == Statuses.COMPLETE)
        body, _ = np.nonzero(at_start)
        result.attitude[at_start] = unit_quaternions(spread(counted["attitude"], n))[body]
    for name in ("omega", "status", "attitude", "estimates"):
        array = getattr(place, name)
        if array is not None:
            array[:] = getattr(result, name).reshape(array.shape)
    if result.own is not None:
        own_values = result.own if times is not None else result.own[:, 0]
        names = tuple(each.name for each in scene.states)
        place = replace(place, own=own_values, names=names)
    return place if place.leaves == leaves else replace(place, leaves=leaves)


def _solve_alone(
    scene: Scene, rows: Mapping[str, Array], i: int, times: Array | None, result: Ensemble,
    options: dict[str, Any],
) -> None:  # fmt: skip
    own = {each.name: float(row_of(rows[f"states: {each.name}"], i)) for each in scene.states}
    data = {name: each for name, each in rows.items() if name != "t_end" and name[8:] not in own}
    ends = row_of(rows["t_end"], i)[None] if times is None else times
    result.status[i] = Statuses.REFUSED
    for array in (result.omega, result.attitude, result.own, result.estimates):
        if array is not None:
            array[i] = np.nan
    try:
        states = tuple(each._replace(start=own[each.name]) for each in scene.states)
        one = solve(replace(scene_of_row(scene, data, i), states=states), ends, **options)
    except TimedError:
        result.status[i] = Statuses.GAVE_UP
        return
    except InputError:
        return
    # Either side of time 0 may end early.
    row = i, np.isin(ends, one.time)
    result.status[i] = ENDS.index(one.ended)
    if not one.has_all_rows:
        result.status[row] = Statuses.COMPLETE
    result.omega[row] = one.omega
    for array, values in ((result.attitude, one.attitude), (result.own, one.own)):
        if array is not None:
            array[row] = values
    if result.estimates is not None:
        result.estimates[row] = np.array([one.error, one.growth], float)


def _own_states(scene: Scene, states: object) -> dict[str, Array]:
    """Return the initial values of the scene's own states, by name."""
    given = {each.name: each.start for each in scene.states}
    if states is None:
        states = {}
    if not isinstance(states, Mapping):
        raise InputError(f"states: {kind_of(states)}; allowed: a dict of names and arrays")
    for name in states:
        if name not in given:
            raise InputError(f"states: {name!r}; allowed: {', '.join(given)}")
    names = {name: f"states: {name}" for name in given}
    return {names[name]: rows_of(names[name], states.get(name, x)) for name, x in given.items()}


def _prepare(
    scene: Scene, rows: Mapping[str, Array], settings: tuple[str, float, float, bool, bool]
) -> tuple[Equations | Solver[Any], str | None]:
    """Return the bodies' equations of motion, or a solver, and `Ensemble.leaves`."""
    method, tolerance, effort, attitude, compiled = settings
    if rows or scene.states:
        check_prepared(scene, method)
        check_torque(scene, method, attitude=True)
        return _equations(scene, rows, settings)
    # Bodies that differ only in initial states share a solver.
    options: Any = {"effort": effort, "attitude": attitude, "compiled": compiled}
    solver = keep_with(
        scene, settings,
        lambda: prepare(replace(scene, omega=_REST, attitude=None), method, tolerance, **options),
    )  # fmt: skip
    return solver, solver.leaves and leaves_of_many(solver.packed, solver.leaves)


def _equations(
    scene: Scene, rows: Mapping[str, Array], settings: tuple[str, float, float, bool, bool]
) -> tuple[Equations, str]:
    _, tolerance, effort, attitude, compiled = settings
    columns: list[Array] = []
    body = BatchBody(scene.changing)
    if any(name in rows for name in TORQUES) and scene.changing is None:
        # As for scenes in a list, which differ in laws and bodies.
        own = {name: getattr(scene, name) for name in BODIES if getattr(scene, name) is not None}
        rows = {**checked_rows(own), **rows} if not rows.keys() & BODIES else rows
    kind = next((name for name in BODIES if name in rows), None)
    with np.errstate(all="ignore"):
        if kind == "moments":
            first, second, third = moments = np.where(rows[kind] > 0.0, rows[kind], np.nan).T
            differences = np.array([second - third, third - first, first - second])
            columns = [*(differences / moments), *(1.0 / moments)]
        elif kind == "coefficients":
            columns = [*rows[kind].T, *np.ones((3, 1))]
        elif kind == "inertia":
            coefficients, axes, inverse = axes_of_inertia(rows[kind])
            columns = [*coefficients.T, *axes.reshape(-1, 9).T, *inverse.reshape(-1, 9).T]
        elif scene.inertia is not None:
            body = BatchBody(inertia=scene.inertia)
        elif scene.changing is None:
            i1, i2, i3 = scene.moments or ONES
            body = BatchBody(None, scene.euler_coefficients, (1.0 / i1, 1.0 / i2, 1.0 / i3))
    if kind is not None:
        body = BatchBody(n_data=len(columns))
    names = []
    for name, each in rows.items():
        if name in TORQUES:
            names.append((name.removeprefix("torque_"), each[0].size))
            columns += list(each.reshape(len(each), -1).T)
    for name, each in rows.items():
        if name.startswith(PARAMETER):
            names.append((name.removeprefix(PARAMETER), 1))
            columns.append(each)
    data = np.empty((0, 0))
    if columns:
        data = np.column_stack([spread(each, max(map(len, columns))) for each in columns])
    tape, bound, extra_work = _tapes_of_bodies(
        scene.torque, body, tuple(names), attitude, tuple(each.name for each in scene.states)
    )
    address, leaves = leaves_of(tape) if compiled else (0, "interpreter")
    packed = packed_tape(tape, scene.step_size, tolerance, effort, address)
    alone = packed
    if bound is not tape:
        alone = packed_tape(bound, scene.step_size, tolerance, effort * extra_work)
    return Equations(packed, alone, data), leaves_of_many(packed, leaves)


@lru_cache(maxsize=16)
def _tapes_of_bodies(*given: Any) -> tuple[Tape, Tape, float]:
    tape, bound = tape_of_bodies(*given)
    return tape, bound, _extra_work(bound)


def _extra_work(bound: Tape) -> float:
    """Return the size of equations with data, relative to those with the numbers in their place.

    The work limit is lower for more slots.
    """
    constants: set[int] = set()
    saved = 0
    for slot, each in enumerate(bound.operations, bound.n_inputs):
        known = [operand in constants for operand in slots_of(each)]
        if each.table is None and all(known):
            constants.add(slot)
        saved += slot in constants or (each.kind == "product" and any(known))
    n_slots = listing(bound).n_slots
    return n_slots / (n_slots - saved)
