"""Linear algebra in fractions: what is exactly true where binary64 rounds."""

from collections.abc import Sequence
from fractions import Fraction

Exact = list[list[Fraction]]

_UNIT = Fraction(1, 2**53)


def inverse(matrix: Exact) -> Exact:
    """Return the inverse of a regular matrix."""
    count = len(matrix)
    rows = [[*row, *(Fraction(int(i == j)) for j in range(count))] for i, row in enumerate(matrix)]
    for j in range(count):
        pivot = max(range(j, count), key=lambda i: abs(rows[i][j]))
        rows[j], rows[pivot] = rows[pivot], rows[j]
        rows[j] = [x / rows[j][j] for x in rows[j]]
        for i in range(count):
            if i != j:
                rows[i] = [x - rows[i][j] * y for x, y in zip(rows[i], rows[j], strict=True)]
    return [row[count:] for row in rows]


def fractions(matrix: Sequence[Sequence[float]]) -> Exact:
    """Return a matrix of floats, exactly."""
    return [[Fraction(x) for x in row] for row in matrix]


def gamma(count: int) -> Fraction:
    """Return n u / (1 - n u), the bound of n roundings in a row (Higham 2002, lemma 3.1)."""
    return count * _UNIT / (1 - count * _UNIT)


def absolute(values: Sequence[Fraction]) -> list[Fraction]:
    """Return the size of each element."""
    return [abs(x) for x in values]


def magnitudes(matrix: Exact) -> Exact:
    """Return the size of each element."""
    return [absolute(row) for row in matrix]


def norm(matrix: Exact) -> Fraction:
    """Return the largest row sum of sizes."""
    return max(sum(absolute(row), Fraction(0)) for row in matrix)


def product(first: Exact, second: Exact) -> Exact:
    """Return the product of two matrices."""
    columns = list(zip(*second, strict=True))
    return [[dot(row, column) for column in columns] for row in first]


def times(matrix: Exact, vector: Sequence[Fraction]) -> list[Fraction]:
    """Return matrix times vector."""
    return [dot(row, vector) for row in matrix]


def dot(first: Sequence[Fraction], second: Sequence[Fraction]) -> Fraction:
    """Return the sum of products."""
    return sum((x * y for x, y in zip(first, second, strict=True)), Fraction(0))
