"""One macro-step of the method `averaged`: the two-scale solution over very many revolutions.

The unknowns v are the time and p1, p2, p3 of `averaged_coordinates`. They depend on the fast angle
psi, with period 2 pi, and on the slow s = psi/length, from 0 to 1; `length` (rad) is the step's
angle. The equation dv/dpsi = F(v, psi) becomes

    dv/dpsi + (1/length) dv/ds = F(v, psi).

Let V(s) be v at psi = 0 (the stroboscopic solution), W = v - V, and < > the mean over psi. An
equivalent form is

    V + <W> = V(0) + <W>(0) + length (integral of <F> over s from 0),
    W = integral of G - <G> over psi from 0, where G = F - (1/length) dW/ds.

A sweep puts the last V and W into the right-hand sides, and raises the order of averaging by one.
Newton's method solves the first equation at Chebyshev points (nodes) of s. Two more sweeps, with
more nodes and angles, measure the error.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pyharness.engine.methods.averaged_coordinates import Coordinates, Torque
from pyharness.model.array_type import Array
from pyharness.model.dense_output import points, to_coefficients

MOST_SWEEPS = 12
_LEAST_SWEEPS = 3
_MORE_NODES, _MORE_ANGLES = 4, 8  # added to measure the error
_FEWEST_ANGLES = 16
_DIFFERENCE = 1e-5  # relative perturbation for the Jacobian matrices
# Relative change by a sweep at which the iteration has converged; largest change that may be due
# to rounding errors.
_CONVERGED, _ROUNDED = 1e-15, 1e-12
_MOST_NEWTON = 100
_CLOSE = 1e-7  # rad; the error of the last Newton step is about its square


class Slow(NamedTuple):
    """The n Chebyshev points from 0 to 1, and matrices of shape (n, n)."""

    nodes: Array
    integral: Array  # from values to their integral from 0
    slope: Array  # from values to their derivative
    weights: Array  # of the barycentric formula


class Fast(NamedTuple):
    """The n equidistant angles (rad) in a period, and arrays for them."""

    angles: Array
    cosine: Array
    sine: Array
    mean: Array  # weights of the mean; a product is faster than a sum along rows
    integral: Array  # right factor: from values to the integral from 0 of values minus mean


@lru_cache(maxsize=16)
def slow_nodes(count: int) -> Slow:
    at = points(count)
    values = np.polynomial.chebyshev.chebvander(at, count)
    integrals = np.empty((count, count))
    for n in range(count):
        terms = np.polynomial.chebyshev.chebint(np.eye(count)[n], lbnd=-1.0)
        integrals[:, n] = values[:, : len(terms)] @ terms
    integral = 0.5 * integrals @ to_coefficients(count)
    integral[0] = 0.0
    weights = np.ones(count)
    weights[1::2] = -1.0
    weights[[0, -1]] *= 0.5
    slope = weights / weights[:, None] / (at[:, None] - at + np.eye(count))
    np.fill_diagonal(slope, 0.0)
    np.fill_diagonal(slope, -slope.sum(axis=1))
    return Slow(0.5 + 0.5 * at, integral, 2.0 * slope, weights)


@lru_cache(maxsize=16)
def fast_nodes(count: int) -> Fast:
    """Return the angles and their arrays for an even `count`."""
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    waves = np.fft.rfft(np.eye(count), axis=1)
    divided = np.zeros_like(waves)
    divided[:, 1:-1] = waves[:, 1:-1] / (1j * np.arange(1, waves.shape[1] - 1))
    integral = np.fft.irfft(divided, n=count, axis=1)
    mean = np.full(count, 1.0 / count)
    return Fast(angles, np.cos(angles), np.sin(angles), mean, integral - integral[:, :1])


def between_nodes(count: int, at: Array) -> Array:
    """Return the barycentric interpolation matrix from `count` nodes to points in [0, 1]."""
    slow = slow_nodes(count)
    distance = at[:, None] - slow.nodes
    hit = np.abs(distance) < 1e-17
    distance[hit] = 1.0
    found = slow.weights / distance
    found /= found.sum(axis=1)[:, None]
    rows = hit.any(axis=1)
    found[rows] = hit[rows]
    return found


def between_angles(count: int, at: Array) -> Array:
    """Return the trigonometric interpolation matrix from `count` (even) angles to `at` (rad)."""
    half = 0.5 * (at[:, None] - fast_nodes(count).angles)
    sine = np.sin(half)
    hit = np.abs(sine) < 1e-17
    sine[hit] = 1.0
    found: Array = np.sin(count * half) * np.cos(half) / (count * sine)
    found[hit] = 1.0
    return found


class NotResolvedError(Exception):
    """A macro-step is too long or has no solution."""


class MacroStep:
    """The solution V (p1, p2, p3 and time) over one macro-step, with its measured `error`."""

    def __init__(
        self,
        coordinates: Coordinates,
        torque: Torque,
        varies: bool,
        start: Array,
        start_time: float,
        length: float,
        sizes: tuple[int, int],
    ) -> None:
        """Solve over `length` (rad), a multiple of 2 pi.

        `sizes` are the numbers of nodes and angles; the latter is even.
        """
        self.coordinates, self._torque, self._start_time = coordinates, torque, start_time
        self._start, self.length, self._sizes = start[:, None], length, sizes
        self._slow, self._fast = slow_nodes(sizes[0]), fast_nodes(sizes[1])
        self._integral = length * self._slow.integral.T
        # If the torque does not depend on time, t is an integral and no unknown of Newton's method.
        self._n_unknowns = 4 if varies else 3
        self.scale = coordinates.scale(start)
        self.evaluations = 0
        with np.errstate(all="ignore"):
            self._pace = 0.0
            self._pace = float(self._slopes(self._start[..., None], self._fast)[3].mean())
            self._solve()

    def _solve(self) -> None:
        # Few angles suffice for the first approximation and the Jacobian matrices.
        few = fast_nodes(max(_FEWEST_ANGLES, self._sizes[1] // 4 * 2))
        slopes = self._slopes(self._start[..., None], few) @ few.mean
        mean = self._start + slopes * (self.length * self._slow.nodes)
        self._check(mean)
        slopes = self._linearise(mean, few)
        mean = mean + self._newton(self._start + slopes @ self._integral - mean)
        waves = np.zeros((4, *self._sizes))
        change, last = np.inf, np.inf
        # Errors of the time are relative to the duration of the macro-step.
        sizes = self.scale * (1.0, 1.0, 1.0, abs(self.length))
        for sweep in range(1, MOST_SWEEPS + 1):
            residual, waves = self._residual(mean, waves, self._slow, self._fast)
            correction = self._newton(residual)
            mean = mean + correction
            change, last = float((np.abs(correction).max(axis=1) / sizes).max()), change
            stalls = sweep >= _LEAST_SWEEPS and not change < 0.5 * last
            # The first sweep may change nothing, because it has no oscillation yet.
            if (sweep > 1 and change <= _CONVERGED) or stalls:
                break
        self._check(mean)
        if not change <= _ROUNDED:
            raise NotResolvedError
        # V at the nodes, (4, nodes); the times are without their part proportional to psi.
        self.stroboscopic, self._waves = mean, waves
        self.error = self._measured()

    def _check(self, mean: Array) -> None:
        self.modulus = float(self.coordinates.modulus(mean).max())
        if not (np.isfinite(mean).all() and self.modulus < 1.0):
            raise NotResolvedError

    def _slopes(self, point: Array, fast: Fast, slow: Slow | None = None) -> Array:
        """Return d/dpsi of points on a grid, (4, nodes, angles)."""
        nodes = (slow or self._slow).nodes[: point.shape[-2], None]
        time = self._start_time + (self._pace * self.length) * nodes + point[3]
        self.evaluations += point[0].size // point.shape[-1] * len(fast.angles)
        return self.coordinates.slopes(
            point, time, fast.cosine, fast.sine, self._torque, self._pace
        )

    def _residual(self, mean: Array, waves: Array, slow: Slow, fast: Fast) -> tuple[Array, Array]:
        """Return the residual of the equation for V + <W>, and the next W."""
        slopes = self._slopes(mean[..., None] + waves, fast, slow)
        right = self._start + (slopes @ fast.mean) @ (self.length * slow.integral.T)
        waves = (slopes - (slow.slope / self.length) @ waves) @ fast.integral
        offset = waves @ fast.mean
        return right + (offset[:, :1] - offset) - mean, waves

    def _linearise(self, mean: Array, few: Fast) -> Array:
        """Set the matrices of Newton's method; return the mean slopes over psi, (4, nodes)."""
        n, count = self._n_unknowns, self._sizes[0]
        shift = _DIFFERENCE * self.scale[:n, None]
        shifted = np.repeat(mean[:, None], n + 1, axis=1)
        shifted[range(n), range(1, n + 1)] += shift
        slopes = self._slopes(shifted[..., None], few) @ few.mean
        self._jacobian = (slopes[:, 1:] - slopes[:, :1]) / shift
        matrix = self._integral.T[:, None, :] * -self._jacobian[:n, None]
        matrix = matrix.reshape(n * count, n * count)
        matrix.flat[:: n * count + 1] += 1.0
        if not np.isfinite(matrix).all():
            raise NotResolvedError
        self._inverse = np.linalg.inv(matrix)
        found: Array = slopes[:, 0]
        return found

    def _newton(self, residual: Array) -> Array:
        n = self._n_unknowns
        found = residual.copy()
        found[:n] = (self._inverse @ residual[:n].ravel()).reshape(n, -1)
        if n == 3:
            found[3] += (self._jacobian[3] * found[:3]).sum(axis=0) @ self._integral
        return found

    def _measured(self) -> Array:
        count, angles = self._sizes
        nodes, turns, back = _finer(count, angles)
        slow, fast = slow_nodes(count + _MORE_NODES), fast_nodes(angles + _MORE_ANGLES)
        # The change since the start has smaller rounding errors than V.
        mean = self._start + (self.stroboscopic - self._start) @ nodes.T
        _, waves = self._residual(mean, (nodes @ self._waves) @ turns, slow, fast)
        residual, _ = self._residual(mean, waves, slow, fast)
        return self._newton(residual @ back.T)

    def propagated(self, angle: float) -> tuple[Array, Array]:
        """Return the error of V, (4,), and dV/dV(0), (4, 4), at an angle (rad)."""
        at = between_nodes(self._sizes[0], np.array([angle / self.length]))[0]
        found, n, count = np.eye(4), self._n_unknowns, self._sizes[0]
        responses = self._inverse.reshape(n, count, n, count).sum(axis=-1)
        found[:n, :n] = at @ responses
        if n == 3:
            slopes = (self._jacobian[3][..., None] * responses).sum(axis=0)
            found[3, :3] = (at @ self._integral.T) @ slopes
        return self.error @ at, found

    @property
    def end(self) -> tuple[Array, tuple[float, float]]:
        """Return the point at the end, with t = 0, and the time (s) as two summands."""
        found = self.stroboscopic[:, -1].copy()
        found[3] = 0.0
        return found, (self._pace * self.length, float(self.stroboscopic[3, -1]))

    def angles(self, times: Array) -> Array:
        """Return the angles psi (rad) at times (s) since the start."""
        nodes = self._slow.nodes
        known = self._pace * self.length * nodes + self.stroboscopic[3]
        forward = 1.0 if self.length > 0.0 else -1.0
        angle: Array = self.length * np.interp(forward * times, forward * known, nodes)
        low, high = (np.full_like(angle, end) for end in sorted((0.0, self.length)))
        last = np.full_like(angle, np.inf)
        for _ in range(_MOST_NEWTON):
            point, cosine, sine = self.at(angle)
            fast = self.coordinates.omega(point, cosine, sine)[2]
            change = ((times - self._pace * angle) - point[3]) * (self.coordinates.rate * fast)
            if np.abs(change).max() <= _CLOSE:
                angle = angle + change
                break
            # Near the separatrix psi changes slowly in a part of each revolution; there Newton's
            # method may diverge, or leave the interval that contains the angle.
            low = np.where(change > 0.0, np.maximum(low, angle), low)
            high = np.where(change < 0.0, np.minimum(high, angle), high)
            near = angle + change
            is_lost = (np.abs(change) > 0.5 * np.abs(last)) | (near < low) | (near > high)
            is_lost &= np.abs(change) > _CLOSE
            near = np.where(is_lost, 0.5 * (low + high), near)
            angle, last = near, near - angle
        return angle

    def at(self, angle: Array) -> tuple[Array, Array, Array]:
        """Return the points at n angles psi (rad), (4, n), and the cosines and sines."""
        nodes = between_nodes(self._sizes[0], angle / self.length)
        turns = between_angles(self._sizes[1], np.mod(angle, 2.0 * np.pi))
        point = self.stroboscopic @ nodes.T + ((nodes @ self._waves) * turns).sum(axis=-1)
        return point, np.cos(angle), np.sin(angle)


@lru_cache(maxsize=16)
def _finer(count: int, angles: int) -> tuple[Array, Array, Array]:
    more = slow_nodes(count + _MORE_NODES).nodes
    return (
        between_nodes(count, more),
        between_angles(angles, fast_nodes(angles + _MORE_ANGLES).angles).T.copy(),
        between_nodes(count + _MORE_NODES, slow_nodes(count).nodes),
    )
