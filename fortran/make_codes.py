"""Write the constants that Python and the kernels share as Fortran modules, one for each class."""

import runpy
import sys
from collections.abc import Iterator
from pathlib import Path


def modules(source: str) -> str:
    """Return the text of the Fortran modules for the classes in pyharness/model/codes.py."""
    classes = [each for each in runpy.run_path(source).values() if isinstance(each, type)]
    return "".join(f"{line}\n" for each in classes for line in _module(each))


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
    Path(sys.argv[2]).write_text(modules(sys.argv[1]))
