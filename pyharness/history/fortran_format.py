"""FORMAT, by a library; FORTRAN 77 and the paper of 1982 have two words of their own."""

import math
import re
from collections.abc import Sequence
from functools import cache
from typing import Any

# Zero has no minus sign (FORTRAN 77, 13.5.9).
_MINUS_ZERO = re.compile(r"-(0?\.0*)(?!\d)")
# What is not finite does not fit: the machine printed R or I there, and asterisks say no less.
_TOO_WIDE = 1e300


def write(text: str, values: Sequence[float]) -> list[str]:
    """Write a list by a FORMAT, as one WRITE statement does.

    Parameters
    ----------
    text : str
        The FORMAT, with its parentheses.
    values : sequence of float or int
        The list; whole numbers where the descriptor is `I`.

    Returns
    -------
    list of str
        The records, the character for the carriage control included.
    """
    printed: str = _writer(text).write([x if math.isfinite(x) else _TOO_WIDE for x in values])
    return [_MINUS_ZERO.sub(r" \1", record) for record in printed.split("\n")]


@cache
def _writer(text: str) -> Any:
    from fortranformat import FortranRecordWriter

    return FortranRecordWriter(text)
