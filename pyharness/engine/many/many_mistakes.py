"""Reasons for which bodies of a batch are refused."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pyharness.engine.prepared.many_scenes import PARAMETER, checked_copies, scene_of_row
from pyharness.engine.prepared.solver import prepare
from pyharness.model.arrays import row_of, rows_of
from pyharness.model.codes import Statuses
from pyharness.model.ensemble import Ensemble
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.values import finite

_MOST_NAMED = 100  # bodies
_RESULTS = Statuses.COMPLETE, Statuses.SENSITIVE


def reasons_of(
    found: Ensemble, scene: Scene | Sequence[Scene], arrays: dict[str, Any],
    states: Mapping[str, Any] | None, t_end: Any, method: str,
) -> dict[int, str] | None:  # fmt: skip
    """Return the reasons of refused bodies, by index, or None."""
    if found.status.max(initial=0) == Statuses.COMPLETE:
        return None
    status = found.status if found.status.ndim > 1 else found.status[:, None]
    refused = np.flatnonzero((status == Statuses.REFUSED).any(axis=1))[:_MOST_NAMED]
    if any(name.startswith(PARAMETER) for name in arrays):
        # A torque that is undefined for its parameters is a mistake, not the end of a motion.
        has_ended = ~np.isin(status, (*_RESULTS, Statuses.REFUSED)).all(axis=1)
        refused = np.union1d(refused, np.flatnonzero(has_ended))
    if not refused.size:
        return None
    times = np.zeros(1) if t_end is None else rows_of("t_end", t_end)
    rows = checked_copies(arrays, as_given=True) if isinstance(scene, Scene) else {}
    reasons = {}
    for i in refused.tolist():
        try:
            finite("t_end", row_of(times, i))
            for name, values in (states or {}).items():
                finite(f"states: {name}", row_of(np.atleast_1d(values), i))
            body = scene_of_row(scene, rows, i) if isinstance(scene, Scene) else scene[i]
            if not body.states:
                options: Any = {"attitude": body.attitude is not None}
                prepare(body, method, **options)
        except InputError as mistake:
            reasons[i] = str(mistake)
            status[i] = Statuses.REFUSED
    return reasons or None
