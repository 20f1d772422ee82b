"""Events and sensitivities of many bodies, by `solve` for each body."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pyharness.engine.events.event_functions import event_functions
from pyharness.engine.methods.parameter_sensitivity import checked_names
from pyharness.engine.plan.registry import requested_tolerance
from pyharness.engine.prepared.many_scenes import BODIES, ONES, checked_copies, scene_of_row
from pyharness.engine.solve import solve
from pyharness.model.arrays import only_one, row_of, rows_of
from pyharness.model.ensemble import Ensemble
from pyharness.model.errors import InputError
from pyharness.model.progress import count_done, expect_bodies
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.model.values import Number

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
            scene = replace(scene, changing=None, inertia=None, coefficients=None, moments=ONES)
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
