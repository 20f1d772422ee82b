"""Random scenes in which an integrator is judged, and its errors and drift.

The drift is the change of conserved quantities in a long torque-free motion: relative for energy
and |L|, an angle (rad) for the direction of the angular momentum L in space. A level, from 0 to
`LEVELS` - 1, sets a step size (s) and a tolerance; both decrease with the level.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from pyharness.checks.compare.orders import ORDER_SLACK
from pyharness.checks.integrators.faults import Fault, State, in_space, motions
from pyharness.checks.integrators.protocol import Motion, request
from pyharness.checks.scenes.random_scenes import MODERATE, draw_moderate
from pyharness.model.attitude import angle_between
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.bounded import ErrorBound, bound_of
from pyharness.truth.reference import Reference, reference

LEVELS = 8
"""The number of levels."""
DRAWS = 2
"""Default number of random scenes of each kind of torque."""
PARTS = ("omega", "attitude")
"""The parts of a state whose errors are measured."""
_COARSEST, _PER_LEVEL = 1e-3, 0.1  # tolerance of level 0, and factor from level to level
_EACH = 2  # number of largest steps between requested times
_ORDER_ONE = 1.5  # a smaller measured order counts as 1
_SEVERAL = 4  # number of step sizes that must show the order 1
_LATE = 3  # number of earlier tolerances over which the order is measured too
_LEAST = 1e-300  # replaces an error of 0 in the computation of an order
# A larger error, in roundings times the square root of the number of steps, is the method's.
_ROUNDINGS = 240.0
_BETWEEN = 8.0  # time (s) between states of the long motion
_ROWS, _FEWEST, _FEWEST_COARSE = 64, 16, 4
# Levels of the largest step size (1/32 s) and tolerance (1e-6) of the long motion.
_FIRST = {"step_size": 4, "tolerance": 3}
_MARGIN, _WITHOUT_ATTITUDE = 16.0, 64.0  # factors on an error; an attitude's error is larger
_TOTAL = 3.0  # largest sum of the limits of all rows: errors of explicit methods may grow
_MOST = 0.9  # a larger limit would pass a body that stops

CHANGE = Basis(
    "measured",
    "change of energy or angular momentum without torque (relative, or rad) in 8 s: 16 times the "
    "error in a short motion with the same step or tolerance, in proportion to time; 64 times "
    "without attitude",
    "`python -m tests.campaigns.integrator_campaign 40 1`, where the largest ratio to it is .23",
)


@dataclass(frozen=True, eq=False)
class Problem:
    """A random scene for an integrator, named as in ``wave-1``."""

    scene: Scene

    @property
    def name(self) -> str:
        return self.scene.name

    @property
    def kind(self) -> str:
        return self.scene.name.partition("-")[0]

    @property
    def has_waves(self) -> bool:
        return bool(self.scene.law.sines or self.scene.law.cosines)

    @cached_property
    def times(self) -> Array:
        """The requested times (s)."""
        steps = np.arange(_EACH, self.scene.steps + 1, _EACH)
        return np.asarray(self.scene.step_size * steps, dtype=float)

    @cached_property
    def truth(self) -> Reference:
        return reference(self.scene, self.times.tolist())

    @cached_property
    def bound(self) -> ErrorBound:
        """The error bound of `truth`, relative to the largest omega."""
        bound = bound_of(self.scene, self.truth, any_torque=True)
        return bound.over(float(np.abs(self.truth.omega).max()))

    @cached_property
    def faulty(self) -> list[tuple[Fault, State]]:
        return list(motions(self.scene, self.times, self.step_size(LEVELS - 1)))

    def faulty_states(self, fault: Fault, level: int) -> State:
        if fault.of_step:
            found = fault.motion(self.scene, self.times, self.step_size(level))
            assert found is not None
            return found
        return next(state for each, state in self.faulty if each is fault)

    def step_size(self, level: int) -> float:
        return self.scene.step_size / 2.0**level

    def tolerance(self, level: int) -> float:
        return _COARSEST * _PER_LEVEL**level

    @property
    def most_steps(self) -> float:
        """The number of steps of the smallest size until the last time."""
        return float(self.times[-1] / self.step_size(LEVELS - 1))

    def floor(self, rounding: float) -> float:
        """Return a bound on the error of omega from roundings of relative size `rounding`."""
        return _ROUNDINGS * rounding * math.sqrt(self.most_steps)

    def request(self, level: int, scene: Scene | None = None, times: Array | None = None) -> bytes:
        asked = (self.times if times is None else times).tolist()
        return request(scene or self.scene, asked, self.step_size(level), self.tolerance(level))

    def errors(self, motion: Motion) -> tuple[float, float | None]:
        """Return the largest errors of omega (relative) and attitude (rad), possibly infinite."""
        assert self.truth.attitude is not None
        return errors_between(State(self.truth.omega, self.truth.attitude), motion)


def errors_between(state: State, motion: Motion) -> tuple[float, float | None]:
    """Return the errors of `motion` against `state`, as in `Problem.errors`."""
    with np.errstate(all="ignore"):
        omega = float(np.abs(motion.omega - state.omega).max() / np.abs(state.omega).max())
        angle = None
        if motion.attitude is not None:
            angle = finite_or_infinite(float(angle_between(motion.attitude, state.attitude).max()))
    return finite_or_infinite(omega), angle


def finite_or_infinite(x: float) -> float:
    return x if math.isfinite(x) else math.inf


@dataclass(frozen=True)
class Convergence:
    """The errors of omega or attitude in one problem, at decreasing step sizes or tolerances."""

    part: str  # "omega" or "attitude"
    settings: tuple[float, ...]
    errors: tuple[float, ...]
    # Power of the settings to which the errors are proportional; None if all are rounding errors.
    order: float | None

    @property
    def is_first(self) -> bool:
        """Return whether the order is about 1 over the last two and last four settings."""
        if self.order is None:
            return False
        far = _power(self.errors[-_SEVERAL] / max(self.errors[-1], _LEAST),
                     self.settings[-_SEVERAL] / self.settings[-1])  # fmt: skip
        return all(1.0 - ORDER_SLACK <= each < _ORDER_ONE for each in (self.order, far))

    @property
    def converges(self) -> bool:
        """Return whether the order is at least 0.5, or unknown (None)."""
        return self.order is None or self.order >= 1.0 - ORDER_SLACK

    @property
    def is_higher(self) -> bool:
        """Return whether the order is clearly above 1, or unknown (None)."""
        return self.order is None or self.order >= _ORDER_ONE

    def predicted(self, level: int) -> float:
        """Return a level's error, extrapolated from the next level's error by the order."""
        ratio = self.settings[level] / self.settings[level + 1]
        return self.errors[level + 1] * math.pow(ratio, self.order or 0.0)


def convergence(
    part: str, settings: Sequence[float], errors: Sequence[float], floor: float, overall: bool
) -> Convergence:
    """Return a part's errors and their order of convergence, measured above `floor`.

    With `overall`, the order is over more than the last two settings.
    """
    seen = [k for k in range(1, len(errors)) if not errors[k] <= floor]
    order = None
    if seen:
        last = seen[-1]
        # Only the last settings show an error that stops decreasing.
        firsts = {0, max(0, last - _LATE)} if overall else {last - 1}
        known = [k for k in firsts if math.isfinite(errors[k])]
        powers = [_power(errors[k] / errors[last], settings[k] / settings[last]) for k in known]
        order = min(powers, default=0.0)
    return Convergence(part, tuple(settings), tuple(errors), order)


def _power(errors: float, settings: float) -> float:
    if math.isnan(errors) or errors <= 0.0:  # the error of the smaller step is infinite
        return 0.0
    return math.log(errors) / math.log(settings)


@dataclass(frozen=True, eq=False)
class Judged:
    problem: Problem
    answers: tuple[Motion, ...]
    convergences: tuple[Convergence, ...]

    @property
    def finest(self) -> Motion:
        return self.answers[-1]

    @cached_property
    def lost(self) -> int:
        """The number of states that are not finite, although they should be."""
        rows = self.finest.lost
        for level in range(LEVELS - 2, -1, -1):
            lost, next_lost = (each.lost for each in self.answers[level : level + 2])
            predicted = max(each.predicted(level) for each in self.convergences)
            # With a large step or tolerance an overflow may be expected.
            if lost and not next_lost and predicted >= 1.0:
                break
            rows += lost
        return rows

    def error(self, level: int) -> float:
        """Return the larger of the errors of omega (relative) and attitude (rad).

        The result is at least the tolerance or, with a fixed step, a bound on rounding errors.
        """
        problem, finest = self.problem, self.finest
        by_tolerance = finest.control == "tolerance"
        least = problem.tolerance(level) if by_tolerance else problem.floor(finest.rounding)
        return max(least, *(each.errors[level] for each in self.convergences))

    def order_of(self, part: str) -> Convergence | None:
        return next((each for each in self.convergences if each.part == part), None)


def problems(seed: str, draws: int, names: Sequence[str] = ()) -> list[Problem]:
    """Return `draws` random scenes of each kind; if `names` (scenes or kinds), only these."""
    pairs = product(range(draws), MODERATE)
    drawn = (Problem(draw_moderate(seed, kind, number)) for number, kind in pairs)
    return [each for each in drawn if not names or each.name in names or each.kind in names]


@dataclass(frozen=True, eq=False)
class Drift:
    """Drifts of a long motion since time 0."""

    times: Array  # s, shape (n,)
    # Drifts by "energy", "momentum" (both relative) and, with attitudes, "direction" (of the
    # angular momentum in space, rad), each of shape (n,)
    named: dict[str, Array]
    change: float  # largest change of a drift between successive times


def long_motion(free: Judged) -> tuple[int, Array, float | None]:
    """Return a long motion's level, times (s) and limit of drift between successive times.

    The limit is None if errors are too large.
    """
    control = free.finest.control
    levels = range(_FIRST[control], LEVELS)
    margin = _WITHOUT_ATTITUDE if free.finest.attitude is None else _MARGIN
    limits = [margin * free.error(k) * _BETWEEN / free.problem.times[-1] for k in levels]
    # The first level whose limit allows enough times.
    number = next((n for n, limit in enumerate(limits) if _TOTAL / limit >= _FEWEST), -1)
    most = max(_FEWEST, _ROWS if control == "tolerance" or number < 0 else _ROWS >> number)
    if number < 0 and limits[-1] > 0.5 * limits[0]:
        # The errors do not decrease with the step size, so small steps are useless.
        return levels[0], _BETWEEN * np.arange(1.0, _FEWEST + 1.0), None
    limit = limits[number]
    rows = max(_FEWEST_COARSE, int(min(most, _TOTAL / limit)))
    return levels[number], _BETWEEN * np.arange(1.0, rows + 1.0), limit if limit <= _MOST else None


def drift_of(scene: Scene, times: Array, motion: Motion) -> Drift:
    omega = np.vstack([scene.omega, motion.omega])
    with np.errstate(all="ignore"):
        vectors = np.array(scene.moments) * omega
        energy, momentum = (vectors * omega).sum(axis=1), np.linalg.norm(vectors, axis=1)
        changes = [np.abs(each[1:] / each[:-1] - 1.0) for each in (energy, momentum)]
        conserved = {"energy": energy, "momentum": momentum}
        named = {name: each[1:] / each[0] - 1.0 for name, each in conserved.items()}
        if motion.attitude is not None:
            there = in_space(np.vstack([[scene.attitude], motion.attitude]), vectors)
            named["direction"] = _angle(there[1:], there[:1])
            changes.append(_angle(there[1:], there[:-1]))
        # After a row that is 0 or not finite, the change may be NaN; it is ignored.
        change = np.fmax.reduce(np.concatenate(changes), initial=0.0)
    return Drift(times, named, float(change))


def _angle(first: Array, second: Array) -> Array:
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    return np.asarray(np.arctan2(sine, (first * second).sum(axis=1)))


def growth_power(times: Array, drift: Array) -> float | None:
    """Return the power of time to which the largest drift is proportional; None if unknown."""
    quarter = times <= times[-1] / 4.0
    early, late = float(np.abs(drift[quarter]).max()), float(np.abs(drift).max())
    if not math.isfinite(late) or early <= 0.0:
        return None
    return math.log(late / early) / math.log(4.0)
