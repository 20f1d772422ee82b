"""Write the constants that Python and the kernels share.

The constants of each class are written as a Fortran module, or those of the operations as a C
header.
"""

import runpy
import sys
from collections.abc import Iterator
from pathlib import Path


def modules(source: str) -> str:
    """Return the text of the Fortran modules for the classes in pyharness/model/codes.py."""
    classes = [each for each in runpy.run_path(source).values() if isinstance(each, type)]
    return "".join(f"{line}\n" for each in classes for line in _module(each))


def header(source: str) -> str:
    """Return the text of a C header with the operations of tapes."""
    codes = runpy.run_path(source)["Operations"]
    numbers = (f"{each} = {value}" for each, value in vars(codes).items() if each.isupper())
    return f"enum {{ {', '.join(numbers)} }};\n"


def _module(codes: type) -> Iterator[str]:
    name = codes.__name__.lower()
    yield f"module {name}"
    yield "  !! Written by fortran/make_codes.py; pyharness/model/codes.py says what is what."
    numbers = {each: value for each, value in vars(codes).items() if each.isupper()}
    if any(isinstance(value, float) for value in numbers.values()):
        yield "  use, intrinsic :: iso_fortran_env, only: real64"
    yield "  implicit none(type, external)"
    yield "  private"
    for each, value in numbers.items():
        if isinstance(value, float):
            yield f"  real(real64), parameter, public :: {each} = {value!r}_real64"
        else:
            yield f"  integer, parameter, public :: {each} = {value}"
    yield f"end module {name}"


if __name__ == "__main__":
    write = header if sys.argv[2].endswith(".h") else modules
    Path(sys.argv[2]).write_text(write(sys.argv[1]))
