"""Random scenes with torques that nearly cancel."""

import math
from random import Random

from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw, Wave

# The kinds of torques that a method can merge into one, and the kinds that it cannot.
MERGED = ("one frequency", "opposite frequencies", "three cosines", "no frequency")
LEFT = ("near frequencies", "constant and cosine")


def _triple(source: Random, size: float) -> Triple:
    return source.gauss(0.0, size), source.gauss(0.0, size), source.gauss(0.0, size)


def _times(values: Triple, factor: float) -> Triple:
    return values[0] * factor, values[1] * factor, values[2] * factor


def cancelling(kind: str, number: int) -> Scene:
    """Return a random body near rest whose torques cancel to 1e-2 to 1e-11 of their size."""
    source = Random(f"cancelling/{kind}/{number}")
    frequency, left = source.uniform(0.5, 4.0), 10.0 ** -source.uniform(2.0, 11.0)
    amplitude = _triple(source, source.uniform(0.3, 1.0) / left)
    sines: list[Wave] = [(amplitude, frequency)]
    cosines: list[Wave] = []
    constant: Triple = (0.0, 0.0, 0.0)
    if kind == "one frequency":
        sines += [(_times(amplitude, left - 1.0), frequency)]
    elif kind == "opposite frequencies":
        sines += [(_times(amplitude, 1.0 - left), -frequency)]
    elif kind == "three cosines":
        sines, cosines = [], [(amplitude, frequency), (_times(amplitude, -0.3), -frequency)]
        cosines += [(_times(amplitude, left - 0.7), frequency)]
    elif kind == "no frequency":
        sines, cosines = [], [(amplitude, 0.0)]
        constant = _times(amplitude, left - 1.0)
    elif kind == "near frequencies":
        sines += [(_times(amplitude, -1.0), frequency * (1.0 + left))]
    elif kind == "constant and cosine":
        sines, cosines = [], [(amplitude, math.sqrt(left))]
        constant = _times(amplitude, -1.0)
    omega = _triple(source, source.choice((0.0, 0.5)))
    moments = (source.uniform(1.0, 1.5), source.uniform(1.5, 2.0), source.uniform(2.0, 2.5))
    law = TorqueLaw(constant, sines=sines, cosines=cosines)
    return Scene(kind, omega, moments=moments, torque=law)
