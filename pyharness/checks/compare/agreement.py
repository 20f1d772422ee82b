"""Errors of trajectories against the reference, and differences between Fortran and Python."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyharness.model.attitude import angle_between
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory, turned_to_space
from pyharness.truth.reference import Reference


@dataclass(frozen=True, eq=False)
class Accuracy:
    """The errors of a trajectory against the reference, and drifts of conserved quantities."""

    omega: tuple[float, float, float]  # largest error of each component (rad/s)
    velocity: float | None  # largest error of any component (m/s)
    # Drifts of the energy and of the squared angular momentum, relative to the initial values; None
    # with a torque, without moments or for an empty trajectory.
    energy: float | None
    momentum: float | None
    error: Array  # shape (n,): largest error of omega at each time (rad/s)
    turned: Array | None = None  # shape (n,): error of the attitude at each time (rad)
    # Drift of the angular momentum in space, relative to its initial norm; None also without an
    # attitude.
    momentum_in_space: float | None = None

    @property
    def angle(self) -> float | None:
        """The largest error of the attitude (rad); None without one, infinite without times."""
        return None if self.turned is None else _largest(self.turned)


def accuracy(scene: Scene, trajectory: Trajectory, truth: Reference) -> Accuracy:
    """Return errors against `truth`, up to the last common time, and drifts.

    Errors of an empty trajectory are infinite.
    """
    n = min(len(trajectory.time), len(truth.time))
    with np.errstate(all="ignore"):
        errors = np.abs(trajectory.omega[:n] - truth.omega[:n])
        speed = None
        if trajectory.velocity is not None and truth.velocity is not None:
            speed = _largest(np.abs(trajectory.velocity[:n] - truth.velocity[:n]))
        energy = momentum = turned = in_space = None
        is_free = scene.moments is not None and scene.torque.is_zero and len(trajectory.omega) > 0
        if is_free:
            inertia = _scaled(np.array(scene.moments))
            energy = _drift(scene, trajectory, inertia)
            momentum = _drift(scene, trajectory, inertia * inertia)
        if trajectory.attitude is not None and truth.attitude is not None:
            turned = angle_between(trajectory.attitude[:n], truth.attitude[:n])
            in_space = _drift_in_space(scene, trajectory) if is_free else None
        first, second, third = map(_largest, errors.T)
        largest = errors.max(axis=1, initial=0)
        omega = first, second, third
        return Accuracy(omega, speed, energy, momentum, largest, turned, in_space)


def _largest(errors: Array) -> float:
    return float(errors.max()) if errors.size else math.inf


def _drift(scene: Scene, trajectory: Trajectory, weights: Array) -> float:
    exponent = _exponent(scene.omega)
    start = float(weights @ np.square(np.ldexp(scene.omega, -exponent)))
    if start == 0.0:
        return 0.0
    rows = np.square(np.ldexp(trajectory.omega, -exponent)) @ weights
    return float(np.abs(rows / start - 1.0).max(initial=0.0))


def _drift_in_space(scene: Scene, trajectory: Trajectory) -> float:
    moments, exponent = _scaled(np.array(scene.moments)), _exponent(scene.omega)
    before = moments * np.ldexp(scene.omega, -exponent)
    (start,) = turned_to_space(np.array([scene.attitude]), before[None, :])
    size = float(np.linalg.norm(start))
    if size == 0.0:
        return 0.0
    assert trajectory.attitude is not None
    momentum = turned_to_space(trajectory.attitude, moments * np.ldexp(trajectory.omega, -exponent))
    return float(np.linalg.norm(momentum - start, axis=1).max(initial=0.0)) / size


def _scaled(vector: Array) -> Array:
    """Return a vector scaled by a power of 2 to components below 1, so that no square overflows."""
    return np.asarray(np.ldexp(vector, -_exponent(vector)))


def _exponent(vector: ArrayLike) -> int:
    return int(np.frexp(np.abs(vector).max())[1])


def distance(first: Trajectory, second: Trajectory) -> float:
    """Return the largest difference in units in the last place; infinite for unequal lengths."""
    if len(first.time) != len(second.time):
        return math.inf
    names = ("recorded_time", "omega", "velocity")
    return max(ulps(_rows(first, name), _rows(second, name)) for name in names)


def differences(first: Trajectory, second: Trajectory) -> list[str]:
    """Return the names of counts and endings that differ or, if all agree, of differing arrays."""
    names = {"steps": "steps", "evaluations": "evaluations", "ended": "ending", "stop": "stop"}
    found = [told for name, told in names.items() if getattr(first, name) != getattr(second, name)]
    if found:
        return found
    names = {"time": "time", "recorded_time": "TIME", "omega": "omega", "velocity": "velocity"}
    found = [told for name, told in names.items() if ulps(_rows(first, name), _rows(second, name))]
    if not np.array_equal(first.ier, second.ier):
        found.append("IER")
    if first.exact is not None and second.exact is not None:
        pairs = zip(first.exact.ravel().tolist(), second.exact.ravel().tolist(), strict=True)
        # As text, because nan differs from nan, and 0.0 equals -0.0.
        if any(x.m != y.m or str(x.e) != str(y.e) for x, y in pairs):
            found.append("numbers of the word")
    return found


def _rows(trajectory: Trajectory, name: str) -> Array:
    found: Array | None = getattr(trajectory, name)
    return np.empty((0, 3)) if found is None else found


def ulps(x: Array | float, y: Array | float) -> float:
    """Return the largest of the distances between corresponding elements."""
    return float(ulp_distances(x, y).max(initial=0.0))


def ulp_distances(x: Array | float, y: Array | float) -> Array:
    """Return the distances between corresponding elements, in units in the last place.

    The distance is 0 between two NaNs, infinite between NaN and a number.
    """
    first, second = _ordinal(x), _ordinal(y)
    distance = (np.maximum(first, second) - np.minimum(first, second)).astype(float)
    is_nan, other_is_nan = np.isnan(x), np.isnan(y)
    distance[is_nan & other_is_nan] = 0.0
    distance[is_nan ^ other_is_nan] = math.inf
    return distance


def _ordinal(x: Array | float) -> NDArray[np.uint64]:
    """Return the rank of each float among all floats; -0 is just below +0."""
    bits = np.ascontiguousarray(x).view(np.uint64)
    return np.where(bits >> 63, ~bits, bits | np.uint64(1 << 63))
