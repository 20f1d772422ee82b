"""Integration by SciPy under a torque that depends on the state."""

import math
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pyharness.engine.methods.scipy_run import NoNumberError, RightHandSide, Run, Span, bounds_of
from pyharness.engine.system.recorded import slopes_of
from pyharness.model.errors import InputError, TimedError, printable
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.symbols import HAS_MEMORY
from pyharness.model.trajectory import Array

# Without a series, the longest step is the time span divided by a number that grows with each
# integration, so that no two integrations pass a short pulse or sample a wave alike.
_FEWEST_STEPS, _MORE_STEPS = 32, 7
_COARSE = 1e-3
# As in scipy_ivp.py.
_FAR = 4.0
_MOST_GUESSES = 200
# Largest number of successive steps that do not change the time; without it LSODA might not return.
_MOST_STUCK = 50
# Omega counts as unbounded if it has grown by this factor when the phase is too large.
_UNBOUNDED = 1e3
_ORDINARY = 1e100  # rad/s; products of smaller omegas are finite
# A jump of the rates is searched ahead in this fraction of the time span, by halvings.
_AHEAD, _HALVINGS = 1e-3, 50
# Microseconds of a right-hand side without torque, including SciPy; of a recorded operation; and of
# an opaque function.
_WORK, _OPERATION_WORK, _OPAQUE_WORK = 16.0, 0.7, 16.0


class StateRows(NamedTuple):
    state: Array  # shape (n, 3) or (n, 7): omega, and the attitude as a unit quaternion
    is_complete: bool  # whether there is a row for each time
    largest: float  # largest abs(omega) of any component from 0 to the end (rad/s)
    solutions: Sequence[Any] = ()  # SciPy's dense outputs, one after the other


class StateRun(Run):
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
        self.is_limited = True  # whether steps are short because no series shows what they pass
        super().__init__(start, self._guarded(slopes), rate, end, name, effort, limit)
        if not self.is_smooth:
            self._check_memory()
        self.name = name
        self._between = -math.inf, math.inf
        self._undefined: float | None = None
        self._integrations = 0
        self._reached, self._largest, self._stuck = 0.0, 0.0, 0
        self.with_steps = self.compares_steps = False
        self._last = 0.0, np.array(start)
        self.spans = [Span(time, math.inf) for time in bounds_of(scene, end)]

    # Confine tables to the current span, and report failures of opaque functions.
    def _guarded(self, slopes: RightHandSide) -> RightHandSide:
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
        time, low = self._last[0] * self.unit, self._last[1]
        first = self._rates(time, low.tolist())
        high = low + _AHEAD * abs(self.end) * first
        second = self._rates(time, high.tolist())
        whole = float(np.abs(second - first).max())
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            found = self._rates(time, middle.tolist())
            if np.abs(found - first).max() > np.abs(second - found).max():
                high, second = middle, found
            else:
                low, first = middle, found
        # A continuous torque, such as a root near 0, changes less and less.
        return float(np.abs(second - first).max()) > 0.1 * whole

    def check_undefined(self) -> None:
        if self._undefined is not None:
            raise TimedError(
                "[torque]: the function returned NaN at t = {time} s; allowed: three finite "
                "components in N m",
                self._undefined,
            )

    def after_step(self, time: float, state: Sequence[float]) -> None:
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
        """Return whether a derivative at time 0 is not finite, so that SciPy would not return."""
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
        """Return the |omega| (rad/s) that the largest torque causes from rest, or 1."""
        times = np.linspace(0.0, self.end, _FEWEST_STEPS + 1).tolist()
        rates = [abs(x) for time in times for x in self._rates(time, self.start)[:3].tolist()]
        omega = max(filter(math.isfinite, rates), default=0.0) * abs(self.end)
        return omega if 0.0 < omega < math.inf else 1.0

    def rows(self, times: Sequence[float], local: float, scale: float) -> StateRows:
        """Return states at `times` (s); the tolerance is `local`, for omega times `scale`."""
        self._integrations += 1
        sizes = [local * scale] * 3 + [local] * (len(self.start) - 3)
        parts = _FEWEST_STEPS + _MORE_STEPS * self._integrations
        longest = abs(self.end) / parts if self.is_limited else math.inf
        rows = np.empty((0, len(self.start)))
        state, begin, self._largest = self.start, 0.0, 0.0
        self.solutions.clear()
        # Each integration ends where a table changes, because SciPy may step over the change.
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
        rows = with_unit_attitude(rows if finite.all() else rows[: int(np.argmin(finite))])
        solutions = tuple(self.solutions) if self.has_steps else ()
        return StateRows(rows, len(rows) == len(times), self._largest, solutions)

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
            self.solutions += [result.sol] if self.with_steps and result.sol else []
            # SciPy returns an empty list if it reached no time.
            return np.reshape(np.asarray(result.y).T, (-1, len(self.start)))
        return np.empty((0, len(self.start)))


def with_unit_attitude(rows: Array) -> Array:
    if rows.shape[1] == 3:
        return rows
    unit = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    return np.hstack([rows[:, :3], unit])
