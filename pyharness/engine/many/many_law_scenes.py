"""Solution of many scenes under torque laws."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.engine.plan.plan import FINEST
from pyharness.engine.plan.registry import REGISTRY, requested_tolerance
from pyharness.engine.prepared.many_laws import solve_at, solve_bodies
from pyharness.engine.prepared.many_scenes import (
    ONES,
    TORQUES,
    about_principal,
    checked_rows,
    from_scene,
    from_scenes,
    principal_rows_of_scene,
    rows_about,
    rows_of_scene,
)
from pyharness.engine.prepared.solver import CODES
from pyharness.model.arrays import rows_of
from pyharness.model.codes import Methods
from pyharness.model.ensemble import Ensemble
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import ROUNDING, Array
from pyharness.model.values import Number, checked_effort, finite


def solve_laws(
    scene: Scene | Sequence[Scene], t_end: Any, times: Array | None, arrays: dict[str, Any],
    out: "Ensemble | Array | None", step: Number | None, **settings: Any,
) -> Ensemble:  # fmt: skip
    own = {name: value for name, value in arrays.items() if value is not None}
    method = settings["method"]
    ready: dict[str, Any] = {}
    axes: Any = None
    turns: Any = None
    if isinstance(scene, Scene):
        step_size = scene.step_size
        is_moments = "moments" in own or "coefficients" in own
        is_tilted = scene.inertia is not None and not is_moments
        if is_tilted and own.keys().isdisjoint(("inertia", *TORQUES)):
            ready, axes, turns = principal_rows_of_scene(scene)
            own |= rows_about(checked_rows(own), axes, turns)
        elif is_tilted or "inertia" in own:
            given = {"inertia": scene.inertia, **from_scene(scene), **own}
            own, axes, turns = about_principal(given)
        else:
            if scene.inertia is not None:
                scene = replace(scene, inertia=None, moments=ONES)
            ready = rows_of_scene(scene)
    else:
        own = from_scenes(scene)
        if scene[0].inertia is not None:
            own, axes, turns = about_principal(own)
        step_size = scene[0].step_size
    if step is not None:
        step_size = finite("step", step)
    code, tolerance = choose_kernel(method, settings["tolerance"])
    kernel = code, tolerance, step_size, checked_effort(settings["effort"])
    options: Any = {"method": method, "is_rounded": axes is not None}
    options |= {"threads": settings["threads"], "with_estimates": settings["estimates"]}
    if times is None:
        own["t_end"] = t_end
        found = solve_bodies(ready, own, kernel, out=out, **options)
    else:
        found = solve_at(ready, own, times, kernel, **options)
    if axes is not None:
        _turn_back(found, axes, turns, {**ready, **own}, t_end)
    return found if found.leaves is None else replace(found, leaves=None)


def _turn_back(
    found: Ensemble, axes: Array, turns: Array, own: Mapping[str, Any], t_end: Any
) -> None:
    """Transform results from principal `axes` (columns, with quaternions `turns`) to body axes."""
    m = 1 if found.times is None else len(found.times)
    omega = found.omega.reshape(-1, m, 3)
    attitude = np.empty((0, m, 4)) if found.attitude is None else found.attitude.reshape(-1, m, 4)
    extension().turn_rows(axes.transpose(1, 2, 0), turns.T, omega.T, attitude.T)
    if found.attitude is not None and found.error is not None:
        # The initial omega was rounded after the rotation to principal axes.
        sizes = np.max(np.abs(own["omega"]), axis=1)
        ends = rows_of("t_end", t_end) if found.times is None else found.times
        found.error[:] += ROUNDING * (sizes if found.times is None else sizes[:, None]) * abs(ends)


def choose_kernel(method: str, tolerance: Number | None) -> tuple[int, float]:
    finest = max(FINEST, REGISTRY[method].finest if method == "quick" else 0.0)
    asked = requested_tolerance(method, tolerance)
    if not finest <= asked <= 1.0:
        raise InputError(f"tolerance is {asked:g}; allowed: {finest:g} to 1")
    return (Methods.CLOSED_FORM_OR_TAYLOR if method == "auto" else CODES[method]), asked
