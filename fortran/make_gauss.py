"""Write the coefficients of Gauss collocation, 1 to 8 stages, as a Fortran module.

The nodes are roots of Legendre polynomials; the weights and matrices are integrals of Lagrange's
polynomials. All are computed with 60 digits. Weights and matrices are written in double-double, so
that their rounding errors do not accumulate.
"""

import itertools
from collections.abc import Callable, Sequence
from decimal import Decimal, localcontext

MOST = 8
DIGITS = 60

HEADER = """module gauss_tables
  !! Gauss collocation on [0, 1]: written by fortran/make_gauss.py, not by hand.
  !! Stage, then stages; unused places are zero.
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_STAGES = {most}
"""


def nodes(stages: int) -> list[Decimal]:
    """Return the roots of the Legendre polynomial of degree `stages` on [0, 1], ascending."""
    # Coefficients of P(n-1) and P(n). The roots of P(n) are separated by those of P(n-1).
    before, now = [Decimal(1)], [Decimal(-1), Decimal(2)]
    borders = [Decimal(0), Decimal(1)]
    roots: list[Decimal] = []
    for degree in range(1, stages + 1):
        value = _polynomial(now)
        roots = [_bisect(value, *pair) for pair in itertools.pairwise(borders)]
        borders = [Decimal(0), *roots, Decimal(1)]
        # Legendre polynomials: (n + 1) P(n+1) = (2 n + 1) (2 x - 1) P(n) - n P(n-1)
        after = [Decimal(0)] * (degree + 2)
        for power, coefficient in enumerate(now):
            after[power] -= (2 * degree + 1) * coefficient / (degree + 1)
            after[power + 1] += 2 * (2 * degree + 1) * coefficient / (degree + 1)
        for power, coefficient in enumerate(before):
            after[power] -= degree * coefficient / (degree + 1)
        before, now = now, after
    return roots


def integrals(c: Sequence[Decimal], begin: Decimal, end: Decimal) -> list[Decimal]:
    """Return the integrals of the Lagrange polynomials of the nodes `c` from `begin` to `end`."""
    result = []
    for j, own in enumerate(c):
        basis = [Decimal(1)]
        for i, other in enumerate(c):
            if i != j:
                scale = 1 / (own - other)
                basis = [
                    (low - other * high) * scale
                    for low, high in zip([Decimal(0), *basis], [*basis, Decimal(0)], strict=True)
                ]
        primitive = _polynomial([Decimal(0), *(b / (n + 1) for n, b in enumerate(basis))])
        result.append(primitive(end) - primitive(begin))
    return result


def _polynomial(coefficients: Sequence[Decimal]) -> Callable[[Decimal], Decimal]:
    def value(x: Decimal) -> Decimal:
        total = Decimal(0)
        for coefficient in reversed(coefficients):
            total = total * x + coefficient
        return total

    return value


def _bisect(value: Callable[[Decimal], Decimal], low: Decimal, high: Decimal) -> Decimal:
    sign = value(low).copy_sign(Decimal(1)) / value(low)
    for _ in range(int(DIGITS * 3.4)):
        middle = (low + high) / 2
        if value(middle) * sign > 0:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _table(name: str, shape: str, values: Sequence[Decimal]) -> str:
    words = [f"{float(value)!r}_dp" for value in values]
    lines = [", ".join(words[i : i + 4]) for i in range(0, len(words), 4)]
    literals = ", &\n    ".join(lines)
    return (
        f"\n  real(dp), parameter, public :: {name}({shape}) = reshape([ &\n"
        f"    {literals}], [{shape}])\n"
    )


def texts() -> dict[str, str]:
    """Return the text of the Fortran module by its file."""
    return {"gauss_tables.f90": module()}


def module() -> str:
    """Return the text of the Fortran module."""
    zero = Decimal(0)
    all_nodes: list[Decimal] = []
    high: list[Decimal] = []
    low: list[Decimal] = []
    matrix: list[Decimal] = []
    onward: list[Decimal] = []
    with localcontext(prec=DIGITS):
        for stages in range(1, MOST + 1):
            rest = [zero] * (MOST - stages)
            c = nodes(stages)
            b = integrals(c, zero, Decimal(1))
            all_nodes += c + rest
            high += b + rest
            low += [x - Decimal(float(x)) for x in b] + rest
            # Column j: the part of the rate at node j in each stage, of this step and of the next.
            rows = [integrals(c, zero, x) for x in c]
            next_rows = [integrals(c, Decimal(1), 1 + x) for x in c]
            for table, source in ((matrix, rows), (onward, next_rows)):
                for j in range(MOST):
                    used = j < stages
                    table += [source[i][j] if used and i < stages else zero for i in range(MOST)]
        matrix_low = [x - Decimal(float(x)) for x in matrix]
        square, cube = f"{MOST}, {MOST}", f"{MOST}, {MOST}, {MOST}"
        return (
            HEADER.format(most=MOST)
            + _table("NODES", square, all_nodes)
            + _table("WEIGHTS", square, high)
            + _table("WEIGHTS_LOW", square, low)
            + _table("MATRIX", cube, matrix)
            + _table("MATRIX_LOW", cube, matrix_low)
            + _table("ONWARD", cube, onward)
            + "\nend module gauss_tables\n"
        )
