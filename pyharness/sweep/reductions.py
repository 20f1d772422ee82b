"""Reductions: the quantities that a sweep can store for each scene."""

import importlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.checks.compare.batch import Batch
from pyharness.checks.theory.flips import flip_times
from pyharness.model.codes import Statuses
from pyharness.model.extension import ENDS
from pyharness.model.trajectory import STOP_VARIABLES, Array
from pyharness.sweep.attitude_reductions import (
    axis_flips,
    end_attitude,
    largest_tilt,
    pointing_error,
    tilted_time,
)
from pyharness.sweep.sweep import ReductionSpec

Found = NDArray[Any]
# Value in integer arrays of scenes that are not computed yet.
_NOT_YET = -1


@dataclass(frozen=True)
class Reduction:
    """A quantity that a sweep can store for each scene, and its computation.

    `compute` returns, for a batch of n scenes and the parameters, n values, or n rows with a value
    for each of `labels`, along `dimension`. `only` is `program` or `method` if the other can't
    compute it; `needs` lists `moments`, `no torque` or `attitude`. `parameters` has the defaults,
    `flags` the meanings of codes of outcomes.
    """

    title: str
    units: str
    compute: Callable[[Batch, Mapping[str, Any]], Found]
    dtype: str = "f8"
    labels: tuple[str, ...] = ()
    dimension: str = ""
    only: str = ""
    needs: tuple[str, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    flags: Mapping[int, str] = field(default_factory=dict)

    @property
    def fill(self) -> Any:
        """Return the value of scenes not computed yet: NaN, or -1 in an integer array."""
        return np.nan if self.dtype == "f8" else _NOT_YET


def _end(batch: Batch, _: Mapping[str, Any]) -> Found:
    return batch.omega


def _status(batch: Batch, _: Mapping[str, Any]) -> Found:
    return batch.status


def _error(batch: Batch, given: Mapping[str, Any]) -> Found:
    samples = given["samples"]
    rows = batch.rows(samples)
    steps = batch.scene.steps
    largest = np.abs(batch.omega0).max(axis=1)
    worst = np.zeros(len(rows))
    for i in range(samples):
        # A program has rows at whole steps only.
        part = batch.sample_steps(samples)[i] / steps if batch.is_program else (i + 1) / samples
        truth = batch.by_method(given["against"], given["tolerance"], part)
        largest = np.fmax(largest, np.abs(truth).max(axis=1))
        worst = np.maximum(worst, np.abs(rows[:, i] - truth).max(axis=1))
    found: Found = worst / largest
    return found


def _stop_step(batch: Batch, _: Mapping[str, Any]) -> Found:
    return np.where(batch.status == Statuses.STOPPED, batch.n_rows, 0)


def _stop_variable(batch: Batch, _: Mapping[str, Any]) -> Found:
    return batch.stop_variable


def _overflow_time(batch: Batch, _: Mapping[str, Any]) -> Found:
    # The first step whose result is not finite has no row.
    time = (batch.n_rows + 1) * batch.step_sizes
    return np.where(batch.status == Statuses.OVERFLOW, time, np.nan)


def _drift(batch: Batch, given: Mapping[str, Any]) -> Found:
    bodies = batch.bodies[:, None, :]
    start = batch.omega0[:, None, :]
    rows = batch.rows(given["samples"])
    found = []
    for weight in (bodies, bodies**2):
        then, before = (weight * rows**2).sum(axis=2), (weight * start**2).sum(axis=2)
        found.append(np.abs(then - before).max(axis=1) / before[:, 0])
    return np.stack(found, axis=1)


def _claim(batch: Batch, given: Mapping[str, Any]) -> Found:
    room, _, name = given["function"].partition(":")
    judge = getattr(importlib.import_module(room), name)
    return np.asarray(judge(batch))


def _largest_tilt(batch: Batch, given: Mapping[str, Any]) -> Found:
    start, rows = _unit(batch.omega0)[:, None, :], _unit(batch.rows(given["samples"]))
    # The arc cosine of the scalar product would lose half of the digits of a small angle.
    angles: Found = 2.0 * np.arctan2(
        np.linalg.norm(rows - start, axis=2), np.linalg.norm(rows + start, axis=2)
    )
    largest: Found = angles.max(axis=1)
    return largest


def _flips(batch: Batch, given: Mapping[str, Any]) -> Found:
    middle = np.argsort(batch.bodies, axis=1, kind="stable")[:, 1]
    column = np.broadcast_to(middle, (len(batch.omega0),))
    rows = np.concatenate([batch.omega0[:, None, :], batch.rows(given["samples"])], axis=1)
    component = np.take_along_axis(rows, column[:, None, None], axis=2)[:, :, 0]
    below = component < 0.0
    changes = (below[:, 1:] != below[:, :-1]) & np.isfinite(component[:, 1:])
    count: Found = changes.sum(axis=1)
    return count


def _flip_time(batch: Batch, _: Mapping[str, Any]) -> Found:
    return flip_times(batch.bodies, batch.omega0)


def _growth(batch: Batch, given: Mapping[str, Any]) -> Found:
    start = batch.omega0
    size = np.linalg.norm(start, axis=1, keepdims=True)
    offset = given["offset"] * np.where(size > 0.0, size, 1.0)
    moved = start + offset / np.sqrt(3.0)
    before = np.linalg.norm(moved - start, axis=1)
    after = np.linalg.norm(batch.from_start(moved).omega - batch.omega, axis=1)
    rate: Found = np.log(after / before) / np.abs(batch.t_end)
    return rate


def _unit(vectors: Array) -> Array:
    found: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return found


_SAMPLES = {"samples": 100}
_OF_AXES: dict[str, Any] = {"only": "method", "needs": ("moments", "attitude")}
_STATUSES = {code: name for code, name in enumerate(ENDS) if name != "interrupted"}
REDUCTIONS = {
    "end": Reduction(
        "angular velocity at the end", "rad/s", _end, labels=("1", "2", "3"), dimension="component"
    ),
    "status": Reduction("how it ended", "1", _status, "i1", flags=_STATUSES),
    "error": Reduction(
        "largest error of a component against a method, over the largest component",
        "1",
        _error,
        parameters={"against": "auto", "tolerance": 1e-14, "samples": 1},
    ),
    "stop-step": Reduction(
        "step at which the stop test ended it; 0: it did not",
        "1",
        _stop_step,
        "i4",
        only="program",
    ),
    "stop-variable": Reduction(
        "variable that ended it",
        "1",
        _stop_variable,
        "i1",
        only="program",
        flags={0: "none", **dict(enumerate(STOP_VARIABLES, 1))},
    ),
    "overflow-time": Reduction(
        "time of the first step without a finite result", "s", _overflow_time, only="program"
    ),
    "drift": Reduction(
        "largest change of energy and of squared angular momentum, relative",
        "1",
        _drift,
        labels=("energy", "momentum"),
        dimension="invariant",
        needs=("moments", "no torque"),
        parameters={"samples": 10},
    ),
    "claim": Reduction(
        "whether a claim holds; 2: it says nothing of the scene; 3: it holds in part",
        "1",
        _claim,
        "i1",
        parameters={"id": ""},
        flags={0: "fails", 1: "holds", 2: "silent", 3: "in part"},
    ),
    "largest-tilt": Reduction(
        "largest angle of the angular velocity from where it was",
        "rad",
        _largest_tilt,
        parameters=_SAMPLES,
    ),
    "attitude": Reduction(
        "attitude at the end, a quaternion from the body to space, scalar first",
        "1",
        end_attitude,
        labels=("0", "1", "2", "3"),
        dimension="quaternion",
        only="method",
        needs=("attitude",),
    ),
    "axis-tilt": Reduction(
        "largest angle in space of a body's axis from where it was",
        "rad",
        largest_tilt,
        parameters={**_SAMPLES, "of": "middle"},
        **_OF_AXES,
    ),
    "tilted-time": Reduction(
        "time during which the angle in space of a body's axis from where it was exceeds a limit",
        "s",
        tilted_time,
        parameters={**_SAMPLES, "of": "middle", "above": 0.5},
        **_OF_AXES,
    ),
    "axis-flips": Reduction(
        "times that the angle in space of a body's axis from where it was passes a right angle",
        "1",
        axis_flips,
        "i4",
        parameters={**_SAMPLES, "of": "middle"},
        **_OF_AXES,
    ),
    "pointing-error": Reduction(
        "angle of a body's axis from a direction in space at the end",
        "rad",
        pointing_error,
        parameters={"of": "largest", "towards": ()},
        **_OF_AXES,
    ),
    "flips": Reduction(
        "changes of sign of the component about the middle axis",
        "1",
        _flips,
        "i4",
        needs=("moments",),
        parameters=_SAMPLES,
    ),
    "flip-time": Reduction(
        "time between changes of sign of the component about the middle axis",
        "s",
        _flip_time,
        needs=("moments", "no torque"),
    ),
    "growth": Reduction(
        "logarithm of the error amplification, over the time",
        "1/s",
        _growth,
        parameters={"offset": 1e-6},
    ),
}


def needs_attitudes(asked: Iterable[ReductionSpec]) -> bool:
    """Return whether any of these reductions needs attitudes."""
    return any("attitude" in REDUCTIONS[each.reduction].needs for each in asked)


def empty(asked: ReductionSpec, n: int) -> Found:
    """Return an array of missing values, shape (n,) or (n, components)."""
    reduction = REDUCTIONS[asked.reduction]
    shape = (n, len(reduction.labels)) if reduction.labels else (n,)
    return np.full(shape, reduction.fill, dtype=reduction.dtype)


def reduced(asked: ReductionSpec, batch: Batch) -> Found:
    """Return a reduction of a batch: a value, or a row of components, for each scene."""
    given = {**dict(asked.parameters), "function": asked.function}
    # Infinities and NaN are valid results.
    with np.errstate(all="ignore"):
        return REDUCTIONS[asked.reduction].compute(batch, given)
