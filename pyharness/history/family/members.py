"""The family of weighted residual methods in III.1 and IV.2 of the thesis.

One step of length h solves omega' = f(t, omega), equations 16-18, with a polynomial trial function
omega(0) + c1 t + ... + cn t**n. The first estimate takes f constant. Each correction evaluates f
along the previous estimate, and chooses c1, ..., cn so that the integrals of W (omega' - f) vanish
for n weight functions W (eq. 26). The thesis makes one correction. `checks.theory.tableau` computes
the coefficients of a method.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from pyharness.checks.theory.tableau import basis, grid, tableau
from pyharness.model.errors import InputError, unknown
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory

WEIGHTINGS = ("collocation", "subdomain", "galerkin", "least-squares")
POINTS = ("thesis", "gauss")
MOST_TERMS = 12
MOST_CORRECTIONS = 100
# Above this condition number the points are so close that half the digits are lost.
_WORST_CONDITION = 1e8


@dataclass(frozen=True)
class Member:
    """A weighted residual method of the thesis; the constructor raises InputError for wrong fields.

    The weights of least squares are i t**(i-1), the derivatives of the residual with f held
    constant (eq. 25). `points`, for collocation only, are fractions of the step: k/(n+1)
    (`thesis`), Gauss-Legendre (`gauss`), or n different numbers from 0 to 1.
    """

    weighting: str = "collocation"
    terms: int = 2
    points: str | tuple[float, ...] | None = None
    corrections: int = 1

    def __post_init__(self) -> None:
        """Raise InputError for wrong fields; set the default points of collocation."""
        if self.weighting not in WEIGHTINGS:
            raise unknown("weighting", self.weighting, WEIGHTINGS)
        if not 1 <= self.terms <= MOST_TERMS:
            raise InputError(f"terms is {self.terms}; allowed: 1 to {MOST_TERMS}")
        if not 0 <= self.corrections <= MOST_CORRECTIONS:
            raise InputError(f"corrections is {self.corrections}; allowed: 0 to {MOST_CORRECTIONS}")
        if self.weighting != "collocation":
            if self.points is not None:
                text = f"points have no meaning with {self.weighting}; allowed: with collocation"
                raise InputError(text)
        elif self.points is None:
            object.__setattr__(self, "points", "thesis")
        elif isinstance(self.points, str):
            if self.points not in POINTS:
                raise unknown("points", self.points, (*POINTS, "a list as in 0.25,0.75"))
        else:
            self._check_points(self.points)

    def _check_points(self, points: Sequence[float]) -> None:
        if len(points) != self.terms:
            text = f"points: {len(points)} given; allowed: as many as there are terms, {self.terms}"
            raise InputError(text)
        for point in points:
            if not 0.0 <= point <= 1.0:
                raise InputError(f"points: {point:g}; allowed: 0 to 1, as fractions of the step")
        if len(set(points)) < len(points):
            raise InputError("points: a collocation point is given twice; give different points")
        if np.linalg.cond(basis(np.array(points), self.terms)) > _WORST_CONDITION:
            raise InputError(
                "points: the collocation points are too close together for double precision; "
                "use points further apart"
            )

    @property
    def points_label(self) -> str:
        """Return the collocation points as text for a table; a dash for other weightings."""
        if self.points is None:
            return "-"
        if isinstance(self.points, str):
            return self.points
        return ",".join(f"{point:g}" for point in self.points)


def converged_order(member: Member) -> int:
    """Return the order after many corrections, as derived in docs/explanation/methods.md."""
    n = member.terms
    if member.weighting == "galerkin":
        return n
    if member.weighting == "least-squares":
        return 2 * n
    if member.weighting == "subdomain":
        return n + 1 + (n % 2 == 0)
    nodal = Polynomial.fromroots(grid(member.points, n))
    for power in range(n):
        moment = (nodal * Polynomial.basis(power)).integ()
        if abs(moment(1.0) - moment(0.0)) > 1e-12:
            return n + power
    return 2 * n


def predicted_order(member: Member) -> int:
    """Return the order of the global error: corrections + 1, at most `converged_order`."""
    return min(member.corrections + 1, converged_order(member))


def run(scene: Scene, member: Member) -> Trajectory:
    """Integrate a scene by a weighted residual method (Jacobs 1982, III.1, eq. 20-27, and IV.2).

    The first estimate uses the torque at the beginning of the step, corrections the torque at their
    nodes. Each step rounds omega by about one unit in the last place.
    """
    omega = integrate(scene, [member])[0]
    rows = int(np.logical_and.accumulate(np.isfinite(omega).all(axis=1)).sum())
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


def integrate(scene: Scene, members: Sequence[Member]) -> Array:
    """Return omega (rad/s) by several methods at once, shape (members, steps, 3).

    Values after an overflow are not finite.
    """
    # Sorted so that the members that need another correction are contiguous in memory.
    order = sorted(range(len(members)), key=lambda i: -members[i].corrections)
    members = [members[i] for i in order]
    schemes = [tableau(m.weighting, m.terms, m.points) for m in members]
    width = max(len(scheme.nodes) for scheme in schemes)
    # Padding nodes are at the beginning of the step, with weight 0.
    nodes = np.zeros((len(members), width))
    matrix = np.zeros((len(members), width, width))
    weights = np.zeros((len(members), 1, width))
    for i, scheme in enumerate(schemes):
        m = len(scheme.nodes)
        nodes[i, :m], weights[i, 0, :m] = scheme.nodes, scheme.weights
        matrix[i, :m, :m] = scheme.matrix
    across = np.ascontiguousarray(matrix.transpose(1, 2, 0))
    most = members[0].corrections
    going = [sum(m.corrections >= k for m in members) for k in range(most + 2)]
    h = scene.step_size
    result = np.full((len(members), scene.steps, 3), math.nan)
    start = np.tile(np.array(scene.omega), (len(members), 1, 1))
    with np.errstate(all="ignore"):
        for step in range(scene.steps):
            begin = step * h
            rates = _rates(scene, _torque(scene, np.array([begin])), start)
            end = start + h * rates
            estimate = start + h * nodes[:, :, None] * rates
            torque = _torque(scene, begin + h * nodes)
            for k in range(1, most + 1):
                n, rest = going[k], going[k + 1]
                rates = _rates(scene, torque[:n] if scene.torque.varies else torque, estimate[:n])
                end[rest:n] = start[rest:n] + h * _sums(weights[rest:n], rates[rest:])
                estimate = start[:rest] + h * _stages(across[..., :rest], rates[:rest])
            start = end
            result[:, step] = end[:, 0]
            if not np.isfinite(end).any():
                break
    found = np.empty_like(result)
    found[order] = result
    return found


def _stages(matrix: Array, rates: Array) -> Array:
    """Return the products of `_sums` in a third of the time, from matrices (i, j, members)."""
    side_by_side = np.ascontiguousarray(rates.transpose(1, 2, 0))
    total: Array = matrix[:, 0, None] * side_by_side[0]
    product = np.empty_like(total)
    for j in range(1, matrix.shape[1]):
        np.multiply(matrix[:, j, None], side_by_side[j], out=product)
        total += product
    found: Array = total.transpose(2, 0, 1)
    return found


def _sums(factors: Array, rates: Array) -> Array:
    """Return the products of factors (members, i, j) and rates (members, j, 3), without BLAS."""
    total: Array = np.einsum("mij,mjk->mik", factors, rates)
    return total


def _rates(scene: Scene, torque: Array, omega: Array) -> Array:
    rates = np.empty(omega.shape)  # C order, because the layout can change how NumPy rounds sums
    for i, (a, j, k) in enumerate(zip(scene.euler_coefficients, (1, 0, 0), (2, 2, 1), strict=True)):
        rates[..., i] = torque[..., i] + a * omega[..., j] * omega[..., k]
    return rates


def _torque(scene: Scene, times: Array) -> Array:
    """Return the torque divided by the moments (rad/s2) at `times` (s), shape (..., 3)."""
    law = scene.body_torque
    torque = np.array(law.constant)
    if law.varies:
        t = times[..., None]
        torque = torque + np.array(law.rate) * t
        for waves, function in ((law.sines, np.sin), (law.cosines, np.cos)):
            for amplitude, frequency in waves:
                torque = torque + np.array(amplitude) * function(frequency * t)
    return torque if scene.moments is None else torque / np.array(scene.moments)
