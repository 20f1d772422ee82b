"""Write the constants that Python and the kernels share, from pyharness/model/codes.py.

Each class becomes a Fortran module in a file of its own, because Meson records one module per file.
C code gets a header, codes.h.
"""

import runpy
from collections.abc import Iterator
from pathlib import Path

from pyharness.model.fixed_steps import FIXED_STEPS
from pyharness.model.listing import flagged

SOURCE = Path(__file__).resolve().parents[1] / "pyharness/model/codes.py"


def texts(source: Path = SOURCE) -> dict[str, str]:
    """Return the texts of the files by name."""
    classes = {
        name: {each: value for each, value in vars(codes).items() if each.isupper()}
        for name, codes in runpy.run_path(str(source)).items()
        if isinstance(codes, type)
    }
    for number, each in enumerate(FIXED_STEPS, classes["Methods"]["FIXED"] + 1):
        classes["Methods"][each.name.upper().replace("-", "_")] = number
    found = {
        f"{name.lower()}.f90": "\n".join([*_module(name.lower(), numbers), ""])
        for name, numbers in classes.items()
    }
    # The other statuses include OVERFLOW, a macro of some math.h.
    for_c = classes["Operations"] | classes["Storage"]
    for_c["COMPLETE"] = classes["Statuses"]["COMPLETE"]
    listed = ", ".join(f"{name} = {value}" for name, value in for_c.items())
    found["listing.f90"] = "\n".join([*_listing(), ""])
    return found | {"codes.h": f"enum {{ {listed} }};\n"}


def _module(name: str, numbers: dict[str, int | float]) -> Iterator[str]:
    yield f"module {name}"
    yield "  !! Written by fortran/make_codes.py; pyharness/model/codes.py says what is what."
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


def _listing() -> Iterator[str]:
    names = {each["id"].replace("-", "_"): each["flag"] for each in flagged()}
    yield "module listing_flags"
    yield "  !! Active defects, readings and conjectures of the appendix, one bit each. Written by"
    yield "  !! fortran/make_codes.py from `flag` in pyharness/data/apparatus.toml."
    yield "  implicit none(type, external)"
    yield "  private"
    yield "  type, public :: listing_t"
    yield from (f"    logical :: {name}" for name in names)
    yield "  end type listing_t"
    yield "  public :: listing_from_bits"
    yield "contains"
    yield "  pure function listing_from_bits(bits) result(listing)"
    yield "    integer, intent(in) :: bits !! sum of 2**flag over the active names"
    yield "    type(listing_t) :: listing"
    yield from (f"    listing%{name} = btest(bits, {flag})" for name, flag in names.items())
    yield "  end function listing_from_bits"
    yield "end module listing_flags"
