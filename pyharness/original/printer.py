"""The line-printer output of a program, made from its trajectory.

The page is the text that appeared on paper. It lacks the first character of each record, which
controls the carriage and is always a blank. `data/printer.toml` contains the FORMATs of the
programs, and marks which parts of them are conjecture. The library `fortranformat` writes the
values by the FORMATs. Only zeros and values that are not finite are treated in this module.
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
# A value that is not finite is printed as asterisks, like a value that is too wide for its field.
# The machine printed R or I instead, which contains no more information.
_TOO_WIDE = 1e300
_PLACES = re.compile(r"F\d+\.(\d+)")


def page(scene: Scene, program: str, trajectory: Trajectory) -> str:
    """Return the text that `program` prints for its run, written by the program's FORMATs.

    The header contains the moments and torques of `scene`, which must have moments. It is followed
    by one line for each row of `trajectory`, which contains the results of the run. If the stop
    test ended the run, the last line is the row of the step that failed the test. Lines have no
    trailing blanks.
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
    """Return omega (rad/s) and velocity (m/s) of each row of a trajectory, as six floats.

    If the arithmetic of the run was not binary64, its numbers are rounded to as many decimals as
    `form`, the FORMAT of the rows, prints. The floats are then printed like the exact numbers.
    """
    if trajectory.exact is None:
        assert trajectory.velocity is not None
        return np.hstack([trajectory.omega, trajectory.velocity]).tolist()  # type: ignore[no-any-return]
    (places,) = {int(each) for each in _PLACES.findall(form)}
    return [[_to_places(x, places) for x in row[2:]] for row in trajectory.exact.tolist()]


def _to_places(x: Any, places: int) -> float:
    """Return the number `x` rounded to `places` decimals, with ties away from zero, as a float.

    `x` is a float, or a `Number` in another floating-point format. A number that is not finite
    becomes nan.
    """
    if not is_finite(x):
        return math.nan
    value = Fraction(x) if isinstance(x, float) else x.fraction()
    scaled = math.floor(abs(value) * 10**places + Fraction(1, 2))
    try:
        return math.copysign(scaled / 10**places, value)
    except OverflowError:
        return math.inf


def formats_of(program: str) -> dict[str, Any]:
    """Return the FORMATs of a program, by the keys ``header``, ``heads`` and ``rows``.

    ``header`` is the FORMAT of moments and torques, ``heads`` of the column heads, and ``rows`` of
    a row of results. Further keys name the cards of the FORMATs, and say which characters are
    certain and which are conjecture.
    """
    formats: dict[str, dict[str, Any]] = {
        each["name"]: each for each in facts("printer")["program"]
    }
    return formats[program]


def _torque_cards(scene: Scene) -> tuple[float, float, float]:
    """Return the three torques (N m) on the punched input cards for a scene.

    No card can express a torque that varies with time. Therefore, if the scene is a case of Table 1
    of the thesis that specifies initial torques, the result is these torques. For any other scene
    the result is its constant torques.
    """
    cards = {entry["case"]: entry["torque"] for entry in facts("printer")["initial_torque"]}
    first, second, third = cards.get(scene.case, scene.law.constant)
    return first, second, third


def write(text: str, values: Sequence[float]) -> list[str]:
    """Return the records (lines) that a WRITE statement of FORTRAN makes of some values.

    `text` is the FORMAT of the statement, and `values` are the values. Each record begins with its
    carriage-control character.
    """
    printed: str = _writer(text).write([x if math.isfinite(x) else _TOO_WIDE for x in values])
    return [_MINUS_ZERO.sub(r" \1", record) for record in printed.split("\n")]


@cache
def _writer(text: str) -> Any:
    from fortranformat import FortranRecordWriter

    return FortranRecordWriter(text)
