"""Torque laws, or fields of the same form, evaluated with symbols."""

from typing import Any

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.torque_law import TorqueLaw


def law_value(law: TorqueLaw, time: Any) -> Array:
    """Return the three components of a law at a time, about the law's axes."""
    found: list[Any] = [c + r * time for c, r in zip(law.constant, law.rate, strict=True)]
    waves = [(amplitude, np.sin(frequency * time)) for amplitude, frequency in law.sines]
    waves += [(amplitude, np.cos(frequency * time)) for amplitude, frequency in law.cosines]
    for amplitude, wave in waves:
        found = [each + a * wave for each, a in zip(found, amplitude, strict=True)]
    return np.array(found, dtype=object)


def law_integral(law: TorqueLaw, time: Any) -> Array:
    """Return the three components of the integral of a law from time 0."""
    square = time * time
    found: list[Any] = [
        c * time + 0.5 * r * square for c, r in zip(law.constant, law.rate, strict=True)
    ]
    for amplitude, frequency in law.sines:
        if frequency:
            # The integral, (1 - cos(f t))/f, without cancellation for small angles.
            half = np.sin(0.5 * frequency * time)
            wave = half * half
            found = [x + 2.0 * a / frequency * wave for x, a in zip(found, amplitude, strict=True)]
    for amplitude, frequency in law.cosines:
        wave = np.sin(frequency * time) if frequency else time
        divisor = frequency or 1.0
        found = [x + a / divisor * wave for x, a in zip(found, amplitude, strict=True)]
    return np.array(found, dtype=object)


def law_derivative(law: TorqueLaw) -> TorqueLaw:
    """Return the time derivative of a law; raise InputError if an amplitude overflows."""
    sines = [([-f * a for a in amplitude], f) for amplitude, f in law.cosines]
    cosines = [([f * a for a in amplitude], f) for amplitude, f in law.sines]
    return TorqueLaw(law.rate, sines=sines, cosines=cosines, frame=law.frame)


def to_body(vector: Any, attitude: Any) -> Array:
    """Return the components about the body axes of a vector about the axes of space.

    The matrix is written out, so that terms of one torque share its products.
    """
    u, v, w = vector
    a, x, y, z = attitude
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + a * z), 2.0 * (x * z - a * y)),
        (2.0 * (x * y - a * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + a * x)),
        (2.0 * (x * z + a * y), 2.0 * (y * z - a * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.array([p * u + q * v + s * w for p, q, s in rows], dtype=object)


def body_torque(law: TorqueLaw, time: Any, attitude: Any) -> Array:
    """Return the components of a law about the body axes."""
    value = law_value(law, time)
    return to_body(value, attitude) if law.in_space else value
