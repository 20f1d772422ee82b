"""Polhodes on the momentum sphere, and the growth of all bodies, as numbers to be drawn."""

import math
from collections.abc import Iterator

import numpy as np

from pyharness.model.scene import Triple
from pyharness.model.trajectory import Array

# Of a curve around an axis where it is farthest from that, as a part of the way to the separatrix.
_ANGLES = tuple(math.radians(degrees) for degrees in (18.0, 36.0, 54.0, 72.0))
_POINTS = 181


def polhodes(moments: Triple) -> Iterator[tuple[str, Array]]:
    """Give curves of L / abs(L) without torque by name, shape (n, 3) each; a sphere has none.

    Along each both sum L**2 and sum L**2 / I stay as they are. Last come the two planes of the
    separatrix, L3 / L1 = +- sqrt((j1 - j2) / (j2 - j3)) where j = 1 / I and axis 2 is the middle
    one; where two moments are equal both are the plane across the third axis.
    """
    high, middle, low = sorted(range(3), key=lambda axis: moments[axis])
    j = min(moments) / np.array(moments)
    if j[high] == j[low]:
        return
    turn = np.linspace(0.0, 2.0 * np.pi, _POINTS)
    unit = np.eye(3)
    for axis, far in ((high, low), (low, high)):
        if j[axis] == j[middle]:
            continue
        flat = (j[middle] - j[axis]) / (j[far] - j[axis])
        for angle in _ANGLES:
            to_middle = math.sin(angle) * np.sin(turn)
            to_far = math.sin(angle) * math.sqrt(flat) * np.cos(turn)
            up = np.sqrt(1.0 - to_middle**2 - to_far**2)
            for sign in (1.0, -1.0):
                curve = np.outer(to_middle, unit[middle]) + np.outer(to_far, unit[far])
                name = f"around axis {'+' if sign > 0.0 else '-'}{axis + 1}"
                yield name, curve + np.outer(sign * up, unit[axis])
    # Beside the middle axis, from that of the largest 1 / I.
    tilt = math.atan2(math.sqrt(j[high] - j[middle]), math.sqrt(j[middle] - j[low]))
    for sign in (1.0, -1.0):
        across = math.cos(tilt) * unit[high] + sign * math.sin(tilt) * unit[low]
        yield "separatrix", np.outer(np.cos(turn), unit[middle]) + np.outer(np.sin(turn), across)


def growth_of_bodies(first: Array, third: Array) -> Array:
    """Return Re Q about the middle axis over the spin, for Smelt's numbers K1 and K3 of bodies.

    K1 = A and K3 = -C; all bodies are in the square from -1 to 1.
    """
    a, c = first, -third
    # Of moments A + B + C + ABC = 0; at two corners, bodies without extent, B is anything.
    with np.errstate(invalid="ignore"):
        b = -(a + c) / (1.0 + a * c)
    b = np.where(np.isfinite(b), b, 0.0)
    return np.asarray(np.sqrt(np.maximum.reduce([b * c, c * a, a * b, np.zeros_like(a)])))
