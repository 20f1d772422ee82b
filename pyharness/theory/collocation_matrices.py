"""The matrices of collocation (eq. 36), and the accuracy of their solution by LEQT1F.

LEQT1F is the linear solver that the collocation programs call. Every float is a fraction, so that
the exact solution is rational. It is therefore computed here without rounding.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pyharness.model.trajectory import Array
from pyharness.original import collocation
from pyharness.original.linear_solver import SINGULAR, leqt1f
from pyharness.theory.rational import (
    Fractions,
    collocation_matrix,
    fractions,
    gamma,
    inverse,
    norm,
)

# The collocation points, where the residual is zero, in units of the step.
PARTS = {
    "two-term": (Fraction(1, 3), Fraction(2, 3)),
    "four-term": (Fraction(1, 5), Fraction(2, 5), Fraction(3, 5), Fraction(4, 5)),
}


@dataclass(frozen=True)
class Solved:
    """The accuracy of LEQT1F for one collocation matrix with six right-hand sides.

    The solution X of A X = B by LEQT1F is compared with the exact solution.
    """

    ier: int  # error code of the compiled solver: 0, or 129 for a singular matrix
    differing: int  # how many of the numbers X and IER differ in Fortran and in the Python twin
    # exact condition numbers in the row-sum norm: of the matrix, and of the matrix with each column
    # divided by its largest element
    condition: float
    scaled_condition: float
    # norm of abs(L) abs(U) over the norm of the matrix, both with columns divided likewise
    growth: float = math.nan
    order: tuple[int, ...] = ()  # the rows in the order in which they became pivots
    # largest shortfall of a chosen pivot from the largest candidate, and the shortfall that
    # rounding may cause, both relative
    pivoting: tuple[float, float] = (0.0, 0.0)
    # errors over their bounds, the largest of all right-hand sides (Higham 2002, theorem 9.4): of
    # the residual of A X = B, of each element of X, and of the increment of an unknown over a step
    residual: float = math.nan
    forward: float = math.nan
    increment: float = math.nan
    increment_error: float = math.nan  # increment's error over step times largest right-hand side
    yardstick: float = math.nan  # `forward` of `numpy.linalg.solve`, for comparison


def points(program: str, step: float) -> list[float]:
    """Return the collocation points (s) for a step size `step` (s) as the program computes them."""
    if program == "two-term":
        return [step / 3.0, 2.0 * step / 3.0]
    return [step * 0.2, step * 0.4, step * 0.6, step * 0.8]


def _right_hand_sides(count: int) -> Array:
    """Return six right-hand sides: constant, linear, alternating, and three random ones.

    Each has `count` elements, so that the shape is (6, count).
    """
    rough = np.random.default_rng(count).normal(size=(3, count))
    places = range(count)
    return np.array(
        [[1.0] * count, [k / count for k in places], [(-1.0) ** k for k in places], *rough]
    )


def solved(program: str, step: float) -> Solved:
    """Solve a program's collocation matrix for one step size (s), by LEQT1F and exactly.

    Return the differences of the two solutions as a `Solved`.
    """
    from pyharness.model.extension import extension

    matrix = collocation.collocation_matrix(points(program, step))
    sides = _right_hand_sides(len(matrix))
    factors, found, ier = extension().solve_linear(
        np.asfortranarray(matrix), np.asfortranarray(sides.T)
    )
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
    # Find the row of the matrix that each row of L U is.
    order = tuple(int(abs(exact[:, 1] - row[1]).argmin()) for row in lower @ upper)
    sizes = abs(lower) @ abs(upper)
    growth = float(norm(sizes / columns) / norm(scaled))
    # The bounds apply to the rows in their order in the matrix.
    sizes = sizes[np.argsort(order)]

    def errors(solutions: Array) -> list[float]:
        pairs = zip(solutions.T, sides, strict=True)
        every = [_errors(exact, solver, sizes, Fraction(step), x, b) for x, b in pairs]
        largest: list[float] = np.array(every).max(axis=0).tolist()
        return largest

    residual, forward, increment, increment_error = errors(found)
    _, yardstick, *_ = errors(np.linalg.solve(np.array(matrix), sides.T))
    return Solved(
        ier, differing, condition, scaled_condition, growth, order,
        _pivoting(exact, order, sizes), residual, forward, increment, increment_error, yardstick,
    )  # fmt: skip


def _small_step(program: str) -> tuple[Fraction, Fractions]:
    """Return a step size (s) and its collocation matrix, in which each row's largest element is 1.

    Any smaller step size has the same property.
    """
    step = Fraction(1, 1000)
    return step, collocation_matrix([part * step for part in PARTS[program]])


def solver_roundings(program: str) -> tuple[float, float]:
    """Return two bounds on the rounding error that solving for c1, c2, ... adds to a step's result.

    Both are in units of 2**-53 times step size times rate, where a rate is a right-hand side of
    Euler's equations. The first bound is for a rate that is the same at all collocation points, so
    that only c1 is not zero. The second bound is for deviations of the rates at the points from
    this constant rate, and must be multiplied by the relative deviation.

    The bounds are 3n abs(powers) abs(inverse) abs(L) abs(U) abs(X) (Higham 2002, theorem 9.4).
    Here n is the number of points, the powers are those of the step size, L and U are the factors
    of the collocation matrix, and X is the solution. The bounds do not depend on the step size as
    long as 1 is the largest element of each row.
    """
    step, matrix = _small_step(program)
    count = len(matrix)
    reach = abs(inverse(matrix))
    powers = np.array([step**k for k in range(1, count + 1)], dtype=object)
    factor_sizes = np.zeros_like(matrix)
    for j, (chosen, candidates, rows) in enumerate(_columns(matrix)):
        for i in candidates:
            factor_sizes[i] += abs(rows[i, j] / rows[chosen, j] * rows[chosen])
    sizes = reach @ factor_sizes
    constant, varying = powers @ sizes[:, 0], powers @ (sizes @ reach).sum(axis=1)
    return 3 * count * float(constant / step), 3 * count * float(varying / step)


def singular_below(program: str, bits: int = 53) -> float:
    """Return the step size (s) at and below which LEQT1F must declare the matrix singular.

    The matrix is the collocation matrix of a program, with N rows. LEQT1F declares it singular if
    N + pivot equals N. This is the case if the pivot is at most half a unit in the last place of N,
    because a tie goes to N, which is even. N is a power of 2, and its last place is 2**(1 - bits)
    of it in an arithmetic of `bits` bits that rounds to nearest. The last scaled pivot is
    proportional to step**(N-1).
    """
    step, matrix = _small_step(program)
    count = len(matrix)
    *_, (chosen, candidates, _) = _columns(matrix)
    last_pivot = candidates[chosen] / step ** (count - 1)
    half_unit = count * Fraction(1, 2**bits)
    return math.pow(half_unit / last_pivot, 1.0 / (count - 1))


def declared_singular_below(program: str) -> float:
    """Return the largest step size (s) whose matrix the compiled LEQT1F declares singular.

    The matrix is the collocation matrix of a program. The step size is found by bisection.
    """
    from pyharness.model.extension import extension

    def singular(step: float) -> bool:
        matrix = collocation.collocation_matrix(points(program, step))
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


def _errors(
    matrix: Fractions,
    solver: Fractions,
    sizes: Fractions,
    step: Fraction,
    found: Array,
    side: Array,
) -> tuple[float, ...]:
    """Return the errors of residual, X and increment over their bounds, and the increment's error.

    `found` is the computed solution X of `matrix` X = `side`, and the increment is the change of
    the unknown over the step. `solver` is the exact inverse of the matrix. `sizes` is abs(L) abs(U)
    for its factors, with the rows in the order of the matrix. The fourth number is the error of the
    increment relative to the step size times the largest right-hand side.
    """
    count = len(matrix)
    x, b = fractions(found), fractions(side)
    truth = solver @ b
    allowed = gamma(3 * count) * (sizes @ abs(x))
    reach = abs(solver) @ allowed
    total, power = 0.0, float(step)
    for c in found:
        total, power = total + c * power, power * float(step)
    powers = np.array([step**k for k in range(1, count + 1)], dtype=object)
    # Up to three roundings in a power, one in its product with c, n in the sum.
    bound = powers @ (reach + gamma(count + 4) * abs(x))
    missed = abs(Fraction(total) - powers @ truth)
    return (
        max(map(_share, abs(matrix @ x - b), allowed)),
        max(map(_share, abs(truth - x), reach)),
        _share(missed, bound),
        float(missed / (step * abs(b).max())),
    )


def _share(error: Fraction, bound: Fraction) -> float:
    return 0.0 if not error else float(error / bound) if bound else math.inf


def _pivoting(matrix: Fractions, order: Sequence[int], sizes: Fractions) -> tuple[float, float]:
    """Return the largest relative shortfall of a pivot from the largest candidate, and its bound.

    The pivots are those of an exact elimination of `matrix` whose pivot rows are taken in `order`.
    The bound is the shortfall that rounding may cause; it follows from `sizes`, abs(L) abs(U).
    """
    shortfall, allowed = Fraction(0), Fraction(0)
    scale = 1 / abs(matrix).max(axis=1)
    for j, (chosen, candidates, _) in enumerate(_columns(matrix, order)):
        best = max(candidates.values())
        shortfall = max(shortfall, 1 - candidates[chosen] / best)
        # Two candidates are compared, each with the rounding errors of its sum and its scale.
        wrong = max(scale[i] * sizes[i, j] for i in candidates) * gamma(len(matrix) + 2)
        allowed = max(allowed, 2 * wrong / best)
    return float(shortfall), float(allowed)


def _columns(
    matrix: Fractions, order: Sequence[int] | None = None
) -> Iterator[tuple[int, dict[int, Fraction], Fractions]]:
    """Eliminate a matrix exactly, and yield the choice of the pivot in each column.

    Yield the index of the pivot row, the scaled pivot candidates by row index, and all rows before
    this column is eliminated. Rows become pivots in `order` or, without it, by the rule of LEQT1F:
    the largest scaled candidate.
    """
    rows = matrix.copy()
    scale = 1 / abs(matrix).max(axis=1)
    left = list(range(len(rows)))
    for j in range(len(rows)):
        candidates = {i: scale[i] * abs(rows[i, j]) for i in left}
        chosen = order[j] if order else max(left, key=candidates.__getitem__)
        yield chosen, candidates, rows
        left.remove(chosen)
        rows[left] -= np.outer(rows[left, j] / rows[chosen, j], rows[chosen])
