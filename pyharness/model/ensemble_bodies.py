"""Bodies of an ensemble as trajectories, and a summary of all."""

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.report import counted
from pyharness.model.trajectory import Trajectory

if TYPE_CHECKING:
    from pyharness.model.ensemble import Ensemble

_SHOWN = 5  # number of bodies in HTML
_ROWS = ("omega", "attitude", "own")


def trajectory_of_body(found: "Ensemble", body: int) -> Trajectory:
    """Return the results of one body, without those that are missing."""
    has_result = np.atleast_1d(found.has_result[body])
    values: dict[str, Any] = {"velocity": None, "steps": 0, "evaluations": 0}
    for name in _ROWS:
        array = getattr(found, name)
        if array is not None:
            values[name] = array[body].reshape(len(has_result), -1)[has_result]
    values["time"] = values["recorded_time"] = times_of_body(found, body)[has_result]
    endings = np.atleast_1d(found.ended[body])
    late = endings[~has_result] if not has_result.all() else endings[endings != "complete"]
    values["ended"] = str(late[0]) if late.size else "complete"
    if found.refusals is not None:
        values["reason"] = found.refusals.get(body)
    if found.estimates is not None and has_result.any():
        estimates = found.estimates[body].reshape(-1, 2)[has_result]
        values["error"], values["growth"] = map(_known, estimates.max(axis=0).tolist())
    for name in ("t_events", "y_events"):
        events = getattr(found, name)
        if events is not None and all(each[body] is not None for each in events):
            values[name] = [each[body] for each in events]
    if found.sensitivities is not None:
        values["sensitivities"] = {
            name: (each[body] if found.times is not None else each[body][None])[has_result]
            for name, each in found.sensitivities.items()
        }
    return Trajectory.create(**values)


def times_of_body(found: "Ensemble", body: int) -> Array:
    if found.times is not None:
        times: Array = found.times
        return times
    return np.array([np.nan if found.t_end is None else found.t_end[body]])


def _known(value: float) -> float | None:
    return None if np.isnan(value) else value


def summary_of(found: "Ensemble") -> str:
    """Return a sentence on how the computations ended."""
    endings, counts = np.unique(found.ended, return_counts=True)
    parts = [f"{n} {name}" for name, n in zip(endings.tolist(), counts.tolist(), strict=True)]
    rows = "" if found.times is None else f" at {counted(len(found.times), 'time')}"
    bodies = f"{len(found)} bod{'y' if len(found) == 1 else 'ies'}"
    text = f"{bodies}{rows}: {', '.join(parts) or 'none'}"
    for body, reason in list((found.refusals or {}).items())[:1]:
        text += f"; body {body}: {reason}"
    return f"{text}."


def html_of(found: "Ensemble") -> str:
    parts = [f"<p>{escape(summary_of(found))}</p>"]
    for body in range(min(len(found), _SHOWN)):
        text = "\n".join(found[body].html_rows())
        parts.append(f"<details><summary>Body {body}</summary>{text}</details>")
    return "\n".join(parts)
