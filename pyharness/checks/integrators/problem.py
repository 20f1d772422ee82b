"""The random scenes in which an integrator is judged, and its errors and drifts in them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pyharness.checks.integrators.faults import State
from pyharness.checks.integrators.protocol import Motion, request
from pyharness.compare.orders import ORDER_SLACK
from pyharness.model.attitude import angle_between, product
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.scenes.moderate import KINDS, draw_moderate
from pyharness.truth.bounded import ErrorBound, bound_of
from pyharness.truth.reference import Reference, reference

LEVELS = 8
"""The number of step sizes or tolerances with which a scene is requested."""
DRAWS = 2
"""The default number of random scenes of each kind."""
PARTS = ("omega", "attitude")
"""The parts of a state whose errors are measured."""
_COARSEST, _PER_LEVEL = 1e-3, 0.1  # tolerances
_EACH = 2  # coarsest steps between two requested times
_ORDER_ONE = 1.5  # a measured order below this counts as 1
_SEVERAL = 4  # steps that must show the order 1
_LATE = 3  # tolerances before the last that must show the order too
_LEAST = 1e-300  # in place of an error of 0


@dataclass(frozen=True, eq=False)
class Problem:
    """A random scene in which an integrator is judged; its name is as in ``wave-1``."""

    scene: Scene

    @property
    def name(self) -> str:
        """Return the name of the scene: its kind of torque, and its number."""
        return self.scene.name

    @property
    def kind(self) -> str:
        """Return the kind of the torque, a member of the kinds of `scenes.moderate`."""
        return self.scene.name.partition("-")[0]

    @cached_property
    def times(self) -> Array:
        """Return the requested times (s)."""
        steps = np.arange(_EACH, self.scene.steps + 1, _EACH)
        return np.asarray(self.scene.step_size * steps, dtype=float)

    @cached_property
    def truth(self) -> Reference:
        """Return the true states at the requested times."""
        return reference(self.scene, self.times.tolist())

    @cached_property
    def bound(self) -> ErrorBound:
        """Return the proved or estimated bound of the error of the true states."""
        bound = bound_of(self.scene, self.truth, any_torque=True)
        return bound.over(float(np.abs(self.truth.omega).max()))

    def step_size(self, level: int) -> float:
        """Return the step size of a level, from 0 to `LEVELS` - 1 (s)."""
        return self.scene.step_size / 2.0**level

    def tolerance(self, level: int) -> float:
        """Return the tolerance of a level, from 0 to `LEVELS` - 1."""
        return _COARSEST * _PER_LEVEL**level

    @property
    def most_steps(self) -> float:
        """Return the number of the smallest steps until the last time."""
        return float(self.times[-1] / self.step_size(LEVELS - 1))

    def request(self, level: int) -> bytes:
        """Return the line of JSON that requests the states at a level of accuracy."""
        times, tolerance = self.times.tolist(), self.tolerance(level)
        return request(self.scene, times, self.step_size(level), tolerance)

    def errors(self, motion: Motion) -> tuple[float, float | None]:
        """Return the errors of omega, relative to the largest, and of the attitude (rad).

        An error is infinite if a number is not finite. That of an attitude that was not computed is
        None.
        """
        assert self.truth.attitude is not None
        return errors_between(State(self.truth.omega, self.truth.attitude), motion)


def errors_between(state: State, motion: Motion) -> tuple[float, float | None]:
    """Return the errors of an answer against the states: of omega, relative, and attitude (rad).

    The result is as that of `Problem.errors`.
    """
    with np.errstate(all="ignore"):
        omega = float(np.abs(motion.omega - state.omega).max() / np.abs(state.omega).max())
        angle = None
        if motion.attitude is not None:
            angle = finite_or_infinite(float(angle_between(motion.attitude, state.attitude).max()))
    return finite_or_infinite(omega), angle


def finite_or_infinite(x: float) -> float:
    """Return x, or infinity if it is not finite."""
    return x if math.isfinite(x) else math.inf


@dataclass(frozen=True)
class Convergence:
    """The errors of an integrator in one problem, of omega or of the attitude, and their order.

    Attributes
    ----------
    part : str
        A member of `PARTS`.
    settings : tuple of float
        The step sizes (s) or the tolerances, from the largest to the smallest.
    errors : tuple of float
        The error for each of them.
    order : float or None
        The power of the step size, or of the tolerance, with which the error falls; None if the
        errors are rounding errors from the start.
    """

    part: str
    settings: tuple[float, ...]
    errors: tuple[float, ...]
    order: float | None

    @property
    def is_first(self) -> bool:
        """Return whether the order is 1, up to the accuracy of the measurement.

        Several steps must show it, because rounding errors may do so in one pair of steps by
        chance.
        """
        if self.order is None:
            return False
        far = _power(self.errors[-_SEVERAL] / max(self.errors[-1], _LEAST),
                     self.settings[-_SEVERAL] / self.settings[-1])  # fmt: skip
        return all(1.0 - ORDER_SLACK <= each < _ORDER_ONE for each in (self.order, far))

    @property
    def is_higher(self) -> bool:
        """Return whether the order is above 1, or the errors are only rounding errors."""
        return self.order is None or self.order >= _ORDER_ONE


def convergence(
    part: str, settings: Sequence[float], errors: Sequence[float], floor: float, overall: bool
) -> Convergence:
    """Return the measured order of convergence of some errors.

    Parameters
    ----------
    part : str
        A member of `PARTS`.
    settings : sequence of float
        The step sizes (s) or the tolerances, in descending order.
    errors : sequence of float
        The error for each of them.
    floor : float
        An error that may be rounding error. Errors below it are not used.
    overall : bool
        Whether the order is that from the first to the last error above the floor, or over the last
        four if it is smaller there, as for tolerances, with which errors fall irregularly.
        Otherwise it is that of the last pair whose second error is above the floor.

    Returns
    -------
    Convergence
        The order, together with the arguments.
    """
    seen = [k for k in range(1, len(errors)) if not errors[k] <= floor]
    order = None
    if seen:
        last = seen[-1]
        # An error that ceases to fall shows in the last tolerances alone.
        firsts = {0, max(0, last - _LATE)} if overall else {last - 1}
        order = min(
            _power(errors[first] / errors[last], settings[first] / settings[last])
            for first in firsts
        )
    return Convergence(part, tuple(settings), tuple(errors), order)


def _power(errors: float, settings: float) -> float:
    """Return p if a ratio of errors is the power p of a ratio of step sizes or tolerances."""
    if math.isnan(errors) or errors <= 0.0:  # the error of the smaller step is infinite
        return 0.0
    return math.log(errors) / math.log(settings)


@dataclass(frozen=True, eq=False)
class Drift:
    """The drift of conserved quantities in a long motion without torque.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Times, s.
    energy, momentum : ndarray, shape (n,)
        Differences of energy and of the magnitude of the angular momentum from those at time 0,
        relative to these.
    direction : ndarray of shape (n,), or None
        Angle between the angular momentum in space and that at time 0 (rad); None without attitude.
    """

    times: Array
    energy: Array
    momentum: Array
    direction: Array | None

    def named(self) -> dict[str, Array]:
        """Return the quantities by name; the direction is left out if it is not known."""
        found = {"energy": self.energy, "momentum": self.momentum}
        return found if self.direction is None else {**found, "direction": self.direction}


def growth_power(times: Array, drift: Array) -> float | None:
    """Return p if the largest drift up to a time grows with its power p; None if it is rounding.

    The power is that from a quarter of the last time to the last.
    """
    quarter = times <= times[-1] / 4.0
    early, late = float(np.abs(drift[quarter]).max()), float(np.abs(drift).max())
    if not math.isfinite(late) or early <= 0.0:
        return None
    return math.log(late / early) / math.log(4.0)


def drift_of(scene: Scene, times: Array, motion: Motion) -> Drift:
    """Return the drift of the conserved quantities of a motion without torque.

    `times` (s) are those of the rows of `motion`.
    """
    moments = np.array(scene.moments)
    with np.errstate(all="ignore"):
        energies = (moments * motion.omega**2).sum(axis=1)
        lengths = np.linalg.norm(moments * motion.omega, axis=1)
        first = moments * np.array(scene.omega)
        energy = energies / (first @ np.array(scene.omega)) - 1.0
        momentum = lengths / np.linalg.norm(first) - 1.0
        direction = None
        if motion.attitude is not None:
            start = _in_space(np.array([scene.attitude]), first[None, :])[0]
            there = _in_space(motion.attitude, moments * motion.omega)
            sine = np.linalg.norm(np.cross(there, start), axis=1)
            direction = np.arctan2(sine, there @ start)
    return Drift(times, energy, momentum, direction)


def _in_space(attitude: Array, vectors: Array) -> Array:
    """Return vectors about the body axes as vectors about the axes of space, shape (n, 3)."""
    q = attitude.T
    turned = product(product(q, (np.zeros(len(vectors)), *vectors.T)), (q[0], *-q[1:]))
    return np.array(turned[1:]).T


@dataclass(frozen=True, eq=False)
class Judged:
    """The results of an integrator in one problem: all answers, and the measured orders."""

    problem: Problem
    answers: tuple[Motion, ...]
    convergences: tuple[Convergence, ...]

    @property
    def finest(self) -> Motion:
        """Return the answer with the smallest step size or tolerance."""
        return self.answers[-1]

    def of(self, part: str) -> Convergence | None:
        """Return the measured order of omega or of the attitude, or None if it was not computed."""
        return next((each for each in self.convergences if each.part == part), None)


def problems(seed: str, draws: int, names: Sequence[str] = ()) -> list[Problem]:
    """Return the random scenes in which an integrator is judged, `draws` of each kind.

    `names` selects scenes by their names, as in ``wave-1``, or by the kind; empty selects all.
    """
    drawn = [draw_moderate(seed, kind, number) for number in range(draws) for kind in KINDS]
    return [
        Problem(scene)
        for scene in drawn
        if not names or scene.name in names or scene.name.partition("-")[0] in names
    ]
