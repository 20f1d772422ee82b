"""Events and sensitivities of many bodies, computed body by body."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.engine.event_functions import event_functions
from pyharness.engine.many_scenes import rows_of_bodies, scene_of_row
from pyharness.engine.parameter_sensitivity import checked_names
from pyharness.engine.registry import requested_tolerance
from pyharness.engine.solve import solve
from pyharness.model.arrays import only_one, row_of, rows_of, unit_quaternions
from pyharness.model.ensemble import Ensemble
from pyharness.model.errors import InputError
from pyharness.model.progress import count_done, expect_bodies
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.model.values import Number

_METHODS = ("auto", "taylor", "closed-form")
_BODY = ("moments", "coefficients", "inertia")


class Details:
    """A request for the events and sensitivities of many bodies."""

    def __init__(
        self, scene: Scene | Sequence[Scene], t_end: Any, arrays: dict[str, Any], *, method: str,
        tolerance: Number | None, effort: float, events: object,
        sensitivities: Iterable[str] | None,
    ) -> None:  # fmt: skip
        """Check the request; copy the arrays, which may be overwritten."""
        if method not in _METHODS:
            where = "sensitivities" if events is None else "events"
            raise InputError(f"{where}: the method is {method}; allowed: {', '.join(_METHODS)}")
        self.times = rows_of("t_end", t_end).copy()
        self.rows: dict[str, Array] = {}
        self.scenes: list[Scene] = []
        if isinstance(scene, Scene):
            self.rows = _checked_rows(arrays)
            if only_one({name: arrays[name] for name in _BODY}):  # the arrays give other bodies
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
        for i, has_result in enumerate(found.has_result):
            count_done(1)
            if not has_result:
                continue
            try:
                one = solve(
                    self._scene_of(i), float(row_of(self.times, i)), events=self.events,
                    sensitivities=self.names, **self.settings,
                )  # fmt: skip
            except InputError as refusal:
                refusals[i] = str(refusal)
                continue
            for k, own in enumerate(one.t_events or []):
                times[k][i] = own
            for k, own in enumerate(one.y_events or []):
                states[k][i] = own
            slopes[i] = one.sensitivities
        return replace(
            found,
            t_events=None if self.events is None else times,
            y_events=None if self.events is None else states,
            sensitivities=None if self.names is None else _stacked(self.names, slopes),
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


def _checked_rows(arrays: dict[str, Any]) -> dict[str, Array]:
    """Return copies of the arrays, with one row for each body or for all."""
    rows = rows_of_bodies(arrays)
    for name, shape in (("coefficients", 3), ("omega0", 3), ("attitude0", 4)):
        if arrays[name] is not None:
            rows[name] = rows_of(name, arrays[name], shape)
    if "attitude0" in rows:
        rows["attitude0"] = unit_quaternions(rows["attitude0"])
    return {name: each.copy() for name, each in rows.items()}


def _stacked(names: Sequence[str], slopes: Sequence[dict[str, Array] | None]) -> dict[str, Array]:
    known = next((each for each in slopes if each is not None), None)
    found = {}
    for name in names:
        shape = (3, 0) if known is None else known[name].shape[1:]
        found[name] = np.full((len(slopes), *shape), np.nan)
        for i, each in enumerate(slopes):
            if each is not None and each[name].shape[1:] == shape:
                found[name][i] = each[name][0]
    return found
