"""The printer page: a trajectory in, the lines of a line printer out.

The page is what paper showed: the first character of each record, the carriage control, is
taken off. It is always a blank (`data/printer.toml` has the FORMATs and what is conjecture).
FORMATs are written by a library; FORTRAN 77 and a page of that time have two words of their own.
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

# Zero has no minus sign (FORTRAN 77, 13.5.9).
_MINUS_ZERO = re.compile(r"-(0?\.0*)(?!\d)")
# What is not finite does not fit: the machine printed R or I there, and asterisks say no less.
_TOO_WIDE = 1e300
_PLACES = re.compile(r"F\d+\.(\d+)")


def page(scene: Scene, program: str, trajectory: Trajectory) -> str:
    """Return the page of a program, by its FORMATs, without blanks at the ends of lines.

    The scene's moments, which it must have, and torques are the header; then one line for each
    row, that of a stop the last.
    """
    formats = formats_of(program)
    assert scene.moments is not None
    pairs = zip(scene.moments, _torque_cards(scene), strict=True)
    records = write(formats["header"], [value for pair in pairs for value in pair])
    records += write(formats["heads"], [])
    for index, row in enumerate(_printed_rows(trajectory, formats["rows"])):
        numbers = [index + 1]
        if trajectory.ier is not None:
            numbers.append(int(trajectory.ier[index]))
        records += write(formats["rows"], [*row[:3], *numbers, *row[3:]])
    return "".join(record[1:].rstrip() + "\n" for record in records)


def _printed_rows(trajectory: Trajectory, form: str) -> list[list[float]]:
    """Return omega and velocity; of another word the floats that are printed as its numbers are."""
    if trajectory.exact is None:
        assert trajectory.velocity is not None
        return np.hstack([trajectory.omega, trajectory.velocity]).tolist()  # type: ignore[no-any-return]
    (places,) = {int(each) for each in _PLACES.findall(form)}
    return [[_to_places(x, places) for x in row[2:]] for row in trajectory.exact.tolist()]


def _to_places(x: Any, places: int) -> float:
    """Return a number, of any word, to so many decimals; halves away from zero, as floats go."""
    if not is_finite(x):
        return math.nan
    value = Fraction(x) if isinstance(x, float) else x.fraction()
    scaled = math.floor(abs(value) * 10**places + Fraction(1, 2))
    try:
        return math.copysign(scaled / 10**places, value)
    except OverflowError:
        return math.inf


def formats_of(program: str) -> dict[str, Any]:
    """Return the FORMATs of a program, with what is certain about them."""
    formats: dict[str, dict[str, Any]] = {
        each["name"]: each for each in facts("printer")["program"]
    }
    return formats[program]


def _torque_cards(scene: Scene) -> tuple[float, float, float]:
    """Return the torques that the cards of the deck set: a law of time stands on none."""
    cards = {entry["case"]: entry["torque"] for entry in facts("printer")["initial_torque"]}
    first, second, third = cards.get(scene.case, scene.torque.constant)
    return first, second, third


def write(text: str, values: Sequence[float]) -> list[str]:
    """Return the records of one WRITE by a FORMAT, the carriage control included."""
    printed: str = _writer(text).write([x if math.isfinite(x) else _TOO_WIDE for x in values])
    return [_MINUS_ZERO.sub(r" \1", record) for record in printed.split("\n")]


@cache
def _writer(text: str) -> Any:
    from fortranformat import FortranRecordWriter

    return FortranRecordWriter(text)
