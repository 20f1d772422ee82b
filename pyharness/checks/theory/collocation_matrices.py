"""The collocation matrices (eq. 36 of the thesis), and the accuracy of LEQT1F's solutions.

LEQT1F is the linear solver of the two-term and four-term programs.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyharness.model.basis import Basis
from pyharness.model.trajectory import Array
from pyharness.thesis import collocation
from pyharness.thesis.linear_solver import SINGULAR, leqt1f

Exact = list[list[Fraction]]
Fractions = NDArray[np.object_]

_UNIT = Fraction(1, 2**53)
# Collocation points in units of the step size.
PARTS = {
    "two-term": (Fraction(1, 3), Fraction(2, 3)),
    "four-term": (Fraction(1, 5), Fraction(2, 5), Fraction(3, 5), Fraction(4, 5)),
}
HIGHAM = Basis(
    "proved",
    "errors of LEQT1F: residual, solution and increment over a step",
    "Higham 2002, theorem 9.4, in exact fractions; the factors, and that no operation underflows "
    "or overflows, are checked (`theory/collocation_matrices.py`)",
)
"""Basis of the bounds in `residual`, `forward` and `increment` of `Solved`."""
PIVOTS = Basis(
    "derived",
    "choice of pivots by LEQT1F, and the step size at which its matrix is singular",
    "rounding errors of the candidates, to first order (`theory/collocation_matrices.py`)",
)
"""Basis of `pivoting` of `Solved`, and of limits that follow from it."""
SINGULARITY = Basis(
    "derived",
    "number of steps for which LEQT1F reports IER = 129",
    "the last pivot of exact elimination, evaluated in binary64 (`theory/collocation_matrices.py`)",
)
"""Basis of limits that follow from `singular_below`."""
# Range of nonzero elements for which the solution of at most four equations neither underflows nor
# overflows. A product of two elements is at least 2**-300, and after rounding a multiple of
# 2**-352. In forward substitution every further product costs 202 binary digits, so that each
# unknown is 0 or at least 2**-756, and at most 2**600.
_RANGE = 2.0**-150, 2.0**150


def inverse(matrix: Fractions) -> Fractions:
    """Return the exact inverse, by Gauss-Jordan elimination."""
    count = len(matrix)
    rows = np.hstack([matrix, np.eye(count, dtype=object)])
    for j in range(count):
        pivot = j + int(abs(rows[j:, j]).argmax())
        rows[[j, pivot]] = rows[[pivot, j]]
        rows[j] = rows[j] / rows[j, j]
        others = np.arange(count) != j
        rows[others] -= np.outer(rows[others, j], rows[j])
    return rows[:, count:]


def fractions(floats: ArrayLike) -> Fractions:
    return np.asarray(np.vectorize(Fraction, otypes=[object])(floats))


def gamma(count: int) -> Fraction:
    """Return n u / (1 - n u), u = 2**-53, a bound for n = `count` roundings (Higham, lemma 3.1)."""
    return count * _UNIT / (1 - count * _UNIT)


def norm(matrix: Fractions) -> Fraction:
    return Fraction(abs(matrix).sum(axis=1).max())


def collocation_matrix(points: Sequence[Fraction]) -> Fractions:
    """Return the derivatives of t, t**2, ..., t**n at n points, a row for each point (eq. 36)."""
    rows = [[(j + 1) * point**j for j in range(len(points))] for point in points]
    return np.array(rows, dtype=object)


@dataclass(frozen=True)
class Solved:
    """LEQT1F's accuracy with a collocation matrix A and six right-hand sides B."""

    ier: int  # error code of the compiled solver: 0, or 129 for a singular matrix
    differing: int  # number of elements of X, and IER, that differ between Fortran and Python
    # Exact condition numbers in the row-sum norm: of the matrix, and of the matrix with each column
    # divided by its largest element.
    condition: float
    scaled_condition: float
    # Norm of abs(L) abs(U) divided by the norm of the matrix, both with each column divided by the
    # matrix's largest element in it.
    growth: float = math.nan
    order: tuple[int, ...] = ()  # rows in the order in which they become pivots
    # Relative difference of a pivot from the largest candidate: the largest that occurs, and the
    # largest that rounding can cause.
    pivoting: tuple[float, float] = (0.0, 0.0)
    # Largest ratios of errors to their bounds (Higham 2002, theorem 9.4): of the residual of A X =
    # B, the elements of X, and the increment of an unknown over a step.
    residual: float = math.nan
    forward: float = math.nan
    increment: float = math.nan
    # Error of the increment, divided by step size times the right-hand side's largest element.
    increment_error: float = math.nan
    yardstick: float = math.nan  # `forward` for `numpy.linalg.solve` instead of LEQT1F


def points(program: str, step: float) -> list[float]:
    """Return the collocation points (s), rounded as in a program's formulas."""
    if program == "two-term":
        return [step / 3.0, 2.0 * step / 3.0]
    return [step * 0.2, step * 0.4, step * 0.6, step * 0.8]


def solved(program: str, step: float) -> Solved:
    """Return LEQT1F's accuracy for the collocation matrix of a step size (s)."""
    from pyharness.model.extension import extension

    matrix = collocation.collocation_matrix(points(program, step))
    count = len(matrix)
    places = np.arange(count)
    # Three regular right-hand sides, three random ones.
    rough = np.random.default_rng(count).normal(size=(3, count))
    sides = np.array([np.ones(count), places / count, (-1.0) ** places, *rough])
    factors, found, ier = extension().solve_linear(*map(np.asfortranarray, (matrix, sides.T)))
    twin, twin_ier = leqt1f(matrix, sides.tolist())
    differing = int((np.array(twin) != found.T).sum()) + (ier != twin_ier)
    exact = fractions(matrix)
    solver = inverse(exact)
    columns = abs(exact).max(axis=0)
    scaled = exact / columns
    condition = float(norm(exact) * norm(solver))
    scaled_condition = float(norm(scaled) * norm(solver * columns[:, None]))
    if ier == SINGULAR:
        return Solved(ier, differing, condition, scaled_condition)
    lower = fractions(np.tril(factors, -1) + np.eye(len(factors)))
    upper = fractions(np.triu(factors))
    # Each row of L U equals a row of the matrix, except for rounding.
    order = tuple(int(abs(exact[:, 1] - row[1]).argmin()) for row in lower @ upper)
    sizes = abs(lower) @ abs(upper)
    growth = float(norm(sizes / columns) / norm(scaled))
    # The bounds need `sizes` in the matrix's order of rows.
    sizes = sizes[np.argsort(order)]
    powers = np.array([Fraction(step) ** k for k in range(1, count + 1)], dtype=object)

    def errors(solutions: Array) -> list[float]:
        every = []
        for solution, side in zip(solutions.T, sides, strict=True):
            x, b = fractions(solution), fractions(side)
            truth = solver @ b
            allowed = gamma(3 * count) * (sizes @ abs(x))
            reach = abs(solver) @ allowed
            total, power = 0.0, step
            for c in solution:
                total, power = total + c * power, power * step
            # At most three roundings in a power of the step size, one in its product with c, and n
            # in the sum.
            bound = powers @ (reach + gamma(count + 4) * abs(x))
            missed = abs(Fraction(total) - powers @ truth)
            pairs = (abs(exact @ x - b), allowed), (abs(truth - x), reach), ([missed], [bound])
            ratios = [max(map(_share, wrong, most)) for wrong, most in pairs]
            every.append([*ratios, float(missed / (powers[0] * abs(b).max()))])
        return [max(each) for each in zip(*every, strict=True)]

    residual, forward, increment, increment_error = errors(found)
    # Theorem 9.4 holds if no operation underflows or overflows, and L and U are factors of the rows
    # in `order`, within the errors of theorem 9.3.
    operands = [matrix, factors, sides, found, [step, step**count]]
    elements = np.abs(np.concatenate([np.ravel(each) for each in operands]))
    elements = elements[elements != 0.0]
    is_safe = count <= 4 and _RANGE[0] <= elements.min() and elements.max() <= _RANGE[1]
    missed = abs(exact[list(order)] - lower @ upper) <= gamma(count) * (abs(lower) @ abs(upper))
    if not (is_safe and sorted(order) == list(range(count)) and missed.all()):
        residual = forward = increment = math.inf
    _, yardstick, *_ = errors(np.linalg.solve(np.array(matrix), sides.T))
    return Solved(
        ier, differing, condition, scaled_condition, growth, order,
        _pivoting(exact, order, sizes), residual, forward, increment, increment_error, yardstick,
    )  # fmt: skip


def _small_step(program: str) -> tuple[Fraction, Fractions]:
    """Return a step size (s) so small that each row's largest element is 1, and its matrix."""
    step = Fraction(1, 1000)
    return step, collocation_matrix([part * step for part in PARTS[program]])


def solver_roundings(program: str) -> tuple[float, float]:
    """Return bounds on the solver's rounding error for equal rates, and for deviations from these.

    Their unit is 2**-53 times step size times rate or deviation.
    """
    step, matrix = _small_step(program)
    count = len(matrix)
    reach = abs(inverse(matrix))
    powers = np.array([step**k for k in range(1, count + 1)], dtype=object)
    # Higham 2002, theorem 9.4: 3n abs(powers) abs(inverse) abs(L) abs(U) abs(X), with the matrix's
    # inverse and factors L and U, the solution X, and the powers of the step size.
    factor_sizes = np.zeros_like(matrix)
    for j, (chosen, candidates, rows) in enumerate(_columns(matrix)):
        for i in candidates:
            factor_sizes[i] += abs(rows[i, j] / rows[chosen, j] * rows[chosen])
    sizes = reach @ factor_sizes
    # With equal rates, only the coefficient of t is not zero. The bounds do not depend on the step
    # size while each row's largest element is 1.
    constant, varying = powers @ sizes[:, 0], powers @ (sizes @ reach).sum(axis=1)
    return 3 * count * float(constant / step), 3 * count * float(varying / step)


def singular_below(program: str, bits: int = 53) -> float:
    """Return the largest step size (s) for which LEQT1F, in `bits` bits, reports singularity."""
    step, matrix = _small_step(program)
    count = len(matrix)
    *_, (chosen, candidates, _) = _columns(matrix)
    # With N rows, the computed sum N + p equals N if the scaled pivot p is at most half a unit in
    # the last place of N: this unit is N 2**(1 - bits), as N is a power of 2, and a tie is rounded
    # to N. The last pivot, proportional to step**(N-1), is the first to be so small.
    last_pivot = candidates[chosen] / step ** (count - 1)
    half_unit = count * Fraction(1, 2**bits)
    return math.pow(half_unit / last_pivot, 1.0 / (count - 1))


def declared_singular_below(program: str) -> float:
    """Return the largest step size (s) for which the compiled LEQT1F reports singularity."""
    from pyharness.model.extension import extension

    def singular(step: float) -> bool:
        matrix = np.asfortranarray(collocation.collocation_matrix(points(program, step)))
        *_, ier = extension().solve_linear(matrix, np.ones((len(matrix), 1), order="F"))
        return bool(ier == SINGULAR)

    low, high = 1e-20, 1.0
    while high > low * (1.0 + 1e-15):
        middle = (low * high) ** 0.5
        if not low < middle < high:
            break
        low, high = (middle, high) if singular(middle) else (low, middle)
    return low


def _share(error: Fraction, bound: Fraction) -> float:
    if not error or not bound:
        return math.inf if error else 0.0
    ratio = error / bound
    # A ratio above 1 must not be rounded to 1.
    return max(float(ratio), math.nextafter(1.0, 2.0)) if ratio > 1 else float(ratio)


def _pivoting(matrix: Fractions, order: Sequence[int], sizes: Fractions) -> tuple[float, float]:
    """Return the pivots' largest relative shortfall from the best candidates, and its bound."""
    # By exact elimination in the solver's `order`; `sizes` is abs(L) abs(U).
    shortfall, allowed = Fraction(0), Fraction(0)
    scale = 1 / abs(matrix).max(axis=1)
    for j, (chosen, candidates, _) in enumerate(_columns(matrix, order)):
        best = max(candidates.values())
        shortfall = max(shortfall, 1 - candidates[chosen] / best)
        # Each of the two candidates has the rounding errors of a sum and a scale factor.
        wrong = max(scale[i] * sizes[i, j] for i in candidates) * gamma(len(matrix) + 2)
        allowed = max(allowed, 2 * wrong / best)
    return float(shortfall), float(allowed)


def _columns(
    matrix: Fractions, order: Sequence[int] | None = None
) -> Iterator[tuple[int, dict[int, Fraction], Fractions]]:
    """Yield the pivot's row, scaled candidates and rows before each column of an elimination."""
    # A candidate is an element's magnitude divided by the largest in its row of `matrix`. `order`
    # has the pivots' rows; without it the largest candidate is the pivot, as in LEQT1F.
    rows = matrix.copy()
    scale = 1 / abs(matrix).max(axis=1)
    left = list(range(len(rows)))
    for j in range(len(rows)):
        candidates = {i: scale[i] * abs(rows[i, j]) for i in left}
        chosen = order[j] if order else max(left, key=candidates.__getitem__)
        yield chosen, candidates, rows
        left.remove(chosen)
        rows[left] -= np.outer(rows[left, j] / rows[chosen, j], rows[chosen])
