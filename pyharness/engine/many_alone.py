"""Bodies one by one: events, sensitivities, and what the vector kernel can't take.

That kernel takes no torque of the state or about the axes of space, and no changing inertia.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.event_functions import event_functions
from pyharness.engine.many_prepared import solve_each, solve_lanes, solve_row
from pyharness.engine.many_scenes import BODIES, PARAMETER, rows_of_bodies, scene_of_row
from pyharness.engine.packed import packed_tape
from pyharness.engine.parameter_sensitivity import checked_names
from pyharness.engine.parameters import tape_of_bodies
from pyharness.engine.prepared import prepare
from pyharness.engine.registry import check_prepared, check_torque, requested_tolerance
from pyharness.engine.solve import solve
from pyharness.model.arrays import count_bodies, only_one, row_of, rows_of, spread, unit_quaternions
from pyharness.model.codes import Statuses
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError
from pyharness.model.principal import PrincipalScene
from pyharness.model.progress import count_done, expect_bodies, for_each_piece
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.model.values import Number

_REST: Triple = (0.0, 0.0, 0.0)
_ONES: Triple = (1.0, 1.0, 1.0)
_MOST_KEPT = 8  # prepared solvers
NO_ATTITUDE = "the torque needs the initial attitude; give attitude, or scenes with an attitude"


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
    # The kernel's moments are in double precision, those of a PrincipalScene in double-double.
    return is_in_space or scene.changing is not None or isinstance(scene, PrincipalScene)


def solve_one_by_one(
    scene: Scene, t_end: Any, arrays: dict[str, Any], out: "Ensemble | Array | None", *,
    method: str, tolerance: float, effort: float, estimates: bool, threads: int,
) -> Ensemble:  # fmt: skip
    """Return the final states of bodies by prepared solvers; invalid bodies are REFUSED.

    Raise InputError if the torque needs an attitude and there is none, if the method can't solve
    the scene, or if a torque in space acts on bodies given by coefficients.
    """
    check_prepared(scene, method)
    check_torque(scene, method, attitude=True)
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
    rows = rows_of_bodies(arrays)
    starts, times = rows_of("omega", omega0, 3), rows_of("t_end", t_end)
    counted = {**rows, "omega": starts, "t_end": times}
    if with_attitude:
        counted["attitude"] = rows_of("attitude", attitude0, 4)
    n = count_bodies(counted)
    at_rest = replace(scene, omega=_REST, attitude=None)
    found = place_for(out, n, with_attitude, estimates)
    if found.estimates is not None:
        found.estimates[:] = np.nan
    settings: Any = {"effort": effort, "attitude": with_attitude}
    # Bodies that differ in their starts alone share one solver.
    shared = None if rows else _kept_solver(scene, method, tolerance, effort, with_attitude)
    lanes = _lanes(scene, rows, tolerance, effort, with_attitude) if rows else None
    # `omega` or `attitude` may share memory with `out`.
    attitudes = np.full((n, 4), np.nan) if with_attitude else None
    own = Ensemble(np.full((n, 3), np.nan), found.status, attitudes, found.estimates)
    found.status[:] = Statuses.REFUSED
    turns = counted.get("attitude")

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        if shared is not None:
            solve_each(shared, starts, times, turns, own, piece, given_up)
            return
        left = list(range(piece.start, piece.stop))
        if lanes is not None:
            left = solve_lanes(*lanes, starts, times, turns, own, piece, given_up)
        for i in left:
            if given_up[0]:
                return
            with suppress(InputError):
                solver = prepare(scene_of_row(at_rest, rows, i), method, tolerance, **settings)
                solve_row(solver, i, starts, times, turns, own)

    for_each_piece(enter, n, threads)
    found.omega[:] = own.omega
    if found.attitude is not None:
        found.attitude[:] = own.attitude
    return found


def _lanes(
    scene: Scene, rows: Mapping[str, Array], tolerance: float, effort: float, attitude: bool
) -> tuple[Array, Array] | None:
    """Return the packed equations and parameters of bodies that one kernel call can solve, or None.

    Parameters of an invalid body are NaN, which the kernel refuses.
    """
    names = [name for name in rows if name.startswith(PARAMETER)]
    kind = next((name for name in ("moments", "coefficients") if name in rows), None)
    if (
        rows.keys() - {*names, kind}
        or not isinstance(scene.torque, StateTorque)
        or scene.changing is not None
        or (scene.inertia is not None and kind is None)
    ):
        return None
    columns, body = [], None
    with np.errstate(all="ignore"):
        if kind == "moments":
            first, second, third = moments = np.where(rows[kind] > 0.0, rows[kind], np.nan).T
            differences = (
                (second - third) / first,
                (third - first) / second,
                (first - second) / third,
            )
            columns = [*differences, *(1.0 / moments)]
        elif kind == "coefficients":
            columns = [*rows[kind].T, *np.ones((3, 1))]
        else:
            i1, i2, i3 = scene.moments or _ONES
            body = scene.euler_coefficients, (1.0 / i1, 1.0 / i2, 1.0 / i3)
    columns += [rows[name] for name in names]
    own = tuple(name.removeprefix(PARAMETER) for name in names)
    tape = tape_of_bodies(scene.torque, body, own, attitude)
    packed = packed_tape(tape, scene.step_size, tolerance, effort)
    return packed, np.column_stack([spread(each, max(map(len, columns))) for each in columns])


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


_METHODS = ("auto", "taylor", "closed-form")


class Details:
    """A request for the events and sensitivities of many bodies."""

    def __init__(
        self, scene: Scene | Sequence[Scene], t_end: Any, arrays: dict[str, Any], *, method: str,
        tolerance: Number | None, effort: float, events: object,
        sensitivities: Iterable[str] | None, has_rows: bool,
    ) -> None:  # fmt: skip
        """Check the request; copy the arrays, which may be overwritten.

        `t_end` has the times of all bodies if `has_rows`.
        """
        if method not in _METHODS:
            where = "sensitivities" if events is None else "events"
            raise InputError(f"{where}: the method is {method}; allowed: {', '.join(_METHODS)}")
        self.has_rows = has_rows
        self.times = t_end[None] if has_rows else rows_of("t_end", t_end).copy()
        self.rows: dict[str, Array] = {}
        self.scenes: list[Scene] = []
        if isinstance(scene, Scene):
            self.rows = checked_copies(arrays)
            if only_one({name: arrays[name] for name in BODIES}):  # the arrays give other bodies
                scene = replace(scene, changing=None, inertia=None, moments=(1.0, 1.0, 1.0))
            self.scene = scene
            first = self._any_scene()
        else:
            self.scenes = list(scene)
            first = self.scene = self.scenes[0]
        self.attitude = first.attitude is not None
        self.events = events
        self.n_events = 0
        if events is not None:
            functions = event_functions(events, self.attitude)
            for each in functions:
                if np.isfinite(each.limit):
                    raise InputError(
                        f"{each.name} is terminal; allowed in solve_many: events that are not; "
                        "or call solve for each body"
                    )
            self.n_events = len(functions)
        self.names: tuple[str, ...] | None = None
        if sensitivities is not None:
            self.names = checked_names(first, sensitivities, method, self.attitude)
        self.settings: dict[str, Any] = {
            "method": method, "tolerance": requested_tolerance(method, tolerance),
            "effort": effort, "attitude": self.attitude,
        }  # fmt: skip

    def added_to(self, found: Ensemble) -> Ensemble:
        """Return the result with the events and sensitivities."""
        n = len(found.omega)
        times: list[list[Array | None]] = [[None] * n for _ in range(self.n_events)]
        states: list[list[Array | None]] = [[None] * n for _ in range(self.n_events)]
        slopes: list[dict[str, Array] | None] = [None] * n
        refusals: dict[int, str] = {}
        expect_bodies(n)
        has_result = found.has_result
        for i in range(n):
            count_done(1)
            if not has_result[i].all():
                continue
            try:
                one = solve(
                    self._scene_of(i), row_of(self.times, i), events=self.events,
                    sensitivities=self.names, **self.settings,
                )  # fmt: skip
            except InputError as refusal:
                refusals[i] = str(refusal)
                continue
            for k, own in enumerate(one.t_events or []):
                times[k][i] = own
            for k, own in enumerate(one.y_events or []):
                states[k][i] = own
            if one.sensitivities is not None:
                rows = slice(None) if self.has_rows else 0
                slopes[i] = {name: each[rows] for name, each in one.sensitivities.items()}
        return replace(
            found,
            t_events=None if self.events is None else times,
            y_events=None if self.events is None else states,
            sensitivities=None
            if self.names is None
            else _stacked(self.names, slopes, self.times.shape[1:]),
            refusals=refusals,
        )

    def _scene_of(self, i: int) -> Scene:
        return self.scenes[i] if self.scenes else scene_of_row(self.scene, self.rows, i)

    def _any_scene(self) -> Scene:
        """Return the scene of the first valid body, or else the common scene."""
        for i in range(max(map(len, self.rows.values()), default=0)):
            try:
                return self._scene_of(i)
            except (InputError, IndexError):
                continue
        return self.scene


def checked_copies(arrays: dict[str, Any]) -> dict[str, Array]:
    """Return copies of the arrays, with one row for each body or for all."""
    rows = rows_of_bodies(arrays)
    for name, shape in (("coefficients", 3), ("omega", 3), ("attitude", 4)):
        if arrays[name] is not None:
            rows[name] = rows_of(name, arrays[name], shape)
    if "attitude" in rows:
        rows["attitude"] = unit_quaternions(rows["attitude"])
    return {name: each.copy() for name, each in rows.items()}


def _stacked(
    names: Sequence[str], slopes: Sequence[dict[str, Array] | None], rows: tuple[int, ...]
) -> dict[str, Array]:
    known = next((each for each in slopes if each is not None), None)
    found = {}
    for name in names:
        shape = (*rows, 3, 0) if known is None else known[name].shape
        found[name] = np.full((len(slopes), *shape), np.nan)
        for i, each in enumerate(slopes):
            if each is not None and each[name].shape == shape:
                found[name][i] = each[name]
    return found
