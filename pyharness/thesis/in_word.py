"""Runs of the programs in a floating-point format of `word.py`, such as the CDC's.

Python ports run in all formats, compiled programs only in IEEE 754 formats.
"""

import copy
import importlib
import itertools
import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pyharness.model.codes import Waves
from pyharness.model.errors import InputError
from pyharness.model.extension import REFUSED, columns, extension
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.compiled import program_arguments, read_rows
from pyharness.thesis.word import WORDS as WORDS
from pyharness.thesis.word import Number, Word

Of = TypeVar("Of", Scene, TorqueLaw)
Bytes = NDArray[np.int8]
_BITS = {24: 32, 53: 64, 113: 128}


def run(
    scene: Scene, listing: Listing, word: Word, lipschitz: float = 500.0, may_stop: bool = True
) -> Trajectory:
    """Run a listing's Python port in the arithmetic `word`, without checks.

    Results are rounded to floats; the trajectory's `exact` has them unrounded.
    """
    twin = importlib.import_module(f"pyharness.thesis.{listing.program.replace('-', '_')}")
    found: Trajectory = twin.run(scene_in(scene, word), listing, lipschitz, may_stop)
    if found.stop is None:
        return found
    return replace(found, stop=replace(found.stop, quotient=float(found.stop.quotient)))


def scene_in(scene: Scene, word: Word) -> Scene:
    """Return a checked scene with all numbers but attitude and counts in the format `word`."""
    law = scene.law

    def converted(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(converted, value))
        return None if value is None else word(value)

    def copied(frozen: Of, names: Sequence[str]) -> Of:
        # Copied without checks, which would convert the values to floats.
        changed = copy.copy(frozen)
        vars(changed).update({name: converted(getattr(frozen, name)) for name in names})
        return changed

    torque = copied(law, ("constant", "rate", "sines", "cosines"))
    names = ("omega", "moments", "coefficients", "masses", "forces", "step_size")
    found = copied(scene, names)
    object.__setattr__(found, "torque", torque)
    return found


def run_compiled(
    scene: Scene, listing: Listing, word: Word, lipschitz: float = 500.0, may_stop: bool = True
) -> Trajectory:
    """Run a compiled program in the arithmetic `word`, with the same result as `run`.

    Raise InputError if the compiler lacks this arithmetic, or a wave's angle is too large.
    """
    if word.p > 53:
        _check_angles(scene)
    inside = scene_in(scene, word)
    program, flags, by_moments, *triples, varies, _, _, step_size, n_steps, _, _, _ = (
        program_arguments(inside, listing, lipschitz, may_stop, True)
    )
    law = inside.body_torque
    waves = [columns(each, object) for each in (law.sines, law.cosines)]
    rows, ier, n_rows, status, evaluations, variable, quotient = extension().run_program_in_word(
        program,
        flags,
        by_moments,
        to_bytes(map(word, itertools.chain(*triples)), word, 3, 7),
        to_bytes([step_size, word(lipschitz)], word, 2),
        varies,
        *(to_bytes(map(word, each.T.flat), word, *each.shape) for each in waves),
        n_steps,
        may_stop,
        True,
    )
    if status == REFUSED:
        raise InputError(
            f"--word binary{8 * n_bytes(word)}: the compiler of this build does not have it; "
            "allowed: implementation python"
        )
    exact = from_bytes(rows[:, :, :n_rows], word).T
    ended = status, evaluations, variable, float(from_bytes(quotient, word)[()])
    trajectory = read_rows(listing, exact.astype(np.float64), ier, *ended)
    return replace(trajectory, exact=exact if n_rows else None)


def compiled_words() -> tuple[str, ...]:
    try:
        from pyharness import _build
    except ImportError:
        return ()
    return tuple(_build.WORDS)


def _check_angles(scene: Scene) -> None:
    # In the collocation programs TIME grows with the square of the number of steps.
    latest = scene.step_size * scene.steps**2
    law = scene.law
    for _, frequency in (*law.sines, *law.cosines):
        if not abs(frequency) * latest < 2.0**Waves.ANGLE_BITS:
            raise InputError(
                f"frequency {frequency:g} rad/s over {scene.steps} steps of {scene.step_size:g} s: "
                f"too large for the compiled sine of 128 bits; allowed: implementation python"
            )


def n_bytes(word: Word) -> int:
    return _BITS[word.p] // 8


def to_bytes(numbers: Iterable[Any], word: Word, *shape: int) -> Bytes:
    """Return numbers of the format `word` as bytes, in an array of shape (n_bytes(word), *shape).

    Numbers and array are in column-major order.
    """
    size = n_bytes(word)
    written = b"".join(_pattern(each).to_bytes(size, sys.byteorder) for each in numbers)
    # Copied, because a new array is aligned for any number.
    return np.array(np.frombuffer(written, np.int8).reshape((size, *shape), order="F"), order="F")


def from_bytes(given: Bytes, word: Word) -> NDArray[np.object_]:
    """Return the numbers that `to_bytes` converted."""
    patterns = (each.tobytes() for each in given.reshape(n_bytes(word), -1, order="F").T)
    found = [_number(int.from_bytes(each, sys.byteorder), word) for each in patterns]
    return np.array(found, dtype=object).reshape(given.shape[1:], order="F")


def _pattern(x: Number) -> int:
    p = x.word.p
    places, most = p - 1, (1 << _BITS[p] - p) - 1
    if x.m:
        sign, coefficient = x.m < 0, abs(x.m)
        # Subnormal numbers have the exponent field 0, but the last place of numbers with field 1.
        field = x.e + places + (most >> 1) if coefficient >> places else 0
        fraction = coefficient & (1 << places) - 1
    else:
        sign, fraction = math.copysign(1.0, x.e) < 0.0, 0
        field = 0 if x.e == 0.0 else most
        if math.isnan(x.e):
            sign, fraction = False, 1 << places - 1
    return (sign << _BITS[p] - p | field) << places | fraction


def _number(pattern: int, word: Word) -> Number:
    places, most = word.p - 1, (1 << _BITS[word.p] - word.p) - 1
    fraction = pattern & (1 << places) - 1
    field = pattern >> places & most
    sign = -1 if pattern >> _BITS[word.p] - 1 else 1
    if field == most:
        return word.number(0, math.nan if fraction else sign * math.inf)
    coefficient = fraction | (1 << places if field else 0)
    if not coefficient:
        return word.number(0, sign * 0.0)
    return word.number(sign * coefficient, max(field, 1) - places - (most >> 1))
