"""The matrices of collocation (eq. 36), and what LEQT1F makes of them.

The truth is rational: a matrix of floats is one of fractions, and is solved without rounding.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pyharness.model.trajectory import Array
from pyharness.original.collocation import collocation_matrix
from pyharness.original.linear_solver import SINGULAR, leqt1f
from pyharness.theory.rational import (
    Exact,
    absolute,
    dot,
    fractions,
    gamma,
    inverse,
    magnitudes,
    norm,
    product,
    times,
)

# Where the residual is zero, in parts of the step.
PARTS = {
    "two-term": (Fraction(1, 3), Fraction(2, 3)),
    "four-term": (Fraction(1, 5), Fraction(2, 5), Fraction(3, 5), Fraction(4, 5)),
}


@dataclass(frozen=True)
class Solved:
    """One matrix with its right-hand sides, solved by LEQT1F and exactly.

    Attributes
    ----------
    ier : int
        0 or 129, of the compiled solver.
    differing : int
        Numbers, of X and IER, that are not the same bits in Fortran and in the twin.
    condition, scaled_condition : float
        Exact, in the row-sum norm: of the matrix, and after its columns are divided by their
        largest elements.
    growth : float
        Largest row sum of abs(L) abs(U) over that of the matrix, columns scaled likewise.
    order : tuple of int
        The rows in the order in which they became pivots.
    pivoting : tuple of float
        How far the chosen pivots fall short of the largest candidates, and how far rounding
        may let them, both relative.
    residual, forward, increment : float
        Errors over their bounds, the largest of all right-hand sides (Higham 2002, theorem
        9.4): of A X = B, of each element of X, and of what X adds to an unknown over the step.
    increment_error : float
        That last error over step times the largest right-hand side.
    yardstick : float
        As `forward`, of `numpy.linalg.solve`.
    """

    ier: int
    differing: int
    condition: float
    scaled_condition: float
    growth: float
    order: tuple[int, ...]
    pivoting: tuple[float, float]
    residual: float
    forward: float
    increment: float
    increment_error: float
    yardstick: float


def points(program: str, step: float) -> list[float]:
    """Return the points of collocation as a program computes them (s)."""
    if program == "two-term":
        return [step / 3.0, 2.0 * step / 3.0]
    return [step * 0.2, step * 0.4, step * 0.6, step * 0.8]


def right_hand_sides(count: int) -> list[list[float]]:
    """Return six right-hand sides: constant, linear, alternating, and three of no pattern."""
    generator = np.random.default_rng(count)
    rough: list[list[float]] = generator.normal(size=(3, count)).tolist()
    places = range(count)
    return [[1.0] * count, [k / count for k in places], [(-1.0) ** k for k in places], *rough]


def solved(program: str, step: float) -> Solved:
    """Solve one matrix: `step` is what the points are parts of (s)."""
    from pyharness.model.extension import extension

    matrix = collocation_matrix(points(program, step))
    sides = right_hand_sides(len(matrix))
    factors, found, ier = extension().solve_linear(
        np.asfortranarray(matrix), np.asfortranarray(np.array(sides).T)
    )
    twin, twin_ier = leqt1f(matrix, sides)
    differing = int((np.array(twin) != found.T).sum()) + (ier != twin_ier)
    exact = fractions(matrix)
    solver = inverse(exact)
    columns = [max(abs(row[j]) for row in exact) for j in range(len(exact))]
    scaled = [[x / s for x, s in zip(row, columns, strict=True)] for row in exact]
    scaled_inverse = [[x * s for x in row] for row, s in zip(solver, columns, strict=True)]
    condition = float(norm(exact) * norm(solver))
    scaled_condition = float(norm(scaled) * norm(scaled_inverse))
    if ier == SINGULAR:
        nothing = float("nan")
        return Solved(
            ier, differing, condition, scaled_condition, nothing, (), (0.0, 0.0),
            nothing, nothing, nothing, nothing, nothing,
        )  # fmt: skip
    lower, upper = _triangles(factors)
    order = _order(exact, product(lower, upper))
    sizes = product(magnitudes(lower), magnitudes(upper))
    growth = norm([[x / s for x, s in zip(row, columns, strict=True)] for row in sizes])
    # The bounds are on the rows as they stand in the matrix.
    sizes = [sizes[order.index(i)] for i in range(len(exact))]
    yardstick = np.linalg.solve(np.array(matrix), np.array(sides).T)
    judge = _Judge(exact, solver, sizes, step)
    errors = [judge.errors(x, b) for x, b in zip(found.T.tolist(), sides, strict=True)]
    usual = [judge.errors(x, b) for x, b in zip(yardstick.T.tolist(), sides, strict=True)]
    residual, forward, increment, increment_error = np.array(errors).max(axis=0).tolist()
    return Solved(
        ier, differing, condition, scaled_condition, float(growth / norm(scaled)), order,
        _pivoting(exact, order, sizes), residual, forward, increment, increment_error,
        max(each[1] for each in usual),
    )  # fmt: skip


def last_pivot(program: str) -> Fraction:
    """Return the last scaled pivot over step**(n-1), at steps where 1 is the largest of a row."""
    step = Fraction(1, 1000)
    parts = PARTS[program]
    matrix = [[(j + 1) * (part * step) ** j for j in range(len(parts))] for part in parts]
    *_, (chosen, candidates) = _columns(matrix)
    return candidates[chosen] / step ** (len(parts) - 1)


def solver_roundings(program: str) -> tuple[float, float]:
    """Return how far solving moves the result of a step, in units of 2**-53 of step times rate.

    By 3n abs(powers) abs(inverse) abs(L) abs(U) abs(X) (Higham 2002, theorem 9.4), which no step
    changes as long as 1 is the largest of each row.

    Returns
    -------
    constant, varying : float
        For a rate that is the same at all points, where only c1 is not zero, and for each
        whole by which rates at the points may differ from it.
    """
    step = Fraction(1, 1000)
    parts = PARTS[program]
    count = len(parts)
    matrix = [[(j + 1) * (part * step) ** j for j in range(count)] for part in parts]
    reach = magnitudes(inverse(matrix))
    powers = [step**k for k in range(1, count + 1)]
    sizes = product(reach, _factor_sizes(matrix))
    constant = dot(powers, [row[0] for row in sizes])
    varying = dot(powers, [sum(row, Fraction(0)) for row in product(sizes, reach)])
    return 3 * count * float(constant / step), 3 * count * float(varying / step)


def _factor_sizes(matrix: Exact) -> Exact:
    """Return abs(L) abs(U), the rows as they stand in the matrix."""
    order = [chosen for chosen, _ in _columns(matrix)]
    rows = [list(matrix[i]) for i in order]
    sizes = [[Fraction(0)] * len(rows) for _ in rows]
    for j, pivot in enumerate(rows):
        for i in range(j, len(rows)):
            factor = rows[i][j] / pivot[j]
            for k in range(j, len(rows)):
                sizes[order[i]][k] += abs(factor * pivot[k])
            if i > j:
                rows[i] = [x - factor * y for x, y in zip(rows[i], pivot, strict=True)]
    return sizes


def singular_below(program: str, bits: int = 53) -> float:
    """Return the step at and below which LEQT1F must declare singular (s).

    N + pivot equals N up to half a unit in the last place of N, and a tie goes to N, which is
    even. N is a power of 2, whose last place is 2**(1 - bits) of it.

    Parameters
    ----------
    program : str
        A collocation program.
    bits : int
        Of the significand, in an arithmetic that rounds to nearest.
    """
    count = len(PARTS[program])
    half_unit = count * Fraction(1, 2**bits)
    return math.pow(half_unit / last_pivot(program), 1.0 / (count - 1))


def declared_singular_below(program: str) -> float:
    """Return the largest step that the compiled LEQT1F declares singular, by bisection (s)."""
    from pyharness.model.extension import extension

    def singular(step: float) -> bool:
        matrix = collocation_matrix(points(program, step))
        *_, ier = extension().solve_linear(
            np.asfortranarray(matrix), np.ones((len(matrix), 1), order="F")
        )
        return bool(ier == SINGULAR)

    low, high = 1e-20, 1.0
    while high > low * (1.0 + 1e-15):
        middle = (low * high) ** 0.5
        if not low < middle < high:
            break
        low, high = (middle, high) if singular(middle) else (low, middle)
    return low


class _Judge:
    """Errors of solutions of one system over their bounds."""

    def __init__(self, matrix: Exact, solver: Exact, sizes: Exact, step: float) -> None:
        count = len(matrix)
        self._matrix, self._solver, self._sizes = matrix, solver, sizes
        self._gamma = gamma(3 * count)
        # Up to three roundings in a power, one in its product with c, n in the sum.
        self._adding = gamma(count + 4)
        self._step = Fraction(step)
        self._powers = [self._step**k for k in range(1, count + 1)]

    def errors(self, found: Sequence[float], side: Sequence[float]) -> tuple[float, ...]:
        """Return residual, forward and increment over their bounds, and the increment's error."""
        x = [Fraction(each) for each in found]
        b = [Fraction(each) for each in side]
        allowed = [self._gamma * each for each in times(self._sizes, absolute(x))]
        left = [abs(p - q) for p, q in zip(times(self._matrix, x), b, strict=True)]
        truth = times(self._solver, b)
        wrong = [abs(p - q) for p, q in zip(truth, x, strict=True)]
        reach = times(magnitudes(self._solver), allowed)
        total = 0.0
        power = h = float(self._step)
        for c in found:
            total, power = total + c * power, power * h
        wanted = sum(p * q for p, q in zip(self._powers, truth, strict=True))
        bound = sum(
            p * (r + self._adding * abs(q)) for p, q, r in zip(self._powers, x, reach, strict=True)
        )
        missed = abs(Fraction(total) - wanted)
        size = self._step * max(absolute(b))
        return (
            _largest_share(left, allowed),
            _largest_share(wrong, reach),
            _share(missed, Fraction(bound)),
            float(missed / size),
        )


def _pivoting(matrix: Exact, order: Sequence[int], sizes: Exact) -> tuple[float, float]:
    """Follow the order in exact arithmetic; return the largest shortfall and what may be."""
    shortfall, allowed = Fraction(0), Fraction(0)
    scale = _row_scales(matrix)
    for j, (chosen, candidates) in enumerate(_columns(matrix, order)):
        best = max(candidates.values())
        shortfall = max(shortfall, 1 - candidates[chosen] / best)
        # Two candidates, each wrong by the rounding of its sum and of its scale.
        wrong = max(scale[i] * sizes[i][j] for i in candidates) * gamma(len(matrix) + 2)
        allowed = max(allowed, 2 * wrong / best)
    return float(shortfall), float(allowed)


def _columns(
    matrix: Exact, order: Sequence[int] | None = None
) -> Iterator[tuple[int, dict[int, Fraction]]]:
    """Eliminate exactly; yield the pivot's row and all scaled candidates, column by column.

    Rows become pivots in the order given, or by the rule of LEQT1F.
    """
    rows = [list(row) for row in matrix]
    scale = _row_scales(matrix)
    left = list(range(len(rows)))
    for j in range(len(rows)):
        candidates = {i: scale[i] * abs(rows[i][j]) for i in left}
        chosen = order[j] if order else max(left, key=candidates.__getitem__)
        yield chosen, candidates
        left.remove(chosen)
        for i in left:
            factor = rows[i][j] / rows[chosen][j]
            rows[i] = [x - factor * y for x, y in zip(rows[i], rows[chosen], strict=True)]


def _row_scales(matrix: Exact) -> list[Fraction]:
    return [1 / max(absolute(row)) for row in matrix]


def _order(matrix: Exact, multiplied: Exact) -> tuple[int, ...]:
    """Return which row of the matrix each row of L U is."""
    return tuple(
        min(range(len(matrix)), key=lambda i: abs(matrix[i][1] - row[1])) for row in multiplied
    )


def _triangles(factors: Array) -> tuple[Exact, Exact]:
    lower = np.tril(factors, -1) + np.eye(len(factors))
    return fractions(lower.tolist()), fractions(np.triu(factors).tolist())


def _share(error: Fraction, bound: Fraction) -> float:
    return 0.0 if not error else float(error / bound) if bound else float("inf")


def _largest_share(errors: Sequence[Fraction], bounds: Sequence[Fraction]) -> float:
    return max(_share(e, b) for e, b in zip(errors, bounds, strict=True))
