"""A replacement for IMSL's LEQT1F, which solves A X = B.

It computes LU factors in Crout's order, with implicit row scaling and partial pivoting.
"""

SINGULAR = 129


def leqt1f(
    matrix: list[list[float]], right_hand_sides: list[list[float]]
) -> tuple[list[list[float]], int]:
    """Return the solutions x of A x = b and IER = 0 or, if A is singular, all b and IER = 129."""
    factors = [list(row) for row in matrix]
    pivots = _factor(factors)
    if pivots is None:
        return [list(b) for b in right_hand_sides], SINGULAR
    return [_substitute(factors, pivots, b) for b in right_hand_sides], 0


def _factor(a: list[list[float]]) -> list[int] | None:
    """Overwrite A with its LU factors; return the pivot row of each column, or None if singular."""
    n = len(a)
    pivots = []
    scale = []
    for row in a:
        biggest = max(abs(element) for element in row)
        if biggest == 0.0:
            return None
        scale.append(1.0 / biggest)

    for j in range(n):
        for i, row in enumerate(a):
            total = row[j]
            for k in range(min(i, j)):
                total = total - row[k] * a[k][j]
            row[j] = total

        # The pivot is the first of the elements with the largest scaled magnitude.
        biggest = 0.0
        pivot = j
        for i in range(j, n):
            scaled = scale[i] * abs(a[i][j])
            if scaled > biggest:
                biggest = scaled
                pivot = i
        if n + biggest == n:
            return None

        if pivot != j:
            a[j], a[pivot] = a[pivot], a[j]
            scale[pivot] = scale[j]
        pivots.append(pivot)
        for i in range(j + 1, n):
            a[i][j] = a[i][j] / a[j][j]
    return pivots


def _substitute(a: list[list[float]], pivots: list[int], b: list[float]) -> list[float]:
    n = len(a)
    x = list(b)
    for i, row in enumerate(a):
        total = x[pivots[i]]
        x[pivots[i]] = x[i]
        for k in range(i):
            total = total - row[k] * x[k]
        x[i] = total
    for i in reversed(range(n)):
        row = a[i]
        total = x[i]
        for k in range(i + 1, n):
            total = total - row[k] * x[k]
        x[i] = total / row[i]
    return x
