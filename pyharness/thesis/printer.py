"""A program's printed page and file TAPE5, from its trajectory.

The page omits each record's carriage control, a blank. `data/printer.toml` has the FORMATs, with
conjectural parts marked. The package `fortranformat` writes all values except negative zeros and
values that are not finite.
"""

import math
import re
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from pyharness.model.facts import facts
from pyharness.model.functions import is_finite
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.equations import card_torque

# Zero is printed without a minus sign (FORTRAN 77, 13.5.9).
_MINUS_ZERO = re.compile(r"-(0?\.0*)(?!\d)")
# Replaces a value that is not finite, so that it is printed as asterisks; the CDC printed R or I.
_TOO_WIDE = 1e300
_PLACES = re.compile(r"F\d+\.(\d+)")


def page(scene: Scene, program: str, trajectory: Trajectory) -> str:
    """Return the text that `program` prints for its run; `scene` must have moments."""
    formats = formats_of(program)
    assert scene.moments is not None
    pairs = zip(scene.moments, card_torque(scene) or scene.law.constant, strict=True)
    records = write(formats["header"], [value for pair in pairs for value in pair])
    records += write(formats["heads"], [])
    for index, row in enumerate(_printed_rows(trajectory, formats["rows"])):
        numbers = [index + 1]
        if trajectory.ier is not None:
            numbers.append(int(trajectory.ier[index]))
        records += write(formats["rows"], [*row[:3], *numbers, *row[3:]])
    return "".join(record[1:].rstrip() + "\n" for record in records)


def _printed_rows(trajectory: Trajectory, form: str) -> list[list[float]]:
    """Return omega (rad/s) and velocity (m/s) as floats that print like the exact values."""
    if trajectory.exact is None:
        assert trajectory.velocity is not None
        return np.hstack([trajectory.omega, trajectory.velocity]).tolist()  # type: ignore[no-any-return]
    # Numbers of another arithmetic than binary64 are rounded to the decimals of the FORMAT here.
    (places,) = {int(each) for each in _PLACES.findall(form)}
    return [[_to_places(x, places) for x in row[2:]] for row in trajectory.exact.tolist()]


def _to_places(x: Any, places: int) -> float:
    """Return a number rounded to `places` decimals, ties away from zero, or nan if not finite."""
    if not is_finite(x):
        return math.nan
    value = Fraction(x) if isinstance(x, float) else x.fraction()
    scaled = math.floor(abs(value) * 10**places + Fraction(1, 2))
    try:
        return math.copysign(scaled / 10**places, value)
    except OverflowError:
        return math.inf


def formats_of(program: str) -> dict[str, Any]:
    """Return a program's FORMATs: ``header`` (moments, torques), ``heads`` and ``rows``."""
    programs: list[dict[str, Any]] = facts("printer")["program"]
    return next(each for each in programs if each["name"] == program)


def write(text: str, values: Sequence[float]) -> list[str]:
    """Return the records of a WRITE of `values` with the FORMAT `text`, with carriage control."""
    printed: str = _writer(text).write([x if math.isfinite(x) else _TOO_WIDE for x in values])
    return [_MINUS_ZERO.sub(r" \1", record) for record in printed.split("\n")]


@cache
def _writer(text: str) -> Any:
    from fortranformat import FortranRecordWriter

    return FortranRecordWriter(text)


TAPE5 = np.dtype([("head", "<i4"), ("items", "<f8", (7,)), ("tail", "<i4")])
"""A record of TAPE5: its length in bytes, seven numbers, and the length again."""


def tape5(trajectory: Trajectory) -> bytes:
    """Return a trajectory with velocity as the bytes of TAPE5, in today's compilers' records."""
    assert trajectory.velocity is not None
    # The author's tape had other record marks and, we infer, 60-bit words.
    result = np.empty(len(trajectory.time), dtype=TAPE5)
    result["head"] = result["tail"] = TAPE5["items"].itemsize
    result["items"][:, 0] = trajectory.recorded_time
    result["items"][:, 1:4] = trajectory.omega
    result["items"][:, 4:7] = trajectory.velocity
    return result.tobytes()
