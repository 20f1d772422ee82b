"""The orders, and the layout of series_t, that the C of unroll.py shares with Fortran."""

import re
import runpy
from math import prod
from pathlib import Path

_HERE = Path(__file__).parent
ORDERS = runpy.run_path(str(_HERE.parents[1] / "pyharness/model/codes.py"))["Series"]
REGISTER = 4  # numbers


def offsets(text: str) -> dict[str, int]:
    """Return the offset, in numbers, of each member of series_t in the text of taylor_series.f90.

    SystemExit unless all are of type real(c_double) and begin with a register.
    """
    constants = {"MOST_ORDER": ORDERS.MOST_ORDER}
    for name, value in re.findall(r"integer, parameter, public :: (\w+) = (\d+)", text):
        constants[name] = int(value)
    (body,) = re.findall(r"type, bind\(c\), public :: series_t\n(.*?) *end type", text, re.DOTALL)
    found, place = {}, 0
    for line in (each.partition("!")[0].strip() for each in body.splitlines()):
        member = re.fullmatch(r"real\(c_double\) :: (\w+)(?:\((.+)\))?", line)
        if line and (member is None or place % REGISTER):
            raise SystemExit(
                f"taylor_series.f90: series_t: '{line}': allowed is real(c_double) :: name(shape), "
                f"after a multiple of {REGISTER} numbers"
            )
        if member:
            found[member[1]] = place
            extents = (each.rpartition(":") for each in (member[2] or "1").split(","))
            place += prod(
                eval(last, constants) - eval(first or "1", constants) + 1
                for first, _, last in extents
            )
    return found


OFFSETS = offsets((_HERE / "taylor_series.f90").read_text())
