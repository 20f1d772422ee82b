"""SciPy's methods for torques that depend on the state, recorded or opaque.

The error amplification of such a torque is unknown. Therefore the local tolerance is reduced until
the difference of two integrations shows that the second meets the tolerance.
"""

import itertools
import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pyharness.engine.recorded import slopes_of
from pyharness.engine.scipy_run import (
    FINEST_STEP,
    NoNumberError,
    RightHandSide,
    Run,
    Span,
    bounds_of,
    rows_of,
    series_beside,
)
from pyharness.engine.steps import MOST_STEPS, STEP_NODES, steps_output
from pyharness.model.dense_output import DenseOutput, Pieces
from pyharness.model.errors import InputError, TimedError, printable
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.symbols import HAS_MEMORY
from pyharness.model.trajectory import Array, Trajectory

# Ratio of the tolerance to the first local tolerance, as usual in motions of a few radians.
_FIRST = {"DOP853": 4.0, "RK45": 8.0, "Radau": 4.0, "LSODA": 25.0}
# Smallest and largest ratio of a local tolerance to the next.
_RATIO, _LARGEST_RATIO = 8.0, 1e3
# The estimated error of the second of two integrations is their difference times _SAFETY, divided
# by the ratio of the local tolerances; but at least _LEAST_FRACTION of the difference. This is 1 if
# errors are not in proportion to the local tolerances: with LSODA, which also changes its order, or
# with a torque that jumps.
_SAFETY = 4.0
_LEAST_FRACTION = {"DOP853": 0.25, "RK45": 0.25, "Radau": 0.25, "LSODA": 1.0}
# The longest step is the time span over a number that grows with each integration, so that no two
# integrations pass a short pulse or sample a wave in the same way.
_FEWEST_STEPS, _MORE_STEPS = 32, 7
_WITHIN = np.array([0.2, 0.5, 0.8])  # parts of a step at which interpolants are compared
_COARSE = 1e-3
# The preliminary integration of a body at rest is repeated if omega is less than the expectation
# over this factor.
_FAR = 4.0
_MOST_GUESSES = 200
# Largest number of successive steps that do not change the time; without it LSODA might not return.
_MOST_STUCK = 50
# Omega counts as unbounded if it has grown by this factor when the phase is too large.
_UNBOUNDED = 1e3
# Largest difference from the series of a recorded torque, in tolerances.
_AGREEMENT = 0.5
_ORDINARY = 1e100  # rad/s; products of smaller omegas are finite
# A jump of the rates is searched up to this fraction of the time span ahead, by this number of
# halvings.
_AHEAD, _HALVINGS = 1e-3, 50
# Local tolerances of the two integrations that determine the smallest tolerance.
_TRIAL = (1e-7, 1e-8)
# Microseconds of a right-hand side without torque, including SciPy; of an operation of a tape; and
# of an opaque function.
_WORK, _OPERATION_WORK, _OPAQUE_WORK = 16.0, 0.7, 16.0


class _Rows(NamedTuple):
    state: Array  # shape (n, 3) or (n, 7): omega, and the attitude as a unit quaternion
    is_complete: bool  # whether there is a row for each time
    largest: float  # largest abs(omega) of any component from 0 to the end (rad/s)
    solutions: Sequence[Any] = ()  # SciPy's dense outputs, one after the other


def solve_state(
    name: str,
    scene: Scene,
    times: Sequence[float],
    tolerance: float,
    effort: float,
    most: float,
    with_steps: bool = False,
) -> Trajectory:
    """Return the trajectory of a scene whose torque depends on the state, by SciPy's method `name`.

    The error at `times` (s), estimated from two integrations, is at most `tolerance`. `most` is the
    work limit, as a number of right-hand sides of a body without torque. If the torque is opaque
    and `with_steps` is true, `sol` of the result has the steps, by SciPy's interpolants.

    The ending is ``overflow`` if omega grows without bound or the torque is singular, ``unchecked``
    if the Taylor series of a recorded torque, which checks the result, does not reach the end.
    Raise InputError if an opaque function fails, the attitude is missing, the tolerance can't be
    met, or the work limit is exceeded.
    """
    run = _StateRun(scene, times[-1], name, effort, most)
    run.with_steps = with_steps and not run.is_smooth
    nothing = np.empty((0, len(run.start)))
    if run.is_singular():
        run.check_undefined()
        return rows_of([], nothing, 1, len(times), "overflow")
    if times[-1] == 0.0:
        return rows_of(times, np.array([run.start]), 1, 0, "complete")
    found = _refined(run, times, tolerance)
    is_checked = True
    if run.is_smooth:
        beside = series_beside(scene, times, tolerance)
        is_checked = beside is not None
        if beside is not None:
            largest = max(found.largest, _largest_of(beside.rows))
            first, second = found._replace(largest=largest), _Rows(beside.rows, True, largest)
            is_short = len(found.state) < len(beside.rows)
            if is_short or not _difference(first, second) <= _AGREEMENT * tolerance:
                run.spans = beside.spans
                found = _refined(run, times, tolerance)
    if not found.is_complete:
        run.check_undefined()
    count = len(found.state)
    ended = "overflow" if not found.is_complete else "complete" if is_checked else "unchecked"
    result = rows_of(times[:count], found.state, run.evaluations, len(times), ended)
    return replace(result, sol=run.steps(scene)) if ended == "complete" else result


def finest_of_state(name: str, scene: Scene, time: float, most: float) -> float:
    """Return an estimate of the smallest tolerance that can be met until `time` (s).

    It is 0 if the integration does not reach `time`.
    """
    run = _StateRun(scene, time, name, 1.0, most)
    scale = 0.0 if run.is_singular() else run.expected_omega()
    if scale == 0.0:
        return 0.0
    first, second = (run.rows([time], local, scale) for local in _TRIAL)
    if not (first.is_complete and second.is_complete):
        return 0.0
    return 1.5 * _SAFETY * FINEST_STEP * _difference(first, second) / _TRIAL[0]


def _refined(run: "_StateRun", times: Sequence[float], tolerance: float) -> _Rows:
    """Return states at `times` (s) whose estimated error meets `tolerance`, or raise InputError."""
    scale = run.expected_omega()
    if scale == 0.0:
        # The body is at rest, and no torque acts.
        return _Rows(np.tile(run.start, (len(times), 1)), True, 0.0)
    local = max(tolerance / _FIRST[run.name], _RATIO * FINEST_STEP)
    before, ratio = run.rows(times, local, scale), _RATIO
    while True:
        finer = max(FINEST_STEP, local / ratio)
        after = run.rows(times, finer, scale)
        difference = _difference(before, after)
        ratio = local / finer
        least = _LEAST_FRACTION[run.name] if run.is_smooth else 1.0
        error = difference * min(1.0, max(least, _SAFETY / ratio))
        same_end = before.is_complete == after.is_complete
        if error <= tolerance and same_end and len(before.state) == len(after.state):
            return after
        if finer == FINEST_STEP:
            if not (before.is_complete or after.is_complete):
                # No row meets the tolerance near the time at which omega becomes infinite.
                n = min(len(before.state), len(after.state))
                while n and _differences(before, after, n).max() > tolerance:
                    n -= 1
                return after._replace(state=after.state[:n])
            allowed = f"{2.0 * error:.2g} to 1" if 0.0 < error < 0.5 else "a larger tolerance"
            raise InputError(
                f"tolerance is {tolerance:g}; {run.label} can't meet it here, because two "
                "integrations with the smallest local tolerances "
                + (f"differ by {difference:.2g}; " if same_end else "end at different times; ")
                + f"allowed for this motion: {allowed}, or a shorter time"
            )
        # Aim at a quarter of the allowed error.
        ratio = min(_LARGEST_RATIO, max(_RATIO, 4.0 * difference / (ratio * tolerance)))
        before, local = after, finer


def _difference(before: _Rows, after: _Rows) -> float:
    """Return the largest relative difference of omega, or angle (rad) between attitudes."""
    n = min(len(before.state), len(after.state))
    found = float(_differences(before, after, n).max(initial=0.0))
    if not (before.solutions and before.is_complete and after.is_complete):
        return found
    # The interpolants are inaccurate where a torque has a kink.
    for one in after.solutions:
        ends = one.ts[:-1, None]
        times = (ends + np.diff(one.ts)[:, None] * _WITHIN).ravel()
        first, second = (each._replace(state=_state_at(each, times)) for each in (before, after))
        found = max(found, float(_differences(first, second, len(times)).max(initial=0.0)))
    return found


def _state_at(rows: _Rows, times: Array) -> Array:
    """Return the states at n ascending or descending times by SciPy's dense outputs, (n, m)."""
    last = np.array([each.ts[-1] for each in rows.solutions])
    which = np.searchsorted(np.abs(last), np.abs(times)).clip(max=len(last) - 1)
    parts = [rows.solutions[k](times[which == k]).T for k in np.unique(which)]
    return _with_unit_attitude(np.concatenate(parts))


def _differences(before: _Rows, after: _Rows, n: int) -> Array:
    first, second = before.state[:n], after.state[:n]
    if before.is_complete and after.is_complete:
        largest = min(before.largest, after.largest)
    else:
        # Omega becomes infinite at the end; only its rows give a finite scale.
        largest = _largest_of(second)
    apart = np.abs(first[:, :3] - second[:, :3]).max(axis=1, initial=0.0)
    found: Array = np.divide(apart, largest, out=np.zeros(n), where=apart > 0.0)
    if first.shape[1] > 3:
        # The angle is twice the distance of two unit quaternions on the sphere.
        turned = 2.0 * np.linalg.norm(first[:, 3:] - second[:, 3:], axis=1)
        found = np.maximum(found, turned)
    return found


class _StateRun(Run):
    def __init__(self, scene: Scene, end: float, name: str, effort: float, most: float) -> None:
        torque = scene.torque
        assert isinstance(torque, StateTorque)
        if torque.needs_attitude and scene.attitude is None:
            raise InputError(
                "a torque that depends on the attitude needs it; give attitude=True, or "
                "--attitude FORM"
            )
        work = _OPAQUE_WORK
        if torque.tape is not None:
            work = _OPERATION_WORK * (
                len(torque.tape.operations) + sum(len(each.terms) for each in torque.tape.outputs)
            )
        slopes = slopes_of(scene)
        rate = max(map(abs, scene.euler_coefficients))
        limit = int(most * _WORK / (_WORK + work))
        start = (*scene.omega, *(scene.attitude or ()))
        self.is_smooth = torque.tape is not None
        super().__init__(start, self._guarded(slopes), rate, end, name, effort, limit)
        if not self.is_smooth:
            self._check_memory()
        self.name = name
        self._between = -math.inf, math.inf
        self._undefined: float | None = None
        self._integrations = 0
        self._reached, self._largest, self._stuck = 0.0, 0.0, 0
        self.with_steps = False
        self._last = 0.0, np.array(start)
        self._solutions: list[Any] = []  # SciPy's dense outputs of the last integration
        self.spans = [Span(time, math.inf) for time in bounds_of(scene, end)]

    def _guarded(self, slopes: RightHandSide) -> RightHandSide:
        """Return a right-hand side that evaluates tables only inside the current span.

        The right-hand side raises InputError if an opaque function fails.
        """

        def between(time: float, state: Sequence[float]) -> list[float]:
            low, high = self._between
            return slopes(min(max(time, low), high), state)

        # A NaN is a failure only if SciPy does not avoid it by shorter steps.
        def guarded(time: float, state: Sequence[float]) -> list[float]:
            try:
                found = slopes(time, state)
            except InputError:
                raise
            except Exception as error:
                raise TimedError(
                    f"[torque]: the function raised {type(error).__name__} at t = {{time}} s: "
                    f"{printable(str(error))}; allowed: a function that returns three components "
                    "in N m",
                    float(time),
                ) from error
            # Above this omega, NaN may be due to an overflow.
            if any(map(math.isnan, found)) and max(map(abs, state[:3])) <= _ORDINARY:
                self._undefined = float(time)
            return found

        return between if self.is_smooth else guarded

    def _rates(self, time: float, state: Sequence[float]) -> Array:
        self.evaluations += 1
        with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
            return np.array(self.slopes(time, state))

    def _check_memory(self) -> None:
        self._undefined = None
        first = self._rates(0.0, self.start)
        self._rates(0.5 * self.end, [1.5 * each for each in self.start])
        again = self._rates(0.0, self.start)
        if not np.array_equal(first, again, equal_nan=True):
            raise InputError(f"[torque]: {HAS_MEMORY}")

    def work_error(self, time: float) -> TimedError:
        if self._jumps():
            return TimedError(
                f"{self.label}: the torque jumps back and forth at t = {{time}} s; write a smooth "
                "function, such as tanh(x/width), or hold the torque between steps of a Stepper",
                time,
            )
        return super().work_error(time)

    @np.errstate(all="ignore")
    def _jumps(self) -> bool:
        """Return whether the right-hand side jumps near the last state."""
        time, low = self._last[0] * self.unit, self._last[1]
        first = self._rates(time, low.tolist())
        high = low + _AHEAD * abs(self.end) * first
        second = self._rates(time, high.tolist())
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            found = self._rates(time, middle.tolist())
            if np.abs(found - first).max() > np.abs(second - found).max():
                high, second = middle, found
            else:
                low, first = middle, found
        jump = float(np.abs(second - first).max())
        return jump > 0.1 * float(np.abs([first, second]).max())

    def check_undefined(self) -> None:
        """Raise InputError if an opaque function returned NaN since the last step."""
        if self._undefined is not None:
            raise TimedError(
                "[torque]: the function returned NaN at t = {time} s; allowed: three finite "
                "components in N m",
                self._undefined,
            )

    def after_step(self, time: float, state: Sequence[float]) -> None:
        """Record the step; raise NoNumberError if 50 steps in succession do not change the time."""
        self._stuck = self._stuck + 1 if time == self._reached else 0
        if self._stuck > _MOST_STUCK:
            raise NoNumberError
        self._reached = time
        self._last = time, np.array(state)
        omega = max(map(abs, state[:3]))
        if math.isfinite(omega):
            self._largest = max(self._largest, float(omega))
            if not self._stuck:
                self._undefined = None

    def is_singular(self) -> bool:
        """Return whether a rate at time 0 is not finite; SciPy's first step would then not end."""
        return not np.isfinite(self._rates(0.0, self.start)).all()

    def expected_omega(self) -> float:
        """Return the largest |omega| (rad/s) to few digits; a guess if the end is not reached."""
        scale = max(map(abs, self.start[:3])) or self._pushed()
        for _ in range(_MOST_GUESSES):
            found = self.rows([self.end], _COARSE, scale)
            if not found.is_complete:
                return scale
            if not 0.0 < found.largest < scale / _FAR:
                return found.largest
            scale = found.largest
        return scale

    def _pushed(self) -> float:
        """Return the |omega| (rad/s) that the largest torque would cause from rest; 1 if none."""
        times = np.linspace(0.0, self.end, _FEWEST_STEPS + 1).tolist()
        rates = [abs(x) for time in times for x in self._rates(time, self.start)[:3].tolist()]
        omega = max(filter(math.isfinite, rates), default=0.0) * abs(self.end)
        return omega if 0.0 < omega < math.inf else 1.0

    def rows(self, times: Sequence[float], local: float, scale: float) -> _Rows:
        """Return the states at `times` (s); the local tolerance is relative to `scale` (rad/s)."""
        self._integrations += 1
        sizes = [local * scale] * 3 + [local] * (len(self.start) - 3)
        longest = abs(self.end) / (_FEWEST_STEPS + _MORE_STEPS * self._integrations)
        rows = np.empty((0, len(self.start)))
        state, begin, self._largest = self.start, 0.0, 0.0
        self._solutions.clear()
        # Each integration ends where a table changes, because SciPy may pass the change.
        for end, most in self.spans:
            own = [time for time in times[len(rows) :] if abs(time) <= abs(end)]
            wanted = own if own and own[-1] == end else [*own, end]
            low, high = sorted((math.nextafter(begin, end), math.nextafter(end, begin)))
            self._between = low, high
            found = self._from(begin, state, wanted, local, sizes, min(longest, most), scale)
            rows = np.concatenate([rows, found[: len(own)]])
            if len(found) < len(wanted):
                break
            state, begin = found[-1].tolist(), end
        finite = np.isfinite(rows).all(axis=1)
        rows = _with_unit_attitude(rows if finite.all() else rows[: int(np.argmin(finite))])
        return _Rows(rows, len(rows) == len(times), self._largest, tuple(self._solutions))

    def _from(
        self, begin: float, state: Sequence[float], wanted: list[float], local: float,
        sizes: Sequence[float], longest: float, scale: float,
    ) -> Array:  # fmt: skip
        while wanted:
            self._reached, self._stuck = begin, 0
            try:
                result = self.solved(
                    self.name, local, sizes, wanted, longest, begin, state, self.with_steps
                )
            except NoNumberError:
                # SciPy returned no rows, although those before the failure exist.
                wanted = [time for time in wanted if abs(time) < abs(self._reached)]
                continue
            if result.status == 1 and self._largest < _UNBOUNDED * scale:
                raise self.phase_error(float(result.t_events[0][0]))
            self._solutions += [result.sol] if self.with_steps else []
            # SciPy returns an empty list if it reached no time.
            return np.reshape(np.asarray(result.y).T, (-1, len(self.start)))
        return np.empty((0, len(self.start)))

    def steps(self, scene: Scene) -> DenseOutput | None:
        """Return the steps of the last integration, or None if there are none, or too many."""
        edges, values = [0.0], []
        for sol in self._solutions:
            for (first, last), step in zip(
                itertools.pairwise(sol.ts.tolist()), sol.interpolants, strict=True
            ):
                values.append(step(first + (last - first) * STEP_NODES).T)
                edges.append(last * self.unit)
        if not 0 < len(values) <= MOST_STEPS:
            return None
        order = 1 if self.end > 0.0 else -1
        nodes = np.array(values)[::order, ::order]
        return steps_output(scene, Pieces(np.array(edges)[::order], nodes))


def _with_unit_attitude(rows: Array) -> Array:
    if rows.shape[1] == 3:
        return rows
    unit = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    return np.hstack([rows[:, :3], unit])


def _largest_of(rows: Array) -> float:
    return float(np.abs(rows[:, :3]).max(initial=0.0))
