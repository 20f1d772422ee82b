"""The weighted residual family of III.1 and IV.2: any weighting, number of terms, corrections.

One step of length h solves omega' = f(t, omega), equations 16-18, with a polynomial trial function
omega(0) + c1 t + ... + cn t**n. The first estimate takes f constant, as it is at the beginning;
each correction takes f along the estimate before it and chooses the c's so that the integrals of
W (omega' - f) vanish (eq. 26). The thesis does one correction.

With f known along the step the conditions are linear, and the derivative that they give is a
projection of f on the polynomials of degree n - 1. Done once on the unit interval s = t / h, with
Legendre polynomials as basis, the projection becomes a few well conditioned numbers that do not
depend on the step: the `Tableau`. The c's themselves are never formed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre

from pyharness.errors import InputError, unknown
from pyharness.scene import Scene
from pyharness.trajectory import Array, Trajectory

WEIGHTINGS = ("collocation", "subdomain", "galerkin", "least-squares")
POINTS = ("thesis", "gauss")
MOST_TERMS = 12
MOST_CORRECTIONS = 100
# Beyond it, the points lie so close together that half the digits are lost.
_WORST_CONDITION = 1e8


@dataclass(frozen=True)
class Member:
    """One method of the family.

    Attributes
    ----------
    weighting : str
        One of `WEIGHTINGS`. Least squares is that of f held (eq. 25 with dR/dc_i = i t**(i-1)).
    terms : int
        Powers of t in the trial function, n.
    points : {"thesis", "gauss"} or tuple of float, or None
        Where collocation makes the residual vanish, in parts of the step: k/(n+1), those of
        Gauss and Legendre, or n different numbers from 0 to 1. None for the other weightings,
        and "thesis" for collocation where nothing is given.
    corrections : int
        Corrections of the first estimate, k; the thesis's programs do one.

    Raises
    ------
    InputError
        Where there is no such method.
    """

    weighting: str = "collocation"
    terms: int = 2
    points: str | tuple[float, ...] | None = None
    corrections: int = 1

    def __post_init__(self) -> None:
        """Refuse what is no method."""
        if self.weighting not in WEIGHTINGS:
            raise unknown("weighting", self.weighting, WEIGHTINGS)
        if not 1 <= self.terms <= MOST_TERMS:
            raise InputError(f"terms is {self.terms}; allowed: 1 to {MOST_TERMS}")
        if not 0 <= self.corrections <= MOST_CORRECTIONS:
            raise InputError(f"corrections is {self.corrections}; allowed: 0 to {MOST_CORRECTIONS}")
        if self.weighting != "collocation":
            if self.points is not None:
                raise InputError(
                    f"points have no meaning with {self.weighting}; allowed: with collocation"
                )
        elif self.points is None:
            object.__setattr__(self, "points", "thesis")
        elif isinstance(self.points, str):
            if self.points not in POINTS:
                raise unknown("points", self.points, (*POINTS, "a list as in 0.25,0.75"))
        else:
            self._check_points(self.points)

    def _check_points(self, points: Sequence[float]) -> None:
        if len(points) != self.terms:
            raise InputError(
                f"points: {len(points)} given; allowed: as many as there are terms, {self.terms}"
            )
        for point in points:
            if not 0.0 <= point <= 1.0:
                raise InputError(f"points: {point:g}; allowed: 0 to 1, in parts of the step")
        if len(set(points)) < len(points):
            raise InputError("points: one is given twice; allowed: different points")
        if np.linalg.cond(_basis(np.array(points), self.terms)) > _WORST_CONDITION:
            raise InputError("points: too close together for binary64; take them further apart")

    @property
    def points_label(self) -> str:
        """What a table calls the points."""
        if self.points is None:
            return "-"
        if isinstance(self.points, str):
            return self.points
        return ",".join(f"{point:g}" for point in self.points)


@dataclass(frozen=True, eq=False)
class Tableau:
    """What a correction does on the unit interval; in form it is a Runge-Kutta scheme.

    Attributes
    ----------
    nodes : ndarray, shape (m,)
        Where f is wanted, in parts of the step: the points of collocation, or those of the
        quadrature of the weighted integrals.
    matrix : ndarray, shape (m, m)
        The next estimate at the nodes is omega(0) + h matrix f.
    weights : ndarray, shape (m,)
        The result of the step is omega(0) + h weights f.
    """

    nodes: Array
    matrix: Array
    weights: Array


@cache
def tableau(weighting: str, terms: int, points: str | tuple[float, ...] | None = None) -> Tableau:
    """Solve the weighted residual conditions on the unit interval.

    Parameters
    ----------
    weighting, terms, points
        As in `Member`.

    Returns
    -------
    Tableau
        The quadrature is exact for polynomials: along a trial function the products of
        equations 13-15 have degree 2n, the weights have up to n (Galerkin), n - 1 (least
        squares) or, in each subdomain, 0; m points of Gauss and Legendre integrate degree
        2m - 1. A torque that varies with time leaves an error of the power 2m of the step or
        smaller, above every order of the family.
    """
    n = terms
    if weighting == "collocation":
        nodes = _points(points, n)
        projection = np.linalg.inv(_basis(nodes, n))
    else:
        if weighting == "subdomain":
            part, quadrature = _gauss(n + 1)
            nodes = ((np.arange(n)[:, None] + part) / n).ravel()
            quadrature = np.tile(quadrature / n, n)
            tests = np.repeat(np.eye(n), n + 1, axis=0)
        else:
            degree = 3 * n if weighting == "galerkin" else 3 * n - 1
            nodes, quadrature = _gauss(degree // 2 + 1)
            # Polynomials that span the same weights as t ... t**n, or 1 ... t**(n-1).
            tests = _basis(nodes, n)
            if weighting == "galerkin":
                tests = tests * nodes[:, None]
        weighted = (tests * quadrature[:, None]).T
        projection = np.linalg.solve(weighted @ _basis(nodes, n), weighted)
    return Tableau(nodes, _integrals(nodes, n) @ projection, projection[0])


def _points(points: str | tuple[float, ...] | None, n: int) -> Array:
    if points == "gauss":
        return _gauss(n)[0]
    if points is None or points == "thesis":
        return np.arange(1, n + 1) / (n + 1)
    return np.array(points, dtype=float)


def _gauss(m: int) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss and Legendre on the unit interval."""
    x, w = legendre.leggauss(m)
    return (x + 1.0) / 2.0, w / 2.0


def _basis(s: Array, n: int) -> Array:
    """Return the Legendre polynomials 0 ... n - 1 of the unit interval at `s`, shape (m, n)."""
    values: Array = legendre.legvander(2.0 * s - 1.0, n - 1)
    return values


def _integrals(s: Array, n: int) -> Array:
    """Return their integrals from 0 to `s`, shape (m, n); to 1 they are 1, 0, 0 ..."""
    antiderivatives = legendre.legint(np.eye(n), lbnd=-1.0, scl=0.5)
    values: Array = legendre.legval(2.0 * s - 1.0, antiderivatives).T
    return values


def converged_order(member: Member) -> int:
    """Return the order of a member after ever more corrections (derived in docs/family.md)."""
    n = member.terms
    if member.weighting == "galerkin":
        return n
    if member.weighting == "least-squares":
        return 2 * n
    if member.weighting == "subdomain":
        return n + 1 + (n % 2 == 0)
    nodal = np.polynomial.Polynomial.fromroots(_points(member.points, n))
    order = n
    while order < 2 * n:
        moment = (nodal * np.polynomial.Polynomial([0.0] * (order - n) + [1.0])).integ()
        if abs(moment(1.0) - moment(0.0)) > 1e-12:
            break
        order += 1
    return order


def predicted_order(member: Member) -> int:
    """Return the power of h with which the error at a fixed time falls, for general motions.

    The first estimate has order 1 and a correction gains one, up to the converged order.
    """
    return min(member.corrections + 1, converged_order(member))


def run(scene: Scene, member: Member) -> Trajectory:
    """Integrate a scene with one member.

    Parameters
    ----------
    scene : Scene
        What to integrate.
    member : Member
        With what.

    Returns
    -------
    Trajectory
        Without velocity. The first estimate takes the torque at the beginning of the step, the
        corrections take it at the true times. Error: the power `predicted_order` of the step,
        and about a unit in the last place a step.

    Notes
    -----
    Source: Jacobs 1982, III.1 (eq. 20-27) and IV.2.
    """
    omega = march(scene, [member])[0]
    finite = np.isfinite(omega).all(axis=1)
    rows = len(omega) if finite.all() else int(np.argmin(finite))
    time = np.array(scene.times()[:rows])
    scheme = tableau(member.weighting, member.terms, member.points)
    overflow = rows < scene.steps
    return Trajectory(
        time=time,
        recorded_time=time,
        omega=omega[:rows],
        velocity=None,
        steps=rows,
        evaluations=(rows + overflow) * (1 + member.corrections * len(scheme.nodes)),
        ended="overflow" if overflow else "complete",
    )


def march(scene: Scene, members: Sequence[Member]) -> Array:
    """Integrate a scene with several members side by side, which costs hardly more than one.

    Returns
    -------
    ndarray, shape (members, steps, 3)
        omega (rad/s); from an overflow on, what is not finite.
    """
    schemes = [tableau(m.weighting, m.terms, m.points) for m in members]
    width = max(len(scheme.nodes) for scheme in schemes)
    # Nodes that a member does not have stand at the beginning of the step and count nothing.
    nodes = np.zeros((len(members), width))
    matrix = np.zeros((len(members), width, width))
    weights = np.zeros((len(members), 1, width))
    for i, scheme in enumerate(schemes):
        m = len(scheme.nodes)
        nodes[i, :m], matrix[i, :m, :m], weights[i, 0, :m] = (
            scheme.nodes, scheme.matrix, scheme.weights,
        )  # fmt: skip
    corrections = np.array([m.corrections for m in members])
    last = [np.flatnonzero(corrections == k) for k in range(corrections.max() + 1)]

    h = scene.step_size
    result = np.full((len(members), scene.steps, 3), math.nan)
    start = np.tile(np.array(scene.omega), (len(members), 1, 1))
    with np.errstate(all="ignore"):
        for step in range(scene.steps):
            begin = step * h
            torque = _torque(scene, np.array([begin]))
            rates = _rates(scene, torque, start)
            end = start + h * rates
            estimate = start + h * nodes[:, :, None] * rates
            torque = _torque(scene, begin + h * nodes)
            for k in range(1, len(last)):
                rates = _rates(scene, torque, estimate)
                done = last[k]
                if len(done):
                    end[done] = start[done] + h * (weights[done] @ rates[done])
                if k < len(last) - 1:
                    estimate = start + h * (matrix @ rates)
            start = end
            result[:, step] = end[:, 0]
            if not np.isfinite(end).any():
                break
    return result


def _rates(scene: Scene, torque: Array, omega: Array) -> Array:
    a, b, c = scene.euler_coefficients
    first, second, third = omega[..., 0], omega[..., 1], omega[..., 2]
    rates = np.empty(omega.shape)
    rates[..., 0] = torque[..., 0] + a * second * third
    rates[..., 1] = torque[..., 1] + b * first * third
    rates[..., 2] = torque[..., 2] + c * first * second
    return rates


def _torque(scene: Scene, times: Array) -> Array:
    """Return the normalized torque at many times, shape (..., 3); one for all if constant."""
    law = scene.torque
    torque = np.array(law.constant)
    if law.varies:
        t = times[..., None]
        torque = torque + np.array(law.rate) * t
        for amplitude, frequency in law.sines:
            torque = torque + np.array(amplitude) * np.sin(frequency * t)
        for amplitude, frequency in law.cosines:
            torque = torque + np.array(amplitude) * np.cos(frequency * t)
    return torque if scene.moments is None else torque / np.array(scene.moments)
