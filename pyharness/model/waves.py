"""Exact sums of a torque law's waves of the same frequency.

A solver rounds each quotient of amplitude and moment: if two amplitudes cancel to 1e-10 of their
size, the sum has only six correct digits. A merged law has at most one sine and one cosine of each
frequency, and no wave of frequency 0.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Array
from pyharness.model.errors import InputError
from pyharness.model.inertia import Exact
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.model.values import Triple, triple

ExactWave = tuple[Exact, float]

_ZERO = (Fraction(0), Fraction(0), Fraction(0))


def merged(law: TorqueLaw) -> TorqueLaw:
    return exact_law(law) if is_mergeable(law) else law


def is_mergeable(law: TorqueLaw) -> bool:
    for waves in filter(None, (law.sines, law.cosines)):
        # Waves of amplitude 0 do not count.
        counts = Counter(abs(frequency) for amplitude, frequency in waves if any(amplitude))
        if 0.0 in counts or any(count > 1 for count in counts.values()):
            return True
    return False


def exact_law(law: TorqueLaw, turn: Callable[[Exact], Exact] | None = None) -> TorqueLaw:
    """Return a law with exact sums of waves by frequency, rotated by `turn`, then rounded."""
    constant, rate = (triple(map(Fraction, each)) for each in (law.constant, law.rate))
    sines, cosines = _summed(law.sines, even=False), _summed(law.cosines, even=True)
    # A cosine of frequency 0 is 1 at all times, whereas a sine is 0.
    for amplitude, frequency in cosines:
        if frequency == 0.0:
            constant = _sum(constant, amplitude)

    def rounded(vector: Exact) -> Triple:
        try:
            return triple(map(float, vector if turn is None else turn(vector)))
        except OverflowError:
            raise InputError(
                "[torque]: the sum of waves of one frequency overflows; allowed: "
                f"amplitudes up to {math.ldexp(1.0, 1023):.2g} N m together"
            ) from None

    waves = [[(rounded(each), f) for each, f in found if f != 0.0] for found in (sines, cosines)]
    return TorqueLaw(rounded(constant), rounded(rate), waves[0], waves[1], law.frame)


def _summed(waves: Iterable[Wave], even: bool) -> list[ExactWave]:
    """Return the nonzero sums of waves (cosines if `even`) of the same absolute frequency."""
    found: dict[float, tuple[float, Exact]] = {}
    for amplitude, frequency in waves:
        exact = triple(map(Fraction, amplitude))
        first, total = found.get(abs(frequency), (frequency, _ZERO))
        if not even and first != frequency:
            exact = triple(-x for x in exact)
        found[abs(frequency)] = first, _sum(total, exact)
    return [(total, frequency) for frequency, total in found.values() if any(total)]


def _sum(x: Exact, y: Exact) -> Exact:
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


def with_merged_waves(scene: Scene) -> Scene:
    if not isinstance(scene.torque, TorqueLaw):
        return scene
    law = merged(scene.torque)
    return scene if law is scene.torque else replace(scene, torque=law)


def with_merged_rows(constant: Array, sines: Array, cosines: Array) -> tuple[Array, Array, Array]:
    """Return constants, (m, 3), sines, (m, k, 4), and cosines, (m, l, 4), of torque laws.

    Waves of equal frequency are summed.
    """
    # A wave is three amplitudes and a frequency (rad/s); waves are padded with zeros. One row may
    # apply to all m laws.
    concerned = _mergeable_rows(sines, cosines)
    if not concerned.any():
        return constant, sines, cosines
    rows = max(map(len, (constant, sines, cosines)))
    sines, cosines = (each if each.size else np.empty((1, 0, 4)) for each in (sines, cosines))
    constant, sines, cosines = (
        np.array(np.broadcast_to(each, (rows, *each.shape[1:])))
        for each in (constant, sines, cosines)
    )
    for n in np.flatnonzero(np.broadcast_to(concerned, (rows,))):
        if not all(np.isfinite(each[n]).all() for each in (constant, sines, cosines)):
            continue
        of_sines, of_cosines = (
            [(x[:3], x[3]) for x in each[n].tolist()] for each in (sines, cosines)
        )
        law = TorqueLaw(constant[n].tolist(), sines=of_sines, cosines=of_cosines)
        try:
            law = merged(law)
        except InputError:
            # The sum overflows; with an infinite constant, the status of this body shows it.
            constant[n] = np.inf
            continue
        constant[n] = law.constant
        for array, waves in ((sines, law.sines), (cosines, law.cosines)):
            array[n] = 0.0
            for place, (amplitude, frequency) in enumerate(waves):
                array[n, place] = *amplitude, frequency
    return constant, _without_empty(sines), _without_empty(cosines)


def _mergeable_rows(sines: Array, cosines: Array) -> NDArray[np.bool_]:
    """Return a mask of the laws that `merged` changes, (m,), or (1,) for shared rows."""
    found = np.zeros(1, bool)
    for waves in (sines, cosines):
        if waves.size:
            acts = waves[..., :3].any(axis=-1)
            frequencies = np.abs(waves[..., 3])
            # Waves of amplitude 0 are padding.
            found = found | (acts & (frequencies == 0.0)).any(axis=-1)
            sizes = np.sort(np.where(acts, frequencies, np.nan), axis=-1)
            found = found | (sizes[:, 1:] == sizes[:, :-1]).any(axis=-1)
    return found


def _without_empty(waves: Array) -> Array:
    is_one = waves[..., :3].any(axis=-1) | ~np.isfinite(waves[..., 3])
    return np.ascontiguousarray(waves[:, is_one.any(axis=0)])
