"""LAPACK's DGTSV (a tridiagonal system of order 4), called in SciPy, and a port of it."""

from scipy.linalg.lapack import dgtsv


def original(*x):
    _, _, _, solution, info = dgtsv(x[0:3], x[3:7], x[7:10], x[10:14])
    return [[*solution, info]]


def port(*x):
    low, diagonal, high, b = list(x[0:3]), list(x[3:7]), list(x[7:10]), list(x[10:14])
    n = len(diagonal)
    second = [0.0] * n  # the second superdiagonal, filled by exchanges of rows
    for k in range(n - 1):
        if abs(diagonal[k]) >= abs(low[k]):
            if diagonal[k] == 0.0:
                return [[*b, k + 1]]
            factor = low[k] / diagonal[k]
            diagonal[k + 1] -= factor * high[k]
            b[k + 1] -= factor * b[k]
        else:
            factor = diagonal[k] / low[k]
            diagonal[k] = low[k]
            diagonal[k + 1], high[k] = high[k] - factor * diagonal[k + 1], diagonal[k + 1]
            if k < n - 2:
                second[k] = high[k + 1]
                high[k + 1] = -factor * second[k]
            b[k], b[k + 1] = b[k + 1], b[k] - factor * b[k + 1]
    if diagonal[n - 1] == 0.0:
        return [[*b, n]]
    b[n - 1] /= diagonal[n - 1]
    b[n - 2] = (b[n - 2] - high[n - 2] * b[n - 1]) / diagonal[n - 2]
    for k in range(n - 3, -1, -1):
        b[k] = (b[k] - high[k] * b[k + 1] - second[k] * b[k + 2]) / diagonal[k]
    return [[*b, 0]]
