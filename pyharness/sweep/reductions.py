"""Reductions: the quantities that a sweep can store for each scene.

The parameter `samples` is the number of times at which states are read; `of` names a principal axis
by the rank of its moment (least, middle or largest).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.checks.compare.batch import Batch
from pyharness.checks.theory.flips import flip_times
from pyharness.model.attitude import product
from pyharness.model.codes import Statuses
from pyharness.model.extension import ENDS
from pyharness.model.trajectory import STOP_VARIABLES, Array
from pyharness.sweep.sweep import ReductionSpec

Found = NDArray[Any]
# Principal axes in ascending order of their moments.
RANKS = ("least", "middle", "largest")


@dataclass(frozen=True)
class Reduction:
    title: str
    # Returns n values, or n rows of components, for a batch of n scenes and parameters.
    compute: Callable[[Batch, Mapping[str, Any]], Found]
    units: str = "1"
    dtype: str = "f8"
    labels: tuple[str, ...] = ()  # names of the components
    dimension: str = ""  # name of the components' dimension
    only: str = ""  # `program` or `method` if the other lacks the quantity
    needs: tuple[str, ...] = ()  # requirements: `moments`, `no torque` or `attitude`
    parameters: Mapping[str, Any] = field(default_factory=dict)  # defaults
    flags: Mapping[int, str] = field(default_factory=dict)  # meanings of values that are codes

    @property
    def fill(self) -> Any:
        return np.nan if self.dtype == "f8" else -1


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
    return np.asarray(worst / largest)


def _overflow_time(batch: Batch, _: Mapping[str, Any]) -> Found:
    # The first step whose result is not finite has no row.
    time = (batch.n_rows + 1) * batch.step_sizes
    return np.where(batch.status == Statuses.OVERFLOW, time, np.nan)


def _drift(batch: Batch, given: Mapping[str, Any]) -> Found:
    # Scaled by powers of 2, so that no square is out of range.
    bodies = np.ldexp(batch.bodies, -_exponents(batch.bodies))[:, None, :]
    exponents = _exponents(batch.omega0)[:, None]
    start = np.ldexp(batch.omega0[:, None, :], -exponents)
    rows = np.ldexp(batch.rows(given["samples"]), -exponents)
    found = []
    for weight in (bodies, bodies**2):
        then, before = (weight * rows**2).sum(axis=2), (weight * start**2).sum(axis=2)
        found.append(np.abs(then - before).max(axis=1) / before[:, 0])
    return np.stack(found, axis=1)


def _largest_tilt(batch: Batch, given: Mapping[str, Any]) -> Found:
    start, rows = _unit(batch.omega0)[:, None, :], _unit(batch.rows(given["samples"]))
    return np.asarray(_angles(rows, start).max(axis=1))


def _flips(batch: Batch, given: Mapping[str, Any]) -> Found:
    middle = np.argsort(batch.bodies, axis=1, kind="stable")[:, 1]
    column = np.broadcast_to(middle, (len(batch.omega0),))
    rows = np.concatenate([batch.omega0[:, None, :], batch.rows(given["samples"])], axis=1)
    component = np.take_along_axis(rows, column[:, None, None], axis=2)[:, :, 0]
    is_finite = np.isfinite(component)
    # A component that is 0 keeps the sign that it had.
    places = np.where(component != 0.0, np.arange(component.shape[1]), 0)
    signs = np.sign(np.take_along_axis(component, np.maximum.accumulate(places, axis=1), axis=1))
    changes = signs[:, 1:] * signs[:, :-1] < 0.0
    # A program has rows until it ends; a scene that a method could not solve has no count.
    is_known = is_finite[:, 1] if batch.is_program else is_finite.all(axis=1)
    return np.where(is_known, changes.sum(axis=1), -1)


def _growth(batch: Batch, given: Mapping[str, Any]) -> Found:
    start = batch.omega0
    size = _norms(start)[:, None]
    offset = given["offset"] * np.where(size > 0.0, size, 1.0)
    moved = start + offset / np.sqrt(3.0)
    before = _norms(moved - start)
    after = _norms(batch.from_start(moved).omega - batch.omega)
    return np.asarray(np.log(after / before) / np.abs(batch.t_end))


def _exponents(vectors: Array) -> NDArray[np.intc]:
    """Return the binary exponent of each vector's largest component, shape (..., 1)."""
    return np.asarray(np.frexp(np.abs(vectors).max(axis=-1, keepdims=True))[1])


def _norms(vectors: Array) -> Array:
    exponents = _exponents(vectors)
    scaled = np.linalg.norm(np.ldexp(vectors, -exponents), axis=-1)
    return np.asarray(np.ldexp(scaled, exponents[..., 0]))


def _unit(vectors: Array) -> Array:
    scaled = np.ldexp(vectors, -_exponents(vectors))
    return np.asarray(scaled / np.linalg.norm(scaled, axis=-1, keepdims=True))


def _angles(ours: Array, theirs: Array) -> Array:
    # The arc cosine of the scalar product would lose half of the digits of a small angle.
    across, along = (np.linalg.norm(each, axis=-1) for each in (ours - theirs, ours + theirs))
    return np.asarray(2.0 * np.arctan2(across, along))


def _axis_tilt(batch: Batch, given: Mapping[str, Any]) -> Found:
    return np.asarray(_tilts(batch, given).max(axis=1))


def _tilted_time(batch: Batch, given: Mapping[str, Any]) -> Found:
    # Each sample counts for the time since the previous sample.
    angles = _tilts(batch, given)
    share = (angles > given["above"]).mean(axis=1)
    return np.where(np.isfinite(angles).all(axis=1), share * np.abs(batch.t_end), np.nan)


def _axis_flips(batch: Batch, given: Mapping[str, Any]) -> Found:
    along, across = _tilt_squares(batch, given)
    is_over = np.concatenate([np.zeros((len(along), 1), bool), across > along], axis=1)
    count = (is_over[:, 1:] != is_over[:, :-1]).sum(axis=1)
    return np.where(np.isfinite(along).all(axis=1), count, -1)


def _pointing_error(batch: Batch, given: Mapping[str, Any]) -> Found:
    # Without `towards`, the direction in space is the initial direction of the axis.
    if not given["towards"]:
        return _axis_tilt(batch, {**given, "samples": 1})
    target = np.array(given["towards"])
    target = target / np.abs(target).max()
    target = target / np.linalg.norm(target)
    attitudes = _in_space(batch)
    unit = _is_own(batch, given, len(attitudes)).astype(float)
    w, x, y, z = attitudes.T
    _, *vector = product(product((w, x, y, z), (0.0, *unit.T)), (w, -x, -y, -z))
    return _angles(np.stack(vector, axis=1), target)


def _in_space(batch: Batch) -> Found:
    turn = batch.attitudes(1)[:, 0]
    return np.stack(np.broadcast_arrays(*product(batch.first_attitudes.T, turn.T)), axis=1)


def _tilts(batch: Batch, given: Mapping[str, Any]) -> Array:
    along, across = _tilt_squares(batch, given)
    return np.asarray(2.0 * np.arctan2(np.sqrt(across), np.sqrt(along)))


def _tilt_squares(batch: Batch, given: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return squared cosine and sine of half a body axis's angle to its initial direction."""
    squares = batch.attitudes(given["samples"]) ** 2
    is_own = _is_own(batch, given, len(squares))[:, None, :]
    along = squares[:, :, 0] + np.where(is_own, squares[:, :, 1:], 0.0).sum(axis=2)
    across = np.where(is_own, 0.0, squares[:, :, 1:]).sum(axis=2)
    return along, across


def _is_own(batch: Batch, given: Mapping[str, Any], n: int) -> NDArray[np.bool_]:
    axis = np.argsort(batch.bodies, axis=1, kind="stable")[:, RANKS.index(given["of"])]
    return np.asarray(np.arange(3) == np.broadcast_to(axis, (n,))[:, None])


_SAMPLES = {"samples": 100}
_SAMPLED: dict[str, Any] = {"parameters": _SAMPLES}
_OF_AXES: dict[str, Any] = {"only": "method", "needs": ("moments", "attitude")}
_OF_AXIS: dict[str, Any] = {**_OF_AXES, "parameters": {**_SAMPLES, "of": "middle"}}
_COMPONENTS: dict[str, Any] = {"labels": ("1", "2", "3"), "dimension": "component"}
_VARIABLES = {0: "none", **dict(enumerate(STOP_VARIABLES, 1))}
_STOPS: dict[str, Any] = {"dtype": "i1", "only": "program", "flags": _VARIABLES}
_STATUSES = {code: name for code, name in enumerate(ENDS) if name != "interrupted"}
REDUCTIONS = {
    "end": Reduction(
        "angular velocity at the end", lambda batch, _: batch.omega, "rad/s", **_COMPONENTS
    ),
    "status": Reduction("how it ended", lambda batch, _: batch.status, dtype="i1", flags=_STATUSES),
    "error": Reduction(
        "largest error of a component against a method, over the largest component",
        _error,
        parameters={"against": "auto", "tolerance": 1e-14, "samples": 1},
    ),
    "stop-step": Reduction(
        "step at which the stop test ended it; 0: it did not",
        lambda batch, _: np.where(batch.status == Statuses.STOPPED, batch.n_rows, 0),
        dtype="i4",
        only="program",
    ),
    "stop-variable": Reduction(
        "variable that ended it", lambda batch, _: batch.stop_variable, **_STOPS
    ),
    "overflow-time": Reduction(
        "time of the first step without a finite result", _overflow_time, "s", only="program"
    ),
    "drift": Reduction(
        "largest change of energy and of squared angular momentum, relative",
        _drift,
        labels=("energy", "momentum"),
        dimension="invariant",
        needs=("moments", "no torque"),
        parameters={"samples": 10},
    ),
    "claim": Reduction(
        "whether a claim holds; 2: it says nothing of the scene; 3: it holds in part",
        lambda batch, given: np.asarray(given["function"](batch)),
        dtype="i1",
        parameters={"id": ""},
        flags={0: "fails", 1: "holds", 2: "silent", 3: "in part"},
    ),
    "largest-tilt": Reduction(
        "largest angle of the angular velocity from where it was", _largest_tilt, "rad", **_SAMPLED
    ),
    "attitude": Reduction(
        "attitude at the end, a quaternion from the body to space, scalar first",
        lambda batch, _: _in_space(batch),
        labels=("0", "1", "2", "3"),
        dimension="quaternion",
        only="method",
        needs=("attitude",),
    ),
    "axis-tilt": Reduction(
        "largest angle in space of a body's axis from where it was", _axis_tilt, "rad", **_OF_AXIS
    ),
    "tilted-time": Reduction(
        "time during which the angle in space of a body's axis from where it was exceeds a limit",
        _tilted_time,
        "s",
        parameters={**_SAMPLES, "of": "middle", "above": 0.5},
        **_OF_AXES,
    ),
    "axis-flips": Reduction(
        "times that the angle in space of a body's axis from where it was passes a right angle",
        _axis_flips,
        dtype="i4",
        **_OF_AXIS,
    ),
    "pointing-error": Reduction(
        "angle of a body's axis from a direction in space at the end",
        _pointing_error,
        "rad",
        parameters={"of": "largest", "towards": ()},
        **_OF_AXES,
    ),
    "flips": Reduction(
        "changes of sign of the component about the middle axis",
        _flips,
        dtype="i4",
        needs=("moments",),
        parameters=_SAMPLES,
    ),
    "flip-time": Reduction(
        "time between changes of sign of the component about the middle axis",
        lambda batch, _: flip_times(batch.bodies, batch.omega0),
        "s",
        needs=("moments", "no torque"),
    ),
    "growth": Reduction(
        "logarithm of the error amplification, over the time",
        _growth,
        "1/s",
        parameters={"offset": 1e-6},
    ),
}


def needs_attitudes(asked: Iterable[ReductionSpec]) -> bool:
    return any("attitude" in REDUCTIONS[each.reduction].needs for each in asked)


def empty(asked: ReductionSpec, n: int) -> Found:
    """Return an array of missing values for n scenes, shape (n,) or (n, components)."""
    reduction = REDUCTIONS[asked.reduction]
    shape = (n, len(reduction.labels)) if reduction.labels else (n,)
    return np.full(shape, reduction.fill, dtype=reduction.dtype)


def reduced(asked: ReductionSpec, batch: Batch) -> Found:
    given = {**dict(asked.parameters), "function": asked.function}
    # Infinities and NaN are valid results.
    with np.errstate(all="ignore"):
        return REDUCTIONS[asked.reduction].compute(batch, given)
