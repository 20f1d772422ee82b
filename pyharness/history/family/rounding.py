"""Whether rounding spoils the integral weightings, as IV.2 supposes: they as one would punch them.

The thesis lays the failure of subdomain, Galerkin and least squares to "computer error" in the
written out products of trial functions. Here is that computation: powers of t in seconds, not of
the unit interval; products of trial functions multiplied out, integrated term by term; the c's
solved for. It is as unfavourable as the powers allow, and can be done in 24 bits (the fewest of
any machine of the time) or 53.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyharness.history.family.members import WEIGHTINGS, Member, march, run
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference

Numbers = NDArray[np.floating]


@dataclass(frozen=True)
class WeightingFinding:
    """One weighting in one scene, the largest differences of any omega over the run (rad/s).

    Attributes
    ----------
    member : Member
        With as many corrections as the thesis makes.
    error : float
        Of the member as this project computes it, against the truth.
    double, single : float
        Rounding of the multiplied out products in 53 and 24 bits: distance from `error`'s run.
    """

    member: Member
    error: float
    double: float
    single: float


def weighting_findings(scene: Scene, terms: int = 2) -> list[WeightingFinding]:
    """Hold the four weightings against the truth, and their rounding against their error.

    Parameters
    ----------
    scene : Scene
        Torques must be constant, as the multiplied out products suppose.
    terms : int
        Powers of t.

    Returns
    -------
    list of WeightingFinding
        In the order of `WEIGHTINGS`. Source of the claim: Jacobs 1982, IV.2.
    """
    truth = reference(scene, scene.times()).omega
    members = [Member(weighting, terms) for weighting in WEIGHTINGS]
    found = []
    for member, omega in zip(members, march(scene, members), strict=True):
        found.append(
            WeightingFinding(
                member,
                _largest(omega - truth),
                _largest(multiplied_out(scene, member, np.float64) - omega),
                _largest(multiplied_out(scene, member, np.float32) - omega),
            )
        )
    return found


@dataclass(frozen=True)
class RoundingFinding:
    """What rounding alone does to a weighting at a small step, over the same time (rad/s)."""

    weighting: str
    steps: int
    error: float


def rounding_findings(scene: Scene, parts: int = 10) -> list[RoundingFinding]:
    """Measure rounding where it is all that is left: many corrections, five terms, small steps.

    Parameters
    ----------
    scene : Scene
        What to integrate.
    parts : int
        Into how many each step of the scene is cut.
    """
    finer = replace(scene, step_size=scene.step_size / parts, steps=scene.steps * parts)
    truth = reference(scene, [scene.times()[-1]]).omega[-1]
    found = []
    for weighting in WEIGHTINGS:
        points = "gauss" if weighting == "collocation" else None
        omega = run(finer, Member(weighting, 5, points, 5)).omega
        found.append(RoundingFinding(weighting, finer.steps, _largest(omega[-1] - truth)))
    return found


def multiplied_out(scene: Scene, member: Member, precision: DTypeLike) -> Array:
    """Run a member of one correction by multiplied out products, in some precision.

    Returns
    -------
    ndarray, shape (steps, 3)
        omega (rad/s), as `run` gives it but for rounding.

    Raises
    ------
    InputError
        Where torques vary with time, there is not exactly one correction, or the points are
        not the thesis's.
    """
    if scene.torque.varies:
        raise InputError("torque varies with time; allowed here: constant torques")
    if member.corrections != 1:
        raise InputError(f"corrections is {member.corrections}; allowed here: 1")
    if member.points not in (None, "thesis"):
        raise InputError(f"points are {member.points_label}; allowed here: thesis")
    h = np.array(scene.step_size, precision)
    matrix = conditions(member, float(h), precision, member.terms)
    # The conditions of products, whose powers go up to 2n, and of the constant.
    moments = conditions(member, float(h), precision, 2 * member.terms + 1)
    moments = moments / np.arange(1, 2 * member.terms + 2).astype(precision)
    coefficients = np.array(scene.euler_coefficients, precision)
    torque = np.array(scene.normalized_torque(0.0), precision)
    powers = (h ** np.arange(1, member.terms + 1)).astype(precision)
    omega = np.array(scene.omega, precision)
    result = np.empty((scene.steps, 3), precision)
    for step in range(scene.steps):
        constant = torque + coefficients * omega[[1, 0, 0]] * omega[[2, 2, 1]]
        estimate = np.linalg.solve(matrix, np.outer(moments[:, 0], constant))
        trial = np.vstack([omega, estimate])
        products = np.array(
            [np.convolve(trial[:, j], trial[:, k]) for j, k in ((1, 2), (0, 2), (0, 1))]
        ).T
        right = coefficients * (moments @ products) + np.outer(moments[:, 0], torque)
        omega = omega + powers @ np.linalg.solve(matrix, right)
        result[step] = omega
    return result.astype(np.float64)


def conditions(member: Member, h: float, precision: DTypeLike, columns: int) -> Numbers:
    """Return the weighted integrals of j t**(j-1), j = 1 ... columns, over a step of length h.

    Returns
    -------
    ndarray, shape (terms, columns)
        Its first n columns are the matrix of the c's; eq. 36a is that of collocation.
    """
    n = member.terms
    i, j = np.arange(1, n + 1)[:, None], np.arange(1, columns + 1)[None, :]
    if member.weighting == "galerkin":
        values = j * h ** (i + j) / (i + j)
    elif member.weighting == "least-squares":
        values = i * j * h ** (i + j - 1.0) / (i + j - 1)
    elif member.weighting == "subdomain":
        values = (i * h / n) ** j - ((i - 1) * h / n) ** j
    else:
        values = j * (i * h / (n + 1)) ** (j - 1.0)
    rounded: Numbers = values.astype(precision)
    return rounded


def _largest(differences: Array) -> float:
    return float(np.abs(differences).max())
