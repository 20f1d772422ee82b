"""Polhodes, the curves of torque-free omega, and growth rates for all bodies, as data for plots.

A polhode is represented by the directions of the angular momentum.
"""

import math
from collections.abc import Iterator

import numpy as np

from pyharness.model.scene import Triple
from pyharness.model.trajectory import Array

# Largest angle between each curve and the axis that it encircles (rad). On the separatrix this
# angle is 90 degrees.
_ANGLES = tuple(math.radians(degrees) for degrees in (18.0, 36.0, 54.0, 72.0))
_POINTS = 181


def polhodes(moments: Triple) -> Iterator[tuple[str, Array]]:
    """Yield the name and the points, shape (n, 3), of torque-free curves of L / abs(L).

    L is the angular momentum along the body axes. The last two curves are the separatrix, in the
    planes L3 / L1 = +- sqrt((j1 - j2) / (j2 - j3)). Here j = 1 / I (kg m2), and axis 2 has the
    middle moment. With two equal moments both planes are perpendicular to the third axis. A sphere
    has no curves.
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
    # Angle of the planes of the separatrix from the axis of the largest 1 / I.
    tilt = math.atan2(math.sqrt(j[high] - j[middle]), math.sqrt(j[middle] - j[low]))
    for sign in (1.0, -1.0):
        across = math.cos(tilt) * unit[high] + sign * math.sin(tilt) * unit[low]
        yield "separatrix", np.outer(np.cos(turn), unit[middle]) + np.outer(np.sin(turn), across)


def growth_of_bodies(first: Array, third: Array) -> Array:
    """Return the growth rate Re Q about each middle axis, divided by the spin.

    Q is the fastest rate of equation 32. `first` and `third` are Smelt's numbers K1 = A and K3 =
    -C, from -1 to 1.
    """
    a, c = first, -third
    # Coefficients of a body satisfy A + B + C + ABC = 0. At two corners of the square of K1 and K3,
    # for bodies without extent, B is arbitrary.
    with np.errstate(invalid="ignore"):
        b = -(a + c) / (1.0 + a * c)
    b = np.where(np.isfinite(b), b, 0.0)
    return np.asarray(np.sqrt(np.maximum.reduce([b * c, c * a, a * b, np.zeros_like(a)])))
