"""A port of pendulum.f."""

import math


def swing(a, w):
    h, rows = 0.01, []
    for n in range(1, 101):
        w -= h * (9.81 * math.sin(a))
        a += h * w
        rows.append([round(n * h, 2), a, w])
    return rows
