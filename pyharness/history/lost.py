"""The lost programs of section IV.2 of the thesis, and mistakes that may explain their failure.

According to IV.2, the unprinted programs for the subdomain, Galerkin and least-squares methods gave
no meaningful results in Cases 1 and 2. `data/lost.toml` has our conjectures on their mistakes.

The trial function has two terms. One correction follows a first estimate with a constant right-hand
side. A method fails if its error exceeds a tenth of the largest omega.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.polynomial import polynomial

from pyharness.model.assumptions import assumption_records
from pyharness.model.facts import facts
from pyharness.model.functions import is_finite
from pyharness.model.report import Column, Report, Section, Table, short, words
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array
from pyharness.thesis.in_word import WORDS, scene_in
from pyharness.thesis.linear_solver import leqt1f
from pyharness.thesis.programs import BINARY64
from pyharness.truth.reference import reference

WEIGHTINGS = ("subdomain", "galerkin", "least-squares")
CASES = (1, 2)
TERMS = 2


@dataclass(frozen=True)
class Attempt:
    """The result of a method with a mistake.

    `shares` are the errors by case, divided by the largest omega.
    """

    mistake: str
    weighting: str
    shares: dict[int, float]
    failed: tuple[int, ...]


@dataclass(frozen=True)
class Ranked:
    mistake: str
    summary: str
    attempts: tuple[Attempt, ...]

    @property
    def in_both(self) -> int:
        return sum(len(each.failed) == len(CASES) for each in self.attempts)

    @property
    def in_either(self) -> int:
        return sum(bool(each.failed) for each in self.attempts)


def ranked(word: str = BINARY64) -> list[Ranked]:
    limit = facts("lost")["limit"]
    found = []
    for entry in facts("lost")["mistake"]:
        attempts = []
        for weighting in WEIGHTINGS:
            shares = {n: _share(case_scene(n), weighting, entry["id"], word) for n in CASES}
            failed = tuple(case for case, share in shares.items() if not share <= limit)
            attempts.append(Attempt(entry["id"], weighting, shares, failed))
        found.append(Ranked(entry["id"], entry["summary"], tuple(attempts)))
    return sorted(found, key=lambda each: (-each.in_both, -each.in_either))


def _share(scene: Scene, weighting: str, mistake: str, word: str = BINARY64) -> float:
    given = scene if word == BINARY64 else scene_in(scene, WORDS[word])
    omega = integrate(given, weighting, mistake)
    truth = reference(scene, scene.times()).omega
    with np.errstate(all="ignore"):
        error = np.abs(omega - truth).max()
    return float(error / np.abs(truth).max()) if np.isfinite(error) else np.inf


def integrate(scene: Scene, weighting: str, mistake: str = "none") -> Array:
    """Return omega (rad/s) by a method with a mistake, under constant torque, shape (steps, 3).

    Rows after an overflow are NaN.
    """
    h = scene.step_size
    coefficients = scene.euler_coefficients
    torque = np.array(scene.normalized_torque(0.0))
    state = np.array(scene.omega)
    rows = np.full((scene.steps, 3), np.nan)
    weighted_over: float | None = None  # length (s) for which the matrix was computed
    with np.errstate(all="ignore"):
        for step in range(scene.steps):
            # Mistakes change the length of the weighted integrals, but not the step h.
            length = {"dt-accumulates": h * (step + 1), "unit-interval": 1.0}.get(mistake, h)
            if weighted_over is None or length != weighted_over:
                matrix = _matrix(weighting, length)
                weighted_over = length
            c = np.zeros((TERMS, 3))
            for correction in (False, True):
                base = np.zeros(3) if mistake == "base-left-out" and correction else state
                estimate = np.vstack([base, c])
                rates = _rates(estimate, coefficients)
                if mistake != "torque-omitted":
                    rates[0] += torque
                right = np.array([_weighted(weighting, length, column) for column in rates.T])
                c = _solved(matrix, right, mistake, correction)
                if not all(map(is_finite, c.ravel().tolist())):
                    return rows
            state = state + np.array([h, h * h]) @ c
            rows[step] = state
    return rows


def _rates(estimate: Array, coefficients: tuple[float, ...]) -> Array:
    """Return the products in Euler's equations as columns of coefficients of powers of t."""
    columns = [
        polynomial.polymul(estimate[:, j], estimate[:, k]) * a
        for a, j, k in zip(coefficients, (1, 0, 0), (2, 2, 1), strict=True)
    ]
    longest = 2 * len(estimate) - 1
    return np.column_stack([np.pad(each, (0, longest - len(each))) for each in columns])


def _matrix(weighting: str, length: float) -> Array:
    """Return the weighted integrals of 1 and 2 t over (0, `length`), a row for each weight."""
    columns = [_weighted(weighting, length, (i + 1) * np.eye(i + 1)[i]) for i in range(TERMS)]
    return np.array(columns).T


def _solved(matrix: Array, right: Array, mistake: str, second: bool) -> Array:
    """Return c1 and c2 of omega(0) + c1 t + c2 t**2, shape (2, 3)."""
    # `right` has a row for each component of omega; `second` is true for the second call of LEQT1F.
    if mistake == "transposed":
        matrix = matrix.T
    (a, b), (c, d) = matrix.tolist()
    if mistake == "matrix-used-up" and second:
        # LEQT1F overwrites its matrix with Crout's L and U factors, which the second call takes
        # for the matrix.
        matrix = np.array([[a, b], [c / a, d - c / a * b]])
    if mistake == "unscaled-solver":
        x, y = right.T
        # The array is on the left, so that NumPy applies each element's own arithmetic.
        second = (y - x * (c / a)) / (d - c / a * b)
        return np.array([(x - second * b) / a, second])
    solutions, _ = leqt1f(matrix.tolist(), right.tolist())
    return np.array(solutions).T


def _weighted(weighting: str, length: float, residual: Array) -> list[Any]:
    """Return the integrals over (0, length) of a polynomial times each weight."""
    # Lists, because NumPy's polynomials are several times slower with simulated arithmetic.
    coefficients = residual.tolist()
    found = []
    for k in range(TERMS):
        low, high, power, factor = 0.0, length, 0, 1.0
        if weighting == "subdomain":
            low, high = length * k / TERMS, length * (k + 1) / TERMS
        elif weighting == "galerkin":
            power = k + 1
        else:
            power, factor = k, k + 1.0
        integral = [0.0] * (power + 1)
        integral += [factor * x / (i + power + 1) for i, x in enumerate(coefficients)]
        value = _value(integral, high)
        # The antiderivative is 0 at 0.
        found.append(value if low == 0.0 else value - _value(integral, low))
    return found


def _value(coefficients: list[Any], at: Any) -> Any:
    return reduce(lambda value, x: x + value * at, reversed(coefficients))


_ABBREVIATED = {"subdomain": "sub", "galerkin": "gal", "least-squares": "lsq"}
_TABLE = (
    *words("mistake"),
    *(Column(f"{_ABBREVIATED[w]}.{case}", short) for w in WEIGHTINGS for case in CASES),
    Column("both"), Column("either"), Column("what", left=True, fit="wrap"),
)  # fmt: skip


def lost_report(found: Sequence[Ranked], word: str = BINARY64) -> Report:
    rows = []
    for each in found:
        shares = [share for attempt in each.attempts for share in attempt.shares.values()]
        rows.append([each.mistake, *shares, each.in_both, each.in_either, each.summary])
    most = max(each.in_both for each in found)
    best = " and ".join(each.mistake for each in found if each.in_both == most)
    text: list[Section] = [
        [
            "Conjectures: mistakes that the programs for three other weightings may have had. IV.2 "
            "says that they gave no meaningful results in Cases 1 and 2; they are not printed.",
            "sub, gal, lsq: subdomain, Galerkin and least squares; .1, .2: Cases 1 and 2. Each "
            "cell is the largest error relative to the largest omega; more than a tenth fails. "
            "both, either: with how many weightings the mistake fails in both cases, or in either."
            + ("" if word == BINARY64 else f" Computed in {word}."),
        ],
        [Table(_TABLE, rows)],
        [
            f"{best}: in both cases with {most} of {len(WEIGHTINGS)} weightings, the most of all; "
            f"{'none' if most < len(WEIGHTINGS) else 'as IV.2 says,'} with all. A mistake in the "
            "products alone can't fail Case 1, where A = B = C = 0 and the products count nothing."
        ],
    ]

    def record() -> dict[str, Any]:
        assumptions = assumption_records((case_scene(case), []) for case in CASES)
        return {"lost": list(map(asdict, found)), "assumptions": assumptions}

    return Report("family", text, record, Table(_TABLE, rows))
