"""A port of lorenz.c with NumPy."""

import numpy as np


def slope(y):
    return np.array(
        [10.0 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8.0 * y[2] / 3.0]
    )


def solve(x, y, z, steps):
    state, h, rows = np.array([x, y, z]), 0.01, []
    for n in range(1, steps + 1):
        a = slope(state)
        b = slope(state + 0.5 * h * a)
        c = slope(state + 0.5 * h * b)
        d = slope(state + h * c)
        state = state + h * (a + 2.0 * (b + c) + d) / 6.0
        rows.append([round(n * h, 2), *state])
    return rows
