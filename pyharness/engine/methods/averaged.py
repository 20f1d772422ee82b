"""The method `averaged`: weak torques over very many revolutions, by two-scale averaging.

A macro-step of at least 100 revolutions computes the slow drift of the torque-free motion, sampled
once per revolution (the stroboscopic solution).

Stroboscopic averaging: Calvo, Chartier, Murua and Sanz-Serna 2011, Applied Numerical Mathematics
61. Two scales: Chartier, Crouseilles, Lemou and Mehats 2015, Numerische Mathematik 129.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pyharness.engine.methods.averaged_coordinates import Coordinates, fastest_of, torque_of
from pyharness.engine.methods.averaged_step import MacroStep, NotResolvedError, fast_nodes
from pyharness.engine.methods.sensitivity import is_sensitive
from pyharness.engine.system.kernel_input import rows_trajectory
from pyharness.model.array_type import Array
from pyharness.model.effort import advice
from pyharness.model.errors import InputError, TimedError
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import ROUNDING, Trajectory

# Cosines and sines of eight angles psi (see averaged_coordinates) at which the initial omega is
# perturbed.
_PSI = np.cos(0.25 * math.pi * np.arange(8)), np.sin(0.25 * math.pi * np.arange(8))
_MOST_ENDS = 4  # ends of macro-steps, besides the last, at which the error is estimated

NODES = 20  # Chebyshev points in a macro-step
_TURN = 2.0 * math.pi
_FEWEST = 100  # revolutions in a macro-step
_MOST_STEPS = 3000  # work limit in macro-steps, some ten seconds
# The last macro-step exceeds the rest of the motion by this fraction and number of revolutions,
# because the time at its end is only estimated.
_BEYOND, _TURNS_BEYOND = 0.02, 3
# Factors on the length of a macro-step: after a failure, after a success at the first attempt, and
# after a later success.
_SHORTER, _LONGER, _HARDLY_LONGER = 0.5, 4.0, 1.2
_RELATIVE = 1.3  # largest predicted relative change of the motion in a macro-step
_APPROACH = 2.0  # the length is divided by this if the motion approaches the separatrix
_WAVE = 4.0  # phase of a wave (rad) that counts as a relative change of 1
# The number of angles is such that oscillations have the relative error exp(-_DIGITS/2), and means
# exp(-_DIGITS).
_DIGITS = 56.0
_FEWEST_ANGLES, _MOST_ANGLES = 16, 512
# Highest frequency of a torque wave, relative to the frequency of the motion.
_FASTEST = 0.02
# Largest relative error of a macro-step: this fraction of the tolerance, but at least _FLOOR, due
# to rounding.
_SHARE, _FLOOR = 0.05, 1e-15
_ROWS_AT_ONCE = 1000
_LARGEST_PHASE = 1e15  # rad


class Done(NamedTuple):
    """A completed macro-step; a point is (p1, p2, p3, t), as in `Coordinates`."""

    start: Array  # shape (4,); the point at the start of the step
    by_omega: Array  # shape (8, 3, 3); d(p1, p2, p3)/d(omega) at the start, for eight angles psi
    error: Array  # shape (4,); error of the point at the end
    transition: Array  # shape (4, 4); d(point at the end)/d(point at the start)


def estimates(
    coordinates: Coordinates, coefficients: Triple, done: Sequence[Done], omega: Array, angle: float
) -> tuple[float, float]:
    """Return the estimated error of omega (rad/s), and the error amplification.

    Both are maxima over the ends of up to five macro-steps; `omega` and `angle` (rad) are final.
    """
    a, b, c = coefficients
    error, growth, count = 0.0, 1.0, len(done)
    for n in (count, *range(1, count, -(-count // _MOST_ENDS))):
        if n < count:
            start = done[n].start[:, None]
            omega = np.concatenate(coordinates.omega(start, np.ones(1), np.zeros(1))[0])
            angle = 0.0
        x, y, z = omega
        cosine, sine = np.cos([angle]), np.sin([angle])
        # Derivatives of omega at the end with respect to the point, and to the time of the end.
        back = np.empty((3, 4))
        back[:, :3] = np.linalg.inv(coordinates.by_omega(omega[:, None], cosine, sine)[0])
        back[:, 3] = -a * y * z, -b * z * x, -c * x * y
        measured = np.zeros(3)
        for each in reversed(done[:n]):
            measured = measured + back @ each.error
            back = back @ each.transition
            amplified = np.abs(back[:, :3] @ each.by_omega)
            growth = max(growth, float(amplified.sum(axis=-1).max()))
        error = max(error, float(np.abs(measured).max()))
    return error, growth


def averaged(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    """Return the trajectory at `times` (s) under a weak torque.

    The result's `steps` are macro-steps; `effort` is a factor on the work limit.
    """
    # The next macro-step refuses a point that is not finite.
    with np.errstate(all="ignore"):
        return _Run(scene, times, tolerance, effort).trajectory()


class _Run:
    def __init__(
        self, scene: Scene, times: Sequence[float], tolerance: float, effort: float
    ) -> None:
        coordinates = Coordinates.from_omega(scene.euler_coefficients, scene.omega)
        if coordinates is None:
            raise InputError(
                "averaged: without torque, omega would not rotate about a principal axis; allowed: "
                "a body that is no sphere, and a motion that is not on the separatrix"
            )
        self.scene, self.coordinates, self.times = scene, coordinates, times
        self.tolerance, self.effort = tolerance, effort
        self.torque, self.varies = torque_of(scene)
        self.forward = -1.0 if times[-1] < 0.0 else 1.0
        self.begin = (0.0, 0.0)  # time (s) at the start of the macro-step, in two parts
        self.point = coordinates.point(scene.omega)
        self.largest = coordinates.largest(self.point[:, None])
        self.done: list[Done] = []
        self.evaluations = 0
        self.inside = 0.0  # largest relative error that arises within one macro-step
        self.pace = self._pace(self.point)
        self.phase = max(1.0, abs(times[-1]) * self.pace)
        self.longest = math.inf  # rad, of the next macro-step
        if not self.phase <= _LARGEST_PHASE:
            raise TimedError(
                f"averaged: at t = {{time}} s the phase is above {_LARGEST_PHASE:g} radians and "
                "has no correct digit; use a shorter time",
                times[-1],
            )
        self.fastest = fastest_of(scene.torque)  # rad/s
        slow = _FASTEST * self.pace
        if self.fastest > slow:
            raise InputError(
                f"averaged: a wave of the torque has the frequency {self.fastest:.3g} rad/s, and "
                f"may be in resonance with omega, which has {self.pace:.3g} rad/s; allowed: waves "
                f"up to {slow:.3g} rad/s, or another method"
            )

    def trajectory(self) -> Trajectory:
        rows: list[Array] = []
        n_rows = 0
        while True:
            step = self._step()
            point, parts = step.end
            whole = math.fsum([*self.begin, *parts])
            inside = n_rows
            while inside < len(self.times) and self.forward * (self.times[inside] - whole) <= 0.0:
                inside += 1
            angle = step.length
            for first in range(n_rows, inside, _ROWS_AT_ONCE):
                part = self.times[first : min(inside, first + _ROWS_AT_ONCE)]
                local = [math.fsum((t, -self.begin[0], -self.begin[1])) for t in part]
                angles = step.angles(np.array(local))
                rows.append(np.array(self.coordinates.omega(*step.at(angles))[0]))
                angle = float(angles[-1])
            n_rows = inside
            omega = np.array(self.coordinates.omega(self.point[:, None], *_PSI)[0])
            by_omega = self.coordinates.by_omega(omega, *_PSI)
            self.done.append(Done(self.point, by_omega, *step.propagated(angle)))
            if n_rows == len(self.times):
                break
            self.begin = whole, math.fsum((*self.begin, *parts, -whole))
            self.point = point
            self.pace = self._pace(self.point)
        found = np.concatenate(rows, axis=1).T
        if self.times[0] == 0.0:
            found[0] = self.scene.omega
        estimated, growth = estimates(
            self.coordinates, self.scene.euler_coefficients, self.done, found[-1], angle
        )
        rounding = ROUNDING * (growth + self.phase)
        error = estimated / self.largest + self.inside + rounding
        ended = "sensitive" if is_sensitive(growth, self.tolerance) else "complete"
        return rows_trajectory(
            self.times, found, self.evaluations, len(self.done), ended, error=error, growth=growth
        )

    def _pace(self, point: Array) -> float:
        low = float(point[2])
        high = low + self.coordinates.bend * float(point[0] * point[0] + point[1] * point[1])
        # One step of the arithmetic-geometric mean of the least and the largest |w_a|.
        low, high = math.sqrt(low), math.sqrt(high)
        return self.coordinates.rate * math.sqrt(0.5 * (low + high) * math.sqrt(low * high))

    def _forecast(self) -> float:
        point = self.point
        fast, times = fast_nodes(_FEWEST_ANGLES), np.full(_FEWEST_ANGLES, self.begin[0])
        slopes = self.forward * self.coordinates.slopes(
            point[:, None], times, fast.cosine, fast.sine, self.torque, 0.0
        ).mean(axis=-1)
        square = float(point[0] * point[0] + point[1] * point[1])
        low = float(min(point[2], point[2] + self.coordinates.bend * square))
        # Relative changes per radian of the distance from the separatrix, of x and y, and of the
        # torque waves.
        approach = float(slopes[2]) / low
        change = max(
            approach,
            -_APPROACH * approach,
            math.hypot(slopes[0], slopes[1]) / math.sqrt(point[2]),
            self.fastest / (_WAVE * self.pace),
        )
        rest = abs(self.times[-1] - self.begin[0]) * self.pace
        if not change < math.inf:
            raise self._too_fast()
        if change == 0.0:
            return rest * (1.0 + _BEYOND) + _TURNS_BEYOND * _TURN
        little = 1e-3 / change
        trend = (self._pace(point + little * slopes) / self.pace - 1.0) / little
        rest *= min(2.0, max(0.5, 1.0 + 0.5 * trend * rest)) * (1.0 + _BEYOND)
        return min(self.longest, _RELATIVE / change, rest + _TURNS_BEYOND * _TURN)

    def _step(self) -> MacroStep:
        time = self.begin[0]
        angles = self._angles(float(self.coordinates.modulus(self.point)))
        length = self._forecast()
        for attempt in range(math.ceil(self.effort * _MOST_STEPS) - len(self.done)):
            revolutions = max(_FEWEST, math.ceil(length / _TURN))
            try:
                step = MacroStep(
                    self.coordinates, self.torque, self.varies, self.point, time,
                    self.forward * revolutions * _TURN, (NODES, angles),
                )  # fmt: skip
            except NotResolvedError:
                step = None
            if step is not None:
                self.evaluations += step.evaluations
                needed = self._angles(step.modulus)
                if needed > angles:
                    angles = needed
                    continue
                # Relative error of the slow components, and error of the phase (rad).
                slow = float((np.abs(step.error[:3]).max(axis=1) / step.scale[:3]).max())
                late = float(np.abs(step.error[3]).max() * self.pace)
                allowed = _SHARE * self.tolerance
                is_slow = slow <= max(_FLOOR, allowed / self.phase)
                if is_slow and late <= max(_FLOOR * self.phase, allowed):
                    longer = _LONGER if attempt == 0 else _HARDLY_LONGER
                    self.longest = longer * abs(step.length)
                    self.inside = max(self.inside, slow + late)
                    self.largest = max(self.largest, self.coordinates.largest(step.stroboscopic))
                    return step
            if revolutions == _FEWEST:
                raise self._too_fast()
            length = _SHORTER * revolutions * _TURN
        raise TimedError(
            f"averaged exceeded its work limit at t = {{time}} s after {len(self.done)} "
            "macro-steps; " + advice("use a shorter time", self.effort),
            time,
        )

    def _too_fast(self) -> TimedError:
        return TimedError(
            f"averaged: at t = {{time}} s the motion changes too much in {_FEWEST} revolutions; "
            "allowed: a weaker torque, slower waves, a motion farther from the separatrix, or "
            "another method",
            self.begin[0],
        )

    def _angles(self, modulus: float) -> int:
        # The oscillation is analytic up to this distance from the real axis of the angle.
        width = math.acosh(1.0 / math.sqrt(min(1.0, max(modulus, 1e-4))))
        if width * _MOST_ANGLES < _DIGITS:
            raise TimedError(
                "averaged: at t = {time} s the motion is near the separatrix; allowed: a shorter "
                "time, or another method",
                self.begin[0],
            )
        return max(_FEWEST_ANGLES, 4 * math.ceil(0.25 * _DIGITS / width))
